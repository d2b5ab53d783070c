// In: impulses that carry. Out: where bodies are halfway and at the end, and how fast.
#include "engine/motion/group/stepper.h"

#include <algorithm>
#include <cmath>
#include <tuple>

#include "qp/smallness.h"

namespace islet::motion {
// Walls are where their velocity takes them, straight or on an arc, at time t of the step.
State Stepper::WallAt(size_t i, double t) const {
  const Body& b = group_->bodies[i];
  return {{b.position_W + t * b.linear_velocity_W + 0.5 * t * (t - dt_) * b.arc_W,
           Turned(t * b.angular_velocity_W, b.rotation_WB)},
          b.linear_velocity_W + (t - 0.5 * dt_) * b.arc_W,
          b.angular_velocity_W};
}

// The middle of its chord in the piece, and its mean velocity.
std::pair<Pose, Vector3> Stepper::WallHalfway(size_t i, double h) const {
  State state = WallAt(i, time_of_piece_ + 0.5 * h);
  state.pose.position_W += 0.125 * h * h * group_->bodies[i].arc_W;
  return {state.pose, state.linear_W};
}

void Stepper::PlaceWalls(double t, std::vector<State>* states) const {
  for (size_t i = 0; i < group_->bodies.size(); ++i)
    if (!group_->bodies[i].Moves()) (*states)[i] = WallAt(i, t);
}

// Positions and velocities of centres.
void Stepper::MoveCentres(double h) {
  off_ = OffChord(h);
  const std::vector<Body>& bodies = group_->bodies;
  for (size_t i = 0; i < bodies.size(); ++i)
    if (bodies[i].Moves())
      end_state_[i].linear_W = state_[i].linear_W + h * (settings_.gravity + bodies[i].force_W / bodies[i].mass);
  for (size_t c = 0; c < held_.size(); ++c) {
    const int a = held_[c].body_a, b = held_[c].body_b;
    if (bodies[a].Moves()) end_state_[a].linear_W -= impulse_W_[c] / bodies[a].mass;
    if (bodies[b].Moves()) end_state_[b].linear_W += impulse_W_[c] / bodies[b].mass;
  }
  for (size_t i = 0; i < bodies.size(); ++i) {
    if (!bodies[i].Moves()) continue;
    mean_W_[i] = 0.5 * (state_[i].linear_W + end_state_[i].linear_W);
    ways_[i] = {(end_state_[i].linear_W - state_[i].linear_W) / h, mean_W_[i]};
    end_state_[i].pose.position_W = state_[i].pose.position_W + h * mean_W_[i];
    middle_[i].position_W = state_[i].pose.position_W + 0.5 * h * mean_W_[i];
  }
}

// Contacts between two bodies that turn in themselves, with their impulses, into the line of centres halfway, where a normal impulse
// spins neither. Whether any turned.
bool Stepper::TurnIntoLine() {
  bool turned = false;
  for (size_t c = 0; c < held_.size(); ++c) {
    Contact& contact = held_[c];
    if (impulse_W_[c].isZero(0) || !TurnInThemselves(held_of_[c].pair)) continue;
    const Vector3 line = (middle_[contact.body_b].position_W - middle_[contact.body_a].position_W).normalized();
    const Vector3& from = middle_[contact.body_a].position_W;
    const Vector3 place = contact.point_W + CentreHalfway(contact) - held_of_[c].centre;
    contact.point_W += from + line.dot(place - from) * line - place;
    if ((line - contact.normal_W).squaredNorm() < kRounding * kRounding) continue;
    impulse_W_[c] = Quaternion::FromTwoVectors(contact.normal_W, line) * impulse_W_[c];
    contact.normal_W = line;
    turned = true;
  }
  return turned;
}

// The piece under these impulses: parabolas, free turns, and half-way a kick to each angular momentum. Both bodies of a contact
// take their impulse at one point.
void Stepper::Fly(double h) {
  const std::vector<Body>& bodies = group_->bodies;
  for (int round = 0; round == 0 || (TurnIntoLine() && round < kHalvings); ++round) MoveCentres(h);
  spin_gain_.assign(bodies.size(), Vector3::Zero());
  for (size_t i = 0; i < bodies.size(); ++i) {
    const Body& b = bodies[i];
    const State& s = state_[i];
    if (!b.Moves()) continue;
    turned_[i] = TurnFreely(b, s.pose.rotation_WB, s.angular_W, 0.5 * h);
    spin_gain_[i] = h * b.torque_W;
  }
  PlaceWalls(time_of_piece_ + h, &end_state_);
  for (size_t i = 0; i < bodies.size(); ++i) {
    if (bodies[i].Moves()) continue;
    std::tie(middle_[i], mean_W_[i]) = WallHalfway(i, h);
    ways_[i] = {bodies[i].arc_W, mean_W_[i]};
  }
  acted_at_.resize(held_.size());
  for (size_t c = 0; c < held_.size(); ++c) {
    const Contact& contact = held_[c];
    const int a = contact.body_a, b = contact.body_b;
    Contact acts = contact;
    acts.point_W += CentreHalfway(contact) - held_of_[c].centre;  // it moves along
    FaceAxes(middle_[a].position_W, AxisOf(a, held_of_[c].faces_a), middle_[b].position_W,
             AxisOf(b, held_of_[c].faces_b), &acts);
    acted_at_[c] = acts.point_W;
    spin_gain_[a] -= (acted_at_[c] - middle_[a].position_W).cross(impulse_W_[c]);
    spin_gain_[b] += (acted_at_[c] - middle_[b].position_W).cross(impulse_W_[c]);
  }
  for (size_t i = 0; i < bodies.size(); ++i) {
    const Body& b = bodies[i];
    if (!b.Moves()) continue;
    const Quaternion& half = turned_[i].rotation_WB;
    spun_after_[i] = turned_[i].spin_W;
    if (!spin_gain_[i].isZero(0)) spun_after_[i] += SpinOf(b, half, spin_gain_[i]);
    const FreeTurn end = TurnFreely(b, half, spun_after_[i], 0.5 * h);
    end_state_[i].pose.rotation_WB = end.rotation_WB;
    end_state_[i].angular_W = end.spin_W;
    const Vector3 turn = Log(end.rotation_WB * state_[i].pose.rotation_WB.conjugate());
    middle_[i].rotation_WB = Turned(0.5 * turn, state_[i].pose.rotation_WB);
  }
}

Path Stepper::PathOf(int i, double h) const {
  const Body& b = group_->bodies[i];
  const Shape& shape = *group_->shapes[i];
  const State &s = state_[i], &e = end_state_[i];
  if (!b.Moves()) return FreePath(b, shape, s, 0.5 * b.arc_W);
  // By its mean velocity: that at the end may be the one after a blow.
  const Vector3 half_acceleration_W = (mean_W_[i] - s.linear_W) / h;
  if (shape.HasAxis() && SymmetricAbout(b.inertia_B, 2) && spin_gain_[i].isZero(0))
    return FreePath(b, shape, s, half_acceleration_W);
  return PathThrough(s.pose, s.linear_W, half_acceleration_W, VisibleSpinOf(i),
                     VisibleRotation(shape, s.pose.rotation_WB, e.pose.rotation_WB), h, TurnRadius(shape));
}

// Ends the piece earlier, under the same forces.
void Stepper::EndAt(double at, double* h) {
  for (Vector3& impulse : impulse_W_) impulse *= at / *h;
  *h = at;
  Fly(at);
}

// A rotation that has the body where this pose has it, reached without a turn about its own axis.
Quaternion Stepper::SeenAs(int i, const Pose& pose) const {
  return VisibleRotation(*group_->shapes[i], state_[i].pose.rotation_WB, pose.rotation_WB);
}

// Where a place on the surface of a body, or of two, is at another time of the piece: round bodies show no turn in themselves.
Vector3 Stepper::CarriedWith(int i, const Vector3& point, Moment from, Moment to) const {
  const auto at = [&](Moment moment) -> const Pose& {
    return moment == Moment::kStart ? state_[i].pose : moment == Moment::kEnd ? end_state_[i].pose : middle_[i];
  };
  const Pose &x = at(from), &y = at(to);
  if (TurnsInItself(i)) return point + y.position_W - x.position_W;
  return y.position_W + SeenAs(i, y) * (SeenAs(i, x).conjugate() * (point - x.position_W));
}

Vector3 Stepper::Carried(const Contact& contact, Moment from, Moment to) const {
  return Shared(contact, CarriedWith(contact.body_a, contact.point_W, from, to),
                CarriedWith(contact.body_b, contact.point_W, from, to));
}

bool Stepper::TurnInThemselves(int pair) const {
  const auto [a, b] = group_->pairs[pair];
  return TurnsInItself(a) && TurnsInItself(b) && group_->bodies[a].Moves() && group_->bodies[b].Moves();
}

// Of a body, in the piece as it is now.
Course Stepper::CourseOf(int i) const {
  return {state_[i].pose, middle_[i],  {end_state_[i].pose.position_W, SeenAs(i, end_state_[i].pose)},
          mean_W_[i],     MeanSpin(i), TurnsInItself(i),
          Vector3::Zero()};
}

// A body's axis of symmetry where impulses act.
Vector3 Stepper::AxisOf(int i, bool faces) const {
  return faces && !cut_[i] ? Vector3(turned_[i].rotation_WB * Vector3::UnitZ()) : Vector3(Vector3::Zero());
}

void Stepper::Face(const Held& held, const Vector3& centre_a, const Vector3& centre_b, Contact* contact) const {
  TurnToAxes(centre_a, AxisOf(contact->body_a, held.faces_a), centre_b, AxisOf(contact->body_b, held.faces_b), contact);
}

// Of what the two bodies of a contact do, what the contact does.
Vector3 Stepper::Shared(const Contact& contact, const Vector3& of_a, const Vector3& of_b) const {
  const auto side = [&](int i) {
    const double mass = group_->bodies[i].Moves() ? 1 : INFINITY;  // nothing lands within: both alike
    return SideOf(*group_->shapes[i], state_[i].pose.rotation_WB, mass, contact.normal_W);
  };
  const Matrix3 share = ShareOfA(side(contact.body_a), side(contact.body_b), contact.normal_W);
  return share * of_a + (Matrix3::Identity() - share) * of_b;
}

// [m] of a body halfway, if it goes on as it does where the piece begins.
Vector3 Stepper::CentreAhead(int i, double h) const { return state_[i].pose.position_W + 0.5 * h * state_[i].linear_W; }

// [m] the same of a place on it.
Vector3 Stepper::PointAhead(int i, const Contact& contact, double h) const {
  const Vector3 arm = contact.point_W - state_[i].pose.position_W;
  if (TurnsInItself(i)) return CentreAhead(i, h) + arm;
  const Vector3 outward = (i == contact.body_a ? 1 : -1) * contact.normal_W;
  return CentreAhead(i, h) + arm +
         ArmChange(*group_->shapes[i], state_[i].pose.rotation_WB, 0.5 * h * VisibleSpinOf(i), arm, outward);
}

// [m] what a contact moves along with.
Vector3 Stepper::CentreHalfway(const Contact& contact) const {
  return Shared(contact, middle_[contact.body_a].position_W, middle_[contact.body_b].position_W);
}

// Between these points of start and end, on the arc about each body's axis.
Vector3 Stepper::Halfway(const Contact& contact, const Vector3& start, const Vector3& end) const {
  return Shared(contact, OnArc(CourseOf(contact.body_a), start, end), OnArc(CourseOf(contact.body_b), start, end));
}

// [rad/s] of a body halfway.
Vector3 Stepper::MeanSpin(int i) const {
  const Body& b = group_->bodies[i];
  return b.Moves() ? Vector3(0.5 * (turned_[i].spin_W + spun_after_[i])) : b.angular_velocity_W;
}

// [m/s] of a body's point halfway.
Vector3 Stepper::MeanVelocity(int i, const Vector3& point) const {
  return mean_W_[i] + MeanSpin(i).cross(point - middle_[i].position_W);
}

}  // namespace islet::motion
