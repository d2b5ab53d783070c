#include "engine/certified_freezing.h"

#include <algorithm>

#include "islands/disjoint_sets.h"

namespace islet {
namespace {

// Imbalance that counts as none, relative to the impulses that act on the body. Stored impulses do not change by themselves:
// what they lack is what gravity, force or friction has changed by. Those of a pile that moves next to a frozen one vary by
// solver tolerance, and by more than that while it settles; so do those of a neighbour that was balanced anew.
constexpr double kStoredTolerance = 1e-5;
constexpr double kMovingTolerance = 1e-3;
// A body freezes only if the static solution leaves it slower than this share of |g| dt.
// One that was frozen when the frame began may have trembled more: what moves beside it is solved to coarser tolerances.
constexpr double kRestShare = 1e-4;
// An acceleration is steady if it adds more than this share of |g| dt in two frames running: above rounding, below what a
// ball has that stands 1e-8 rad off the top of another.
constexpr double kSteadyShare = 1e-9;
// A turn on the spot: contacts that carry more than this share of the body's weight in a step, and its centre, move by no more than
// this share of its fastest point's speed; and this share of the turn, at least, is about the normal of one of those contacts.
constexpr double kLoaded = 1e-6, kSpot = 1e-3, kTorsion = 0.5;
// Of g dt: a kinematic body that moves faster carries what touches it; up to the other one so slowly that what it carries would
// pass for resting.
constexpr double kMoverShare = 1e-8;
constexpr double kCreepShare = 1e-2;
// Impulses at a body's contacts that change by no more than this share from one frame to the next are steady.
constexpr double kCalmShare = 1e-2;
// A body beside others that move is patient: it waits so many times freeze_seconds, unless it was frozen when the frame began.
// What stops there for a moment goes on when they do; a wall for a few frames, it would only turn them another way. Not in the
// convex models: what slides is launched there, and a pile trembles for ever.
constexpr double kPatience = 10;
// An unsteady frame takes back as many steady ones, and a long rest counts as so many times freeze_seconds: a passing blow
// does not keep a pile awake that has rested.
constexpr double kUnrest = 3;
constexpr double kTrust = 15;
// No more than one in so many bodies is few: a cube that turns about two of its corners for ever keeps no pile awake.
constexpr int kFewRestless = 50;

// [m^2/s^2] inner product in which a twist's square is about that of the fastest point's speed.
double Dot(const Twist& p, const Twist& q, double radius) {
  return p.linear_W.dot(q.linear_W) + radius * radius * p.angular_W.dot(q.angular_W);
}

}  // namespace

CertifiedFreezing::Wrench CertifiedFreezing::PullOn(const Body& body, const Settings& settings) {
  return {body.mass * settings.gravity + body.force_W, body.torque_W};
}

double CertifiedFreezing::Size(const Wrench& wrench, double radius) {
  return wrench.force.norm() + wrench.torque.norm() / radius;
}

void CertifiedFreezing::TrackTravel(std::span<const Body> bodies, double dt, const Settings& settings) {
  for (size_t i = reference_position_.size(); i < bodies.size(); ++i) {
    reference_position_.push_back(bodies[i].position_W);
    reference_rotation_.push_back(bodies[i].rotation_WB);
    still_seconds_.push_back(0);
    undisturbed_seconds_.push_back(0);
    last_twist_.push_back(TwistOf(bodies[i]));
    last_pull_.push_back(PullOn(bodies[i], settings));
    last_gain_.emplace_back();
    steady_.push_back(0);
    calm_seconds_.push_back(0);
    on_mover_.push_back(0);
    withheld_.emplace_back();
    withheld_now_.emplace_back();
  }
  for (size_t i = 0; i < bodies.size(); ++i) {
    const Body& body = bodies[i];
    if (!body.Moves()) continue;
    const double turned =
        2 * (body.rotation_WB.coeffs() - reference_rotation_[i].coeffs()).norm();  // chord: angle for small ones
    const double turned_other_sign = 2 * (body.rotation_WB.coeffs() + reference_rotation_[i].coeffs()).norm();
    const double travel =
        (body.position_W - reference_position_[i]).norm() + body.radius * std::min(turned, turned_other_sign);
    const Wrench pull = PullOn(body, settings);
    const Wrench change{pull.force - last_pull_[i].force, pull.torque - last_pull_[i].torque};
    const bool alike = Size(change, body.radius) <= kCalmShare * Size(pull, body.radius);
    last_pull_[i] = pull;
    if (alike && travel <= settings.freeze_travel * body.radius) {
      still_seconds_[i] += dt;
      undisturbed_seconds_[i] += dt;
    } else {
      if (still_seconds_[i] < settings.freeze_seconds && travel > settings.freeze_travel * body.radius)
        withheld_[i] = {};
      reference_position_[i] = body.position_W;
      reference_rotation_[i] = body.rotation_WB;
      still_seconds_[i] = undisturbed_seconds_[i] = 0;
    }
  }
}

void CertifiedFreezing::BeginFrame(const SuiteFrame& frame) {
  const std::span<Body> bodies = frame.bodies;
  roots_.resize(bodies.size());
  islands::DisjointSets joined(roots_);
  on_mover_.assign(bodies.size(), 0);
  touched_.assign(bodies.size(), 0);  // sets of bodies that touch what creeps
  const auto carries = [&](int wall, int body, const Contact& contact) {
    const Body& mover = bodies[wall];
    if (mover.kind != BodyKind::kKinematic || StandsStill(mover)) return;
    const Vector3 arm = contact.point_W - mover.position_W;
    const double speed = (mover.linear_velocity_W + mover.angular_velocity_W.cross(arm)).norm();
    if (speed <= kMoverShare * frame.rest_speed) return;
    // What creeps at one contact and goes faster at another carries all the same, whichever contact comes last.
    const std::uint8_t carried = speed <= kCreepShare * frame.rest_speed ? 2 : 1;
    on_mover_[body] = std::max(on_mover_[body], carried);
  };
  for (const Contact& contact : frame.contacts.contacts) {
    if (!contact.touches) continue;
    const bool dynamic =
        bodies[contact.body_a].kind == BodyKind::kDynamic && bodies[contact.body_b].kind == BodyKind::kDynamic;
    if (dynamic) joined.Union(contact.body_a, contact.body_b);
    carries(contact.body_a, contact.body_b, contact);
    carries(contact.body_b, contact.body_a, contact);
  }
  for (size_t i = 0; i < bodies.size(); ++i)
    if (on_mover_[i] == 2) touched_[joined.Find(static_cast<int>(i))] = 1;
  for (size_t i = 0; i < bodies.size(); ++i)
    if (touched_[joined.Find(static_cast<int>(i))]) on_mover_[i] = 1;
  for (size_t i = 0; i < bodies.size(); ++i) {
    if (bodies[i].frozen) {
      withheld_[i].linear_W += withheld_now_[i].linear_W;
      withheld_[i].angular_W += withheld_now_[i].angular_W;
    }
    withheld_now_[i] = {};
    if (on_mover_[i]) bodies[i].frozen = false;
  }
}

// What is below rounding does not count: 1e-9 g dt are 5 mm in a year.
bool CertifiedFreezing::StaysBehind(const SuiteFrame& frame, int number, bool at_end, const Settings& settings) {
  const Body& body = frame.bodies[number];
  const Twist twist = TwistOf(body), &before = withheld_[number];
  Twist& now = withheld_now_[number];
  const double step = frame.dt * FastestPoint(twist, body.radius);
  if (!at_end || step > FastestPoint(now, body.radius)) now = {frame.dt * twist.linear_W, frame.dt * twist.angular_W};
  const Twist sum{before.linear_W + now.linear_W, before.angular_W + now.angular_W};
  const double way = FastestPoint(sum, body.radius);
  if (on_mover_[number] && step > kMoverShare * frame.rest_speed * frame.dt) return true;
  return step > kSteadyShare * frame.rest_speed * frame.dt && way > settings.freeze_travel * body.radius &&
         way > FastestPoint(before, body.radius);
}

void CertifiedFreezing::AddContact(const SuiteFrame& frame, size_t number) {
  const Contact& contact = frame.contacts.contacts[number];
  const Body& a = frame.bodies[contact.body_a];
  const Body& b = frame.bodies[contact.body_b];
  if (!a.frozen && !b.frozen) return;
  const bool stored = StandsStill(a) && StandsStill(b);
  const Vector3 local = frame.collisions[number] + frame.holding[number];
  const Vector3 impulse = frame.frames[number] * local;
  // Stored impulses can leave the cone: a material callback may have lowered the friction since.
  const double slip = stored ? local.tail<2>().norm() - contact.friction * local[0] : 0;  // [N s] beyond the cone
  const double outside = slip > 0 ? slip / local.norm() : 0;
  const auto add = [&](const Body& body, Load& load, double sign) {
    if (!body.frozen) return;
    const Vector3 turn = sign * (contact.point_W - body.position_W).cross(impulse);
    load.linear += sign * impulse;
    load.angular += turn;
    load.size += impulse.norm();
    load.outside = std::max(load.outside, outside);
    if (stored) return;
    load.moving_linear += sign * impulse;
    load.moving_angular += turn;
    load.moving_size += impulse.norm();
  };
  add(a, loads_[contact.body_a], -1);
  add(b, loads_[contact.body_b], 1);
}

void CertifiedFreezing::SumLoads(const SuiteFrame& frame) {
  loads_.resize(frame.bodies.size());
  for (size_t i = 0; i < frame.bodies.size(); ++i) {
    const Body& body = frame.bodies[i];
    if (!body.frozen) continue;
    Load& load = loads_[i];
    load.linear = body.mass * frame.after_bounces[i].linear_W + frame.dt * (body.mass * frame.gravity + body.force_W);
    load.angular = body.InertiaW() * frame.after_bounces[i].angular_W + frame.dt * body.torque_W;
    load.moving_linear = load.linear;
    load.moving_angular = load.angular;
    load.size = load.linear.norm() + load.angular.norm() / body.radius;
    load.moving_size = 0;
    load.outside = 0;
  }
  for (size_t c = 0; c < frame.contacts.contacts.size(); ++c) AddContact(frame, c);
}

double CertifiedFreezing::Imbalance(const Body& body, const Load& load) {
  const double sum = load.linear.norm() + load.angular.norm() / body.radius;
  return load.size > 0 ? sum / load.size : sum;
}

double CertifiedFreezing::Tolerance(const Load& load) {
  if (!(load.size > 0)) return kStoredTolerance;
  return kStoredTolerance + (kMovingTolerance - kStoredTolerance) * std::min(1.0, load.moving_size / load.size);
}

void CertifiedFreezing::FindUnbalanced(const SuiteFrame& frame, std::span<const std::uint8_t> lenient,
                                       std::vector<int>* unbalanced) {
  SumLoads(frame);
  unbalanced->clear();
  for (size_t i = 0; i < frame.bodies.size(); ++i) {
    if (!frame.bodies[i].frozen) continue;
    const double tolerance = lenient[i] ? kMovingTolerance : Tolerance(loads_[i]);
    if (std::max(loads_[i].outside, Imbalance(frame.bodies[i], loads_[i])) > tolerance)
      unbalanced->push_back(static_cast<int>(i));
  }
}

double CertifiedFreezing::WorstImbalance(const SuiteFrame& frame) const {
  double worst = 0;
  for (size_t i = 0; i < frame.bodies.size(); ++i)
    if (frame.bodies[i].frozen) worst = std::max(worst, Imbalance(frame.bodies[i], loads_[i]));
  return worst;
}

Twist CertifiedFreezing::LoadedVelocity(const SuiteFrame& frame, int number) const {
  const Body& body = frame.bodies[number];
  return {loads_[number].moving_linear / body.mass, body.InverseInertiaW() * loads_[number].moving_angular};
}

double CertifiedFreezing::StillSpeed(const Body& body, const Settings& settings) const {
  return settings.freeze_travel * body.radius / settings.freeze_seconds;
}

double CertifiedFreezing::WakeSpeed(const SuiteFrame& frame, int number, bool lenient, const Settings& settings) const {
  const Body& body = frame.bodies[number];
  return (lenient ? kMovingTolerance : Tolerance(loads_[number])) *
         std::max(frame.rest_speed, StillSpeed(body, settings));
}

// Two gains of velocity in a row that point the same way are an acceleration; what solver tolerance leaves points anywhere.
void CertifiedFreezing::TrackGain(const SuiteFrame& frame) {
  for (size_t i = 0; i < frame.bodies.size(); ++i) {
    const Body& body = frame.bodies[i];
    const Twist twist = TwistOf(body);
    const Twist gain{twist.linear_W - last_twist_[i].linear_W, twist.angular_W - last_twist_[i].angular_W};
    const double floor = kSteadyShare * frame.rest_speed;
    steady_[i] = Dot(gain, last_gain_[i], body.radius) > floor * floor;
    last_twist_[i] = twist;
    last_gain_[i] = gain;
  }
}

// Points brake no turn about their normal. A cube that hangs between two corners, its centre on the line through them, turns about
// that line by forces that are rounding, and kept the hourglass awake for ever: what is balanced but for such a turn does not
// accelerate. What rolls or tips moves its centre.
void CertifiedFreezing::ForgiveSpins(const SuiteFrame& frame) {
  if (std::find(steady_.begin(), steady_.end(), 1) == steady_.end()) return;
  on_spot_.assign(frame.bodies.size(), 1);
  twists_.assign(frame.bodies.size(), 0);
  for (size_t c = 0; c < frame.contacts.contacts.size(); ++c) {
    const Contact& contact = frame.contacts.contacts[c];
    for (const int i : {contact.body_a, contact.body_b}) {
      const Body& body = frame.bodies[i];
      if (!steady_[i] || frame.holding[c][0] <= kLoaded * body.mass * frame.rest_speed) continue;
      const Vector3& turn = last_gain_[i].angular_W;
      on_spot_[i] &= body.VelocityAt(contact.point_W).norm() <= kSpot * FastestPoint(TwistOf(body), body.radius);
      twists_[i] |= std::abs(turn.dot(contact.normal_W)) >= kTorsion * turn.norm();
    }
  }
  const auto centred = [](const Twist& twist, double radius) {
    return twist.linear_W.norm() <= kSpot * FastestPoint(twist, radius);
  };
  for (size_t i = 0; i < frame.bodies.size(); ++i) {
    if (!steady_[i] || !on_spot_[i] || !twists_[i]) continue;
    const Body& body = frame.bodies[i];
    const double torque = (body.InertiaW() * last_gain_[i].angular_W).norm() / body.radius;  // [N s]
    if (centred(TwistOf(body), body.radius) && centred(last_gain_[i], body.radius) &&
        torque <= kStoredTolerance * pressed_[i])
      steady_[i] = 0;
  }
}

// A pile that still trembles hands its bodies other loads in every frame. What freezes in there is a wall for one frame, wakes
// in the next, and disturbs the others on both occasions: cubeglass came to rest after 335 frames, and after 245 without
// freezing.
void CertifiedFreezing::TrackLoads(const SuiteFrame& frame, const Settings& settings) {
  change_.assign(frame.bodies.size(), 0.0);
  pressed_.assign(frame.bodies.size(), 0.0);
  for (size_t c = 0; c < frame.contacts.contacts.size(); ++c) {
    const double change =
        frame.bounces[c].norm() + frame.collisions[c].norm() + (frame.holding[c] - frame.held_before[c]).norm();
    for (const int i : {frame.contacts.contacts[c].body_a, frame.contacts.contacts[c].body_b}) {
      change_[i] += change;
      pressed_[i] += frame.holding[c].norm();
    }
  }
  for (size_t i = 0; i < frame.bodies.size(); ++i) {
    const bool steady = change_[i] <= kCalmShare * pressed_[i];
    calm_seconds_[i] =
        std::clamp(calm_seconds_[i] + (steady ? frame.dt : -kUnrest * frame.dt), 0.0, kTrust * settings.freeze_seconds);
  }
}

// Bodies joined by contacts in which all rest: nothing in there moves that could hand one of them another load. What a few among
// many hand on is not waited for either, once the others have rested for long.
void CertifiedFreezing::FindRestingIslands(const SuiteFrame& frame, const Settings& settings) {
  const size_t n = frame.bodies.size();
  touched_.assign(n, 0);
  roots_.resize(n);
  islands::DisjointSets islands(roots_);
  for (size_t c = 0; c < frame.contacts.contacts.size(); ++c) {
    const int a = frame.contacts.contacts[c].body_a, b = frame.contacts.contacts[c].body_b;
    if (frame.bodies[a].Moves() && frame.bodies[b].Moves()) islands.Union(a, b);
    if (frame.holding[c][0] > 0) touched_[a] = touched_[b] = 1;
  }
  const auto rests = [&](size_t i) {
    return touched_[i] && !steady_[i] && still_seconds_[i] >= settings.freeze_seconds &&
           FastestPoint(TwistOf(frame.bodies[i]), frame.bodies[i].radius) <= kRestShare * frame.rest_speed;
  };
  restless_.assign(n, 0);
  members_.assign(n, 0);
  for (size_t i = 0; i < n; ++i) {
    if (!frame.bodies[i].Moves()) continue;
    const int root = islands.Find(static_cast<int>(i));
    ++members_[root];
    restless_[root] += !rests(i);
  }
  for (const Contact& contact : frame.contacts.contacts) {
    const auto moved_wall = [&](int i) { return !frame.bodies[i].Moves() && !StandsStill(frame.bodies[i]); };
    if (moved_wall(contact.body_a)) restless_[islands.Find(contact.body_b)] = members_[islands.Find(contact.body_b)];
    if (moved_wall(contact.body_b)) restless_[islands.Find(contact.body_a)] = members_[islands.Find(contact.body_a)];
  }
  // From the back: the count of a root is overwritten last.
  for (size_t i = n; i-- > 0;) {
    const int root = islands.Find(static_cast<int>(i));
    const bool few = restless_[root] > 0 && restless_[root] * kFewRestless <= members_[root];
    restless_[i] = few ? !rests(i) || still_seconds_[i] < kPatience * settings.freeze_seconds : restless_[root];
  }
}

bool CertifiedFreezing::Freeze(const SuiteFrame& frame, const std::vector<std::uint8_t>& was_frozen,
                               const Settings& settings) {
  TrackGain(frame);
  TrackLoads(frame, settings);
  ForgiveSpins(frame);
  FindRestingIslands(frame, settings);
  bool any = false;
  for (size_t i = 0; i < frame.bodies.size(); ++i) {
    Body& body = frame.bodies[i];
    const double calm = std::min(undisturbed_seconds_[i], calm_seconds_[i]);
    const bool patient = settings.model == Model::kCoulomb && !was_frozen[i];
    const double wait = (patient ? kPatience : 1) * settings.freeze_seconds;
    if (!body.Moves() || !touched_[i] || steady_[i] || (restless_[i] && calm < wait)) continue;
    const double share = was_frozen[i] ? kMovingTolerance : kRestShare;
    const double limit = share * std::max(frame.rest_speed, 1e-3 * StillSpeed(body, settings));
    body.frozen = FastestPoint(TwistOf(body), body.radius) <= limit &&
                  !StaysBehind(frame, static_cast<int>(i), /*at_end=*/false, settings);
    any = any || body.frozen;
  }
  return any;
}

void CertifiedFreezing::Release(const SuiteFrame& frame, int number) {
  Body& body = frame.bodies[number];
  body.frozen = false;
  SetTwist(last_twist_[number], &body);
  Disturb(number);
}

}  // namespace islet
