// In: a piece as it was found. Out: when something in it ended that its impulses took for all of it. An end within the first or the last
// share kBrief of the piece is none, nor one within kBrief^2 of a step, nor that of a pair that gives no more than that share of weight.
#include "engine/motion/group/stepper.h"

#include <algorithm>

#include "engine/geometry/round_contact.h"
#include "engine/motion/ride.h"
#include "engine/response/suite_frame.h"
#include "qp/smallness.h"

namespace islet::motion {

// [s] when the first slip ends, h: none does. Impulses of a piece oppose its mean slip, and where that is none they hold: as if the slip had
// its end's direction, or none, from the start. Until it ends friction is all that there can be.
double Stepper::SlipEnds(double h) const {
  double first = 1 - kBrief;
  bool found = false;
  for (size_t c = 0; c < held_.size(); ++c) {
    const Contact& contact = held_[c];
    const int a = contact.body_a, b = contact.body_b;
    if (MostFriction(c) == 0) continue;
    const Vector3 slip = SlipAtStart(c);
    const double speed = slip.norm();
    if (speed <= threshold_) continue;
    const Vector3 mean = MeanOf(c);
    const double end = 2 * mean.dot(slip) / speed - speed;
    if (end >= 0) continue;
    double rubs = 0, spare = 0;  // [N s] of the pair
    for (size_t k = 0; k < held_.size(); ++k) {
      if (held_of_[k].pair != held_of_[c].pair) continue;
      rubs += MostFriction(k);
      spare += std::max(0.0, MostFriction(k) + SlipAtStart(k).normalized().dot(impulse_W_[k]));
    }
    if (!(rubs > kBrief * h * pull_ * contact.friction * LighterMass(contact))) continue;
    const auto lightness = [&](int i) { return posed_[i].Moves() ? 1 / posed_[i].mass : 0; };
    const double share = speed / (speed - end + spare * (lightness(a) + lightness(b)));
    if (share <= kBrief || share * h <= kBrief * kBrief * dt_ || share >= first) continue;
    first = share;
    found = true;
  }
  return found ? first * h : h;
}

// Whether the slip of a contact that slides all through the piece turns by more than what is taken back at its end is turned by.
bool Stepper::SlipTurns(double h) const {
  const auto turns = [](const Vector3& x, const Vector3& y) {
    return x.cross(y).norm() > kLevel * x.norm() * y.norm() || x.dot(y) < 0;
  };
  for (size_t c = 0; c < held_.size(); ++c) {
    const double rubs = MostFriction(c), mass = LighterMass(held_[c]);
    if (!(rubs > kBrief * h * pull_ * held_[c].friction * mass)) continue;
    const Vector3 &n = held_[c].normal_W, u = MeanOf(c), start = SlipAtStart(c), mean = u - n.dot(u) * n,
                  end = 2 * mean - start;
    const double least = std::min({start.norm(), mean.norm(), end.norm()});
    if (start.isZero(0) || least * mass <= rubs) continue;  // it sticks, or comes to an end
    if (turns(start, mean) || turns(mean, end)) return true;
  }
  return false;
}

// [s] when the first support ends, h: none does. What pressed as the piece began, and at its end is open or faces another way, was a support
// as long as all its contacts are there if all goes on as it did; if without it the pair is open where the piece ends.
double Stepper::SupportEnds(double h) {
  double first = (1 - kBrief) * h;
  bool found = false;
  int asked = -1;
  for (size_t c = 0; c < now_.size(); ++c) {
    const int pair = now_pair_[c];
    if (pair == asked || !closed_[c] || force_W_[c].isZero(0) || GoesOn(c)) continue;
    asked = pair;
    double pressed = 0;  // [N] by the pair
    for (size_t k = 0; k < now_.size(); ++k)
      if (now_pair_[k] == pair) pressed += now_[k].normal_W.dot(force_W_[k]);
    if (!(pressed > kBrief * pull_ * LighterMass(now_[c]))) continue;
    const bool sinks = ClosedAt(pair, h, h) > 0;
    if (sinks && !IsOpenAtEnd(pair)) continue;  // it rolls around an edge
    const size_t closed = ClosedAt(pair, 0, 0);
    double until = 0, from = sinks || closed == 0 ? 0 : h;
    while (from - until > kBrief * kBrief * dt_) {
      const double t = 0.5 * (until + from);
      (ClosedAt(pair, t, t) < closed ? from : until) = t;
    }
    if (ClosedAt(pair, until, h) > 0) continue;
    // Forces that do not turn with what tips part it from its edge too soon: half of the piece tells more.
    if (h > kBrief * dt_) until = std::max(until, 0.5 * h);
    if (until > kBrief * kBrief * dt_ && until < first) first = until, found = true;
  }
  return found ? first : h;
}

// Whether what carried all through the piece was there for a part of it only, by what is left at its end: the contacts of a pair face another
// way, and press by less than half of what they did, or are others.
bool Stepper::WasThereInPart(double h) const {
  for (size_t c = 0; c < now_.size(); ++c) {
    if (!closed_[c] || GoesOn(c)) continue;
    const int pair = now_pair_[c];
    double pressed = 0, left = 0;
    for (size_t k = 0; k < held_.size(); ++k)
      if (held_of_[k].pair == pair) pressed += held_[k].normal_W.dot(impulse_W_[k]);
    if (!(pressed > kBrief * h * pull_ * LighterMass(now_[c]))) continue;
    bool same = false, other = false;
    for (size_t e = 0; e < end_.size(); ++e) {
      if (end_pair_[e] != pair) continue;
      left -= end_[e].normal_W.dot(settle_W_[e]);
      if (!CarriedBy(e).isZero(0)) (ClosedAtStart(e) ? same : other) = true;
    }
    if (left > 0.5 * pressed || (other && !same)) return true;
  }
  return false;
}

// Whether a contact that pressed as the piece began is there at its end.
bool Stepper::GoesOn(size_t at_start) const {
  for (size_t e = 0; e < end_.size(); ++e)
    if (end_pair_[e] == now_pair_[at_start] && end_[e].gap <= kTouching * Size(group_->pairs[end_pair_[e]]) &&
        (end_[e].normal_W - now_[at_start].normal_W).squaredNorm() < kNegligible)
      return true;
  return false;
}

// A body at t, under the forces of the start of the piece; from `until` on without those of a pair.
Pose Stepper::GoingOn(int i, int pair, double until, double t) const {
  const Body& b = group_->bodies[i];
  Path path{state_[i].pose, state_[i].linear_W, 0.5 * b.arc_W, VisibleSpinOf(i), Vector3::Zero(), 0};
  if (!b.Moves()) return path.At(t);
  Vector3 force = b.mass * settings_.gravity + b.force_W, torque = b.torque_W, without = force, turn = torque;
  for (size_t c = 0; c < now_.size(); ++c) {
    if (now_[c].body_a != i && now_[c].body_b != i) continue;
    const Vector3 pressed = (now_[c].body_b == i ? 1 : -1) * force_W_[c];
    const Vector3 moment = (now_[c].point_W - path.start.position_W).cross(pressed);
    force += pressed, torque += moment;
    if (now_pair_[c] != pair) without += pressed, turn += moment;
  }
  const auto turns = [&](const Vector3& of) -> Vector3 {
    return TurnsInItself(i) ? Vector3(Vector3::Zero()) : Vector3(0.5 * SpinOf(b, path.start.rotation_WB, of));
  };
  path.half_acceleration_W = 0.5 / b.mass * force;
  path.half_change_W = turns(torque);
  if (t <= until) return path.At(t);
  path = path.From(until);
  path.half_acceleration_W = 0.5 / b.mass * without;
  path.half_change_W = turns(turn);
  return path.At(t - until);
}

// How many contacts of a pair are closed at t, if all goes on up to `until`, and without the pair from there on.
size_t Stepper::ClosedAt(int pair, double until, double t) {
  const auto [a, b] = group_->pairs[pair];
  const double closed = kExact * Size(group_->pairs[pair]);
  probe_.clear();
  CollideShapes(*group_->shapes[a], GoingOn(a, pair, until, t).placement(), *group_->shapes[b],
                GoingOn(b, pair, until, t).placement(), closed, &probe_);
  ++work_;
  return static_cast<size_t>(
      std::count_if(probe_.begin(), probe_.end(), [&](const Contact& c) { return c.gap <= closed; }));
}

// [m/s] of a held contact, in the mean of the piece.
Vector3 Stepper::MeanOf(size_t c) const {
  return MeanVelocity(held_[c].body_b, acted_at_[c]) - MeanVelocity(held_[c].body_a, acted_at_[c]) +
         SurfaceSlip(held_[c]);
}

// [N s] of a held contact.
double Stepper::MostFriction(size_t c) const {
  return held_[c].friction * std::max(0.0, held_[c].normal_W.dot(impulse_W_[c]));
}

// [m/s] of a held contact where the piece begins; none where it did not touch, and on a wall whose velocity the user changed while nobody knew
// what held there: it may ride.
Vector3 Stepper::SlipAtStart(size_t c) const {
  const int found = FindAt(held_of_[c].pair, AsActed(c), Moment::kMiddle, Moment::kStart, now_);
  if (found < 0 || !closed_[found]) return Vector3::Zero();
  const Contact& contact = now_[found];
  const auto changed = [&](int i) { return Ride::Changed(group_->bodies[i]); };
  if (force_W_[found].isZero(0) && (changed(contact.body_a) || changed(contact.body_b))) return Vector3::Zero();
  const Vector3 u = state_[contact.body_b].VelocityAt(contact.point_W) -
                    state_[contact.body_a].VelocityAt(contact.point_W) + SurfaceSlip(contact);
  return u - contact.normal_W.dot(u) * contact.normal_W;
}

}  // namespace islet::motion
