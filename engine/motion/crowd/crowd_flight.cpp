// In: impulses that carry. Out: where bodies are halfway and at the end, and how fast.
#include "engine/motion/crowd/crowd.h"

#include "engine/rotation.h"

namespace islet::motion {

// The step under these impulses: parabolas, free turns, and half-way a kick to each angular momentum.
void Crowd::Fly() {
  const size_t n = bodies_.size();
  for (size_t i = 0; i < n; ++i) {
    Body& b = bodies_[i];
    if (!b.Moves()) continue;
    mean_W_[i] = free_[i].linear_W;
    mean_spin_W_[i] = dt_ * b.torque_W;  // [N m s] so far
  }
  for (size_t c = 0; c < held_.size(); ++c) {
    if (impulse_W_[c].isZero(0)) continue;
    const int a = held_[c].body_a, b = held_[c].body_b;
    if (!cut_[a]) mean_W_[a] -= 0.5 / bodies_[a].mass * impulse_W_[c];
    if (!cut_[b]) mean_W_[b] += 0.5 / bodies_[b].mass * impulse_W_[c];
  }
  for (size_t i = 0; i < n; ++i)
    if (!cut_[i]) {
      middle_[i].position_W = begin_[i].pose.position_W + 0.5 * dt_ * mean_W_[i];
      ways_[i] = {2 / dt_ * (mean_W_[i] - begin_[i].linear_W), mean_W_[i]};
    }
  off_ = OffChord(dt_);
  acted_at_.resize(held_.size());
  pool_->ForEachOf(held_.size(), [&](size_t c) {
    const int a = held_[c].body_a, b = held_[c].body_b;
    acted_at_[c] = held_[c].point_W + (Centre(held_[c]) - centre_[c]);
    if (impulse_W_[c].isZero(0)) return;
    Contact acts = held_[c];
    acts.point_W = acted_at_[c];
    FaceAxes(middle_[a].position_W, AxisOf(a, held_of_[c].faces_a), middle_[b].position_W,
             AxisOf(b, held_of_[c].faces_b), &acts);
    acted_at_[c] = acts.point_W;
  });
  for (size_t c = 0; c < held_.size(); ++c) {
    if (impulse_W_[c].isZero(0)) continue;
    const int a = held_[c].body_a, b = held_[c].body_b;
    if (!cut_[a]) mean_spin_W_[a] -= (acted_at_[c] - middle_[a].position_W).cross(impulse_W_[c]);
    if (!cut_[b]) mean_spin_W_[b] += (acted_at_[c] - middle_[b].position_W).cross(impulse_W_[c]);
  }
  pool_->ForEachOf(n, [&](size_t i) {
    Body& b = bodies_[i];
    if (b.kind == BodyKind::kKinematic) {
      b.position_W = begin_[i].pose.position_W + dt_ * mean_W_[i];
      b.linear_velocity_W = begin_[i].linear_W + dt_ * b.arc_W;
      b.rotation_WB = Turned(dt_ * b.angular_velocity_W, begin_[i].pose.rotation_WB);
    }
    if (!b.Moves()) return;
    const FreeTurn& half = free_[i].half;
    const Vector3 after =
        mean_spin_W_[i].isZero(0) ? half.spin_W : Vector3(half.spin_W + SpinOf(b, half.rotation_WB, mean_spin_W_[i]));
    const FreeTurn end = TurnFreely(b, half.rotation_WB, after, 0.5 * dt_);
    b.position_W = begin_[i].pose.position_W + dt_ * mean_W_[i];
    b.linear_velocity_W = 2 * mean_W_[i] - begin_[i].linear_W;
    b.rotation_WB = end.rotation_WB;
    b.angular_velocity_W = end.spin_W;
    mean_spin_W_[i] = 0.5 * (half.spin_W + after);
    travel_[i] = dt_ * b.linear_velocity_W;
  });
}

// [m/s] of a body's point halfway.
Vector3 Crowd::MeanVelocity(int i, const Vector3& point) const {
  return mean_W_[i] + mean_spin_W_[i].cross(point - middle_[i].position_W);
}

// [m] that a body takes a held contact on from halfway to the end.
Vector3 Crowd::TakesOn(int i, size_t c) const {
  const Vector3 moved = bodies_[i].position_W - middle_[i].position_W;
  if (TurnsInItself(i)) return moved;
  const Vector3 turn = 0.5 * dt_ * VisibleSpin(shapes_[i], bodies_[i].rotation_WB, mean_spin_W_[i]);
  const Vector3 along = turn.cross(acted_at_[c] - middle_[i].position_W);
  return moved + along + 0.5 * turn.cross(along);
}

// A point of a body in its frame, and back; what turns in itself has none of its own.
Vector3 Crowd::Inside(int i, const Pose& pose, const Vector3& point) const {
  const Vector3 r = point - pose.position_W;
  return TurnsInItself(i) ? r : Vector3(SeenAs(i, pose.rotation_WB).conjugate() * r);
}

Vector3 Crowd::Outside(int i, const Pose& pose, const Vector3& point) const {
  return pose.position_W + (TurnsInItself(i) ? point : Vector3(SeenAs(i, pose.rotation_WB) * point));
}

Vector3 Crowd::Centre(const Contact& c) const {
  return Shared(c, middle_[c.body_a].position_W, middle_[c.body_b].position_W);
}

Path Crowd::PathOf(int i) const {
  const State& s = begin_[i];
  return PathThrough(s.pose, s.linear_W, (1 / dt_) * (mean_W_[i] - s.linear_W),
                     VisibleSpin(shapes_[i], s.pose.rotation_WB, s.angular_W), SeenAs(i, bodies_[i].rotation_WB), dt_,
                     TurnRadius(shapes_[i]));
}

// Of a body, in the pass as it is now.
Course Crowd::CourseOf(int i) const {
  return {begin_[i].pose, middle_[i],      {bodies_[i].position_W, SeenAs(i, bodies_[i].rotation_WB)},
          mean_W_[i],     mean_spin_W_[i], TurnsInItself(i),
          Vector3::Zero()};
}

// A body's axis of symmetry where impulses act.
Vector3 Crowd::AxisOf(int i, bool faces) const {
  return faces && !cut_[i] ? Vector3(free_[i].half.rotation_WB * Vector3::UnitZ()) : Vector3(Vector3::Zero());
}

void Crowd::Face(const Held& held, const Vector3& centre_a, const Vector3& centre_b, Contact* contact) const {
  TurnToAxes(centre_a, AxisOf(contact->body_a, held.faces_a), centre_b, AxisOf(contact->body_b, held.faces_b), contact);
}

}  // namespace islet::motion
