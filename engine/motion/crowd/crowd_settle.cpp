// In: poses at the end, and what was carried. Out: the velocities there, after blows.
#include "engine/motion/crowd/crowd.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "engine/contact_pairs.h"
#include "engine/slice.h"
#include "engine/stopwatch.h"
#include "qp/smallness.h"

namespace islet::motion {
// [m/s^2] of gravity and forces on the two bodies of a contact together.
Vector3 Crowd::PullOn(const Contact& contact) const {
  Vector3 force = Vector3::Zero();
  double mass = 0;
  for (const int i : {contact.body_a, contact.body_b}) {
    if (cut_[i]) continue;
    force += bodies_[i].force_W;
    mass += bodies_[i].mass;
  }
  return force.isZero(0) ? settings_.gravity : Vector3(settings_.gravity + force / mass);
}

// Which contacts of the problem are blows, and what all of them ask of their normal velocity while blows are held with the rest.
void Crowd::FindHits() {
  hits_.assign(problem_.size(), 0);
  targets_.assign(problem_.size(), 0.0);
  approaches_.assign(problem_.size(), 0.0);
  pool_->ForEachOf(problem_.size(), [&](size_t c) {
    const Contact& contact = problem_[c];
    const Vector3 u = RelativeVelocity(contact, bodies_[contact.body_a], bodies_[contact.body_b]);
    // What carried nothing may close while it passes by as far as contacts reach: normals of faces that are askew differ by the gap over
    // their length.
    const double time = std::max(dt_, kReach * Size(contact) / u.norm());
    targets_[c] = -YieldOf(contact) - (Pressed(closed_[c]) ? 0 : ClosingSpeed(contact, time));
    if (YieldOf(contact) > 0) return;
    // What it had as the step began, and fell on a wall by then.
    const auto velocity = [&](int i) -> Vector3 {
      return begin_[i].linear_W + begin_[i].angular_W.cross(contact.point_W - bodies_[i].position_W);
    };
    const int a = contact.body_a, b = contact.body_b;
    const Vector3 pull = PullOn(contact);
    double least = approaches_[c] = std::max(0.0, -contact.normal_W.dot(velocity(b) - velocity(a)));
    if (cut_[a] || cut_[b]) {
      const double fall = (cut_[a] ? -1 : 1) * contact.normal_W.dot(pull);
      const double way = ClosingWay(contact) - 2 * settings_.overlap_tolerance * Size(contact);  // what gaps may miss
      least = std::sqrt(least * least + 2 * std::max(0.0, fall) * std::max(0.0, way));
    }
    if (contact.restitution == 0 || least <= std::max(threshold_, SlightApproach(contact, pull, dt_))) return;
    hits_[c] = 1;
    targets_[c] = ReboundSpeed(contact, least);
  });
}

// [N s] what a contact of the problem gets at the end, beside what it carried.
Vector3 Crowd::ChangeAt(size_t c) const {
  return frames_[c] * (local_[c] + blows_[c] + collisions_[c]) - carried_W_[closed_[c]];
}

// Whether a contact of the end carried in the piece.
bool Crowd::Pressed(size_t e) const { return !carried_W_[e].isZero(0); }

// [N s] what held contacts carried, as it lies at the end of the piece. Of what landed in it nothing turned all the way. (Gaps at the start may
// miss twice the tolerance: by the piece before, and by an open one.)
void Crowd::TurnCarried() {
  turned_W_.assign(near_->size(), Vector3::Zero());
  rubbed_W_.assign(near_->size(), Vector3::Zero());
  bore_.assign(near_->size(), 0.0);
  const auto turn = [&](size_t c) {
    if (follows_[c] < 0 || impulse_W_[c].isZero(0)) return;
    const Contact& end = (*near_)[follows_[c]];
    const Vector3 u = RelativeVelocity(end, bodies_[end.body_a], bodies_[end.body_b]);
    const double press = held_[c].normal_W.dot(impulse_W_[c]);
    rubbed_W_[follows_[c]] += impulse_W_[c] - press * held_[c].normal_W;
    bore_[follows_[c]] += press;
    // What answers to something heavy that lands is taken back with it, as it was.
    const bool lands = lands_[end.body_a] > 0 || lands_[end.body_b] > 0;
    const bool was_closed = !lands && GapAtStart(end) <= 2 * settings_.overlap_tolerance * Size(end);
    turned_W_[follows_[c]] +=
        was_closed ? TurnedAlong(held_[c], end, impulse_W_[c], u, LighterMass(held_[c])) : impulse_W_[c];
  };
  pool_->ForEachOf(pairs_.size(), [&](size_t p) {
    for (size_t c = pairs_[p].x; c < pairs_[p].x_end; ++c) turn(c);
  });
}

// What pressed and is not found again falls to the nearest contact of its pair.
void Crowd::Inherit() {
  for (size_t c = 0; c < held_.size(); ++c) {
    if (follows_[c] >= 0 || impulse_W_[c].isZero(0)) continue;
    const auto [first, last] = std::equal_range(near_->begin(), near_->end(), held_[c], EarlierPair);
    const int nearest = FindHeir({first, last}, held_[c].normal_W, PlaceAtEnd(c).point_W);
    if (nearest < 0) continue;
    follows_[c] = static_cast<int>(first - near_->begin()) + nearest;
    carried_W_[follows_[c]] += impulse_W_[c];
  }
}

// A held contact at the end where its arms are those of halfway: what acts there takes it back and leaves no spin.
Contact Crowd::WhereTaken(size_t c) const {
  Contact contact = held_[c];
  const auto moved = [&](int i) -> Vector3 { return bodies_[i].position_W - middle_[i].position_W; };
  contact.point_W = acted_at_[c] + Shared(contact, moved(contact.body_a), moved(contact.body_b));
  contact.surface_W = held_of_[c].belt_W;
  return contact;
}

// Velocities at the end pose: contacts that are closed hold what does not come as a blow; then blows.
void Crowd::Settle(StepReport* report) {
  const std::vector<Contact>& end = *near_;
  problem_.clear();
  closed_.clear();
  for (size_t e = 0; e < end.size(); ++e) {
    if (cut_[end[e].body_a] && cut_[end[e].body_b]) continue;
    const Contact& contact = end[e];
    const double size = Size(contact), tolerance = settings_.overlap_tolerance * size;
    const bool pressed = Pressed(e);
    if (!pressed && contact.gap > tolerance) continue;
    // Near, and not pressed, is closed only where the pair was near all the time, or what passes by would be caught.
    if (!pressed && contact.gap > kSamePoint * size && (IsRound(contact) || GapAtStart(contact) > tolerance)) continue;
    problem_.push_back(contact);
    closed_.push_back(static_cast<int>(e));
  }
  Part(problem_);
  std::copy(bodies_.begin(), bodies_.end(), posed_.begin());
  FindHits();
  TurnCarried();
  // What these carried is to be taken back, as far as their law allows it, and all of what a blow replaces.
  beyond_W_.resize(problem_.size());
  local_.resize(problem_.size());
  for (size_t c = 0; c < problem_.size(); ++c) {
    const Contact& contact = problem_[c];
    Vector3& carried = carried_W_[closed_[c]];
    const Vector3 allowed = hits_[c] ? carried : WithinCone(contact, turned_W_[closed_[c]]);
    beyond_W_[c] = carried - allowed;
    carried = allowed;
    local_[c] = frames_[c].transpose() * carried;
  }
  problem_at_.assign(near_->size(), -1);
  for (size_t c = 0; c < problem_.size(); ++c) problem_at_[closed_[c]] = static_cast<int>(c);
  given_back_.assign(held_.size(), 0);
  blows_.assign(problem_.size(), Vector3::Zero());
  collisions_.assign(problem_.size(), Vector3::Zero());
  outcomes_.assign(partition_.num_islands(), {});
  struck_.assign(partition_.num_islands(), {});
  bounces_of_.assign(partition_.num_islands(), 0);
  const double start = Seconds();
  ForEachIsland([&](int island, Worker* worker) { SettleIsland(island, worker); });
  const double solved = Seconds(), took = solved - start;
  TellSlice({"solve", start, solved});
  TellObserver();
  double held = 0, struck = 0;
  for (const auto& o : outcomes_) held += o.seconds;
  for (const auto& o : struck_) struck += o.seconds;
  const double share = held + struck > 0 ? held / (held + struck) : 1;
  Report(outcomes_, &report->static_qp, share * took, &report->seconds.static_qp, report);
  Report(struck_, &report->collision_qp, (1 - share) * took, &report->seconds.collision_qp, report);
  for (const int b : bounces_of_) report->bounces += b;
  for (int island = 0; island < partition_.num_islands(); ++island) {
    const double error =
        std::max(outcomes_[island].certificate.natural_map_max, struck_[island].certificate.natural_map_max);
    for (const int i : partition_.bodies_of(island)) errors_[i] = std::max(errors_[i], error);
  }
  for (size_t i = 0; i < bodies_.size(); ++i)
    if (!cut_[i]) SetTwist(TwistOf(posed_[i]), &bodies_[i]);
}

// Velocities without what is taken back.
void Crowd::TakeBack(int island) {
  for (const int i : partition_.bodies_of(island)) SetTwist(TwistOf(bodies_[i]), &posed_[i]);
  for (const int c : partition_.contacts_of(island))
    if (const Vector3& carried = carried_W_[closed_[c]]; !carried.isZero(0))
      ApplyImpulse(problem_[c], -carried, posed_);
}

// All that an island carried is given back where it was taken, and the end alone solved. Returns whether nobody gains by that.
bool Crowd::GiveBack(int island, Worker* worker) {
  const std::span<const int> contacts = partition_.contacts_of(island), bodies = partition_.bodies_of(island);
  for (const int i : bodies) SetTwist(TwistOf(bodies_[i]), &posed_[i]);
  worker->given.clear();
  for (const int c : contacts) {
    worker->given.push_back(carried_W_[closed_[c]]);
    worker->given.push_back(beyond_W_[c]);
    carried_W_[closed_[c]].setZero();
    beyond_W_[c].setZero();
    local_[c].setZero();
    blows_[c].setZero();
    collisions_[c].setZero();
  }
  for (size_t c = 0; c < held_.size(); ++c) {
    if (follows_[c] < 0 || impulse_W_[c].isZero(0)) continue;
    if (!std::binary_search(contacts.begin(), contacts.end(), problem_at_[follows_[c]])) continue;
    worker->taken.push_back(static_cast<int>(c));
    ApplyImpulse(WhereTaken(c), -impulse_W_[c], posed_);
  }
  HoldThenStrike(island, worker);
  if (!MarkGains(island, worker)) {
    for (const int c : worker->taken) given_back_[c] = 1;
    return true;
  }
  for (size_t k = 0; k < contacts.size(); ++k) {
    carried_W_[closed_[contacts[k]]] = worker->given[2 * k];
    beyond_W_[contacts[k]] = worker->given[2 * k + 1];
  }
  worker->taken.clear();
  return false;
}

// [N s] by how much friction of all that acted at a contact in the piece is beyond its cone (Stepper::BeyondCone).
Vector3 Crowd::BeyondCone(int c) const {
  const int e = closed_[c];
  const Contact& contact = problem_[c];
  if (contact.friction == 0 || beyond_W_[c].isZero(0)) return Vector3::Zero();
  const Vector3 change = ChangeAt(c);
  const double press = contact.normal_W.dot(change);
  return Beyond(contact.friction * std::max(0.0, bore_[e] + press), rubbed_W_[e] + change - press * contact.normal_W);
}

// Where any is, all of the island is taken back as it acted, and held again. What blows add lies in their cones.
void Crowd::KeepToCone(int island, Worker* worker) {
  const std::span<const int> contacts = partition_.contacts_of(island);
  const auto is_beyond = [&](int c) {
    return BeyondCone(c).norm() > settings_.tolerance * floor_ * LighterMass(problem_[c]);
  };
  if (std::none_of(contacts.begin(), contacts.end(), is_beyond)) return;
  for (const int c : contacts) carried_W_[closed_[c]] += std::exchange(beyond_W_[c], Vector3::Zero());
  TakeBack(island);
  HoldIsland(island, worker);
}

// What hits is first left out; blows follow in order of their speed, then at once. What hits bodies that gain energy by them is held with
// the rest, and does not rebound; if some gain even so, all that hits in the island. Who gains without any rebound keeps the velocity that
// the carrying impulses left.
void Crowd::SettleIsland(int island, Worker* worker) {
  const std::span<const int> contacts = partition_.contacts_of(island), bodies = partition_.bodies_of(island);
  if (contacts.empty()) return;
  worker->taken.clear();
  TakeBack(island);
  const auto gains = [&](int i) {
    return !cut_[i] && worker->gaining[std::lower_bound(bodies.begin(), bodies.end(), i) - bodies.begin()];
  };
  const auto take_back = [&](int c) {
    local_[c] = frames_[c].transpose() * carried_W_[closed_[c]];
    blows_[c].setZero();
    collisions_[c].setZero();
  };
  for (int attempt = 1;; ++attempt) {
    const bool rebounds = std::any_of(contacts.begin(), contacts.end(), [&](int c) { return targets_[c] > 0; });
    HoldThenStrike(island, worker);
    const bool gain = MarkGains(island, worker), softened = gain && rebounds && Soften(island, worker);
    outcomes_[island].restitution_lowered = attempt > 1 || softened;
    if (!gain || softened) break;
    if (!rebounds) {
      if (GiveBack(island, worker)) break;
      outcomes_[island].status = QpStatus::kInaccurate;  // what it certifies is taken back
      for (size_t k = 0; k < bodies.size(); ++k)
        if (worker->gaining[k]) SetTwist(TwistOf(bodies_[bodies[k]]), &posed_[bodies[k]]);
      for (const int c : contacts)
        if (gains(problem_[c].body_a) || gains(problem_[c].body_b)) take_back(c);
      break;
    }
    for (const int c : contacts) {
      if (attempt == 1 && !gains(problem_[c].body_a) && !gains(problem_[c].body_b)) continue;
      targets_[c] = std::min(targets_[c], 0.0);
      hits_[c] = 0;
    }
    for (const int c : contacts) take_back(c);
    TakeBack(island);
  }
  const bool held_only = struck_[island].status == QpStatus::kNone;
  Record(island, held_only ? Stage::kStatic : Stage::kCollision, held_only ? outcomes_[island] : struck_[island],
         *worker);
}

// [m] by which the two bodies' points at a contact of the end came nearer to each other in the piece.
double Crowd::ClosingWay(const Contact& contact) const {
  const auto way = [&](int i) -> Vector3 {
    const Pose end{bodies_[i].position_W, bodies_[i].rotation_WB};
    return contact.point_W - Outside(i, begin_[i].pose, Inside(i, end, contact.point_W));
  };
  return contact.normal_W.dot(way(contact.body_a) - way(contact.body_b));
}

// [m/s] of an approach in the moment in which the contact closed, from those at the start and at the end of the piece: between them it
// grows with time, as by weight.
double Crowd::SpeedOfMoment(const Contact& contact, double start, double end) const {
  const double speed = std::sqrt(std::max(0.0, start * start + 2 * (end - start) * ClosingWay(contact) / dt_));
  return std::clamp(speed, std::min(start, end), std::max(start, end));
}

// What does not hit. Who asks again adds to the time that it took, and restitution stays lowered.
void Crowd::HoldIsland(int island, Worker* worker) {
  const std::span<const int> contacts = partition_.contacts_of(island), bodies = partition_.bodies_of(island);
  worker->contacts.clear();
  for (const int c : contacts) {
    if (hits_[c])
      local_[c].setZero();
    else
      worker->contacts.push_back(c);
  }
  const double seconds = outcomes_[island].seconds;
  const bool lowered = outcomes_[island].restitution_lowered;
  outcomes_[island] = worker->responder.ResolveTargets({bodies, worker->contacts}, {problem_, frames_}, targets_,
                                                       settings_, floor_, posed_, local_);
  outcomes_[island].seconds += seconds;
  outcomes_[island].restitution_lowered = lowered;
}

// What does not hit is held, with friction in its cones, then blows follow.
void Crowd::HoldThenStrike(int island, Worker* worker) {
  HoldIsland(island, worker);
  KeepToCone(island, worker);
  Strike(island, worker);
}

// Blows in order of their speed, then at once.
void Crowd::Strike(int island, Worker* worker) {
  const std::span<const int> contacts = partition_.contacts_of(island), bodies = partition_.bodies_of(island);
  const ContactFrames all{problem_, frames_};
  worker->held.clear();
  for (const int i : bodies) worker->held.push_back(TwistOf(posed_[i]));
  const double struck = struck_[island].seconds;
  struck_[island] = {};
  struck_[island].seconds = struck;
  if (worker->contacts.size() == contacts.size()) return;
  // Weight has acted for the whole piece, but a blow has the speed of the moment in which it came.
  for (const int c : contacts) {
    Contact& contact = problem_[c];
    contact.restitution = (*near_)[closed_[c]].restitution;
    const double approach = -NormalVelocity(contact, posed_[contact.body_a], posed_[contact.body_b]);
    if (hits_[c] && approach > 0)
      contact.restitution *= std::min(1.0, SpeedOfMoment(contact, approaches_[c], approach) / approach);
  }
  bounces_of_[island] =
      worker->sequential.Resolve(bodies, contacts, all, settings_.bounce_law,
                                 {threshold_, settings_.bounce_limit, true, {}, {}, INFINITY, kTie}, posed_, blows_);
  struck_[island] =
      worker->responder.ResolveCollisions({bodies, contacts}, all, settings_, floor_, threshold_, posed_, collisions_);
  struck_[island].seconds += struck;
}

}  // namespace islet::motion
