#include "engine/contact_suite.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <stdexcept>
#include <string>

#include <Eigen/Cholesky>

#include "engine/body_definition.h"
#include "engine/contact_pairs.h"
#include "engine/rotation.h"
#include "engine/suite/contact_suite_impl.h"
#include "engine/suite/suite_input.h"
#include "qp/smallness.h"

namespace islet {
namespace {

bool SameContact(const Contact& x, const Contact& y) { return SamePair(x, y) && x.feature == y.feature; }

}  // namespace

ContactSuite::ContactSuite(const Settings& settings, parallel::WorkerPool* pool) : impl_(std::make_unique<Impl>()) {
  settings.Validate();
  if (!pool) throw std::invalid_argument("pool is null");
  impl_->settings = settings;
  impl_->pool = pool;
  impl_->workers.resize(pool->num_workers());
}
ContactSuite::~ContactSuite() = default;

void ContactSuite::SetGravity(const Vector3& gravity_W) {
  RequireFinite("suite", "gravity", gravity_W);
  impl_->settings.gravity = gravity_W;
}
void ContactSuite::SetProblemObserver(ProblemObserver observer) { impl_->observer = std::move(observer); }
const SuiteMemory& ContactSuite::memory() const { return *impl_; }
std::shared_ptr<const SuiteMemory> ContactSuite::CopyMemory() const { return std::make_shared<SuiteMemory>(*impl_); }
void ContactSuite::SetMemory(const SuiteMemory& memory) { static_cast<SuiteMemory&>(*impl_) = memory; }
std::span<const Vector3> ContactSuite::impulses() const { return impl_->impulses_W; }
std::span<const Twist> ContactSuite::velocities_before_gravity() const { return impl_->frame.before_gravity; }

void ContactSuite::Resolve(double dt, std::span<Body> bodies, std::span<const Contact> contacts, StepReport* report) {
  RequireStep(dt);
  if (!report) throw std::invalid_argument("report is null");
  CheckSuiteBodies(bodies);
  CheckSuiteContacts(contacts, bodies);
  std::vector<IslandReport> islands = std::move(report->islands);  // keeps its memory
  islands.clear();
  *report = {};
  report->islands = std::move(islands);
  LapTimer timer;
  Impl& s = *impl_;
  s.Begin(dt, bodies, contacts);
  timer.Lap(&report->seconds.islands);
  if (AllStandStill(bodies)) {
    s.StandStill();
  } else {
    s.Bounce(report);  // step 1
    s.WakeByBounce();
    timer.Lap(&report->seconds.pq);
    s.ResolveIslands(report, &timer);  // steps 2 and 3
  }
  s.Freeze(report);  // step 4
  s.Finish(report);
  timer.Lap(&report->seconds.freeze);
}

double ContactSuite::Project(std::span<const Body> bodies, std::span<const Contact> contacts) {
  CheckSuiteBodies(bodies);
  CheckSuiteContacts(contacts, bodies);
  return impl_->projection.Project(bodies, contacts, impl_->settings, impl_->pool);
}
std::span<const Twist> ContactSuite::displacements() const { return impl_->projection.displacements(); }

void ContactSuite::Move(std::span<Body> bodies) const {
  const SuiteFrame& frame = impl_->frame;
  if (bodies.size() != frame.before_gravity.size())
    throw std::invalid_argument("Move: there are " + std::to_string(bodies.size()) + " bodies, and were " +
                                std::to_string(frame.before_gravity.size()) + " when Resolve was called");
  for (size_t i = 0; i < bodies.size(); ++i) {
    Body& body = bodies[i];
    if (!body.Moves()) continue;
    const Twist& before = frame.before_gravity[i];
    const Vector3 spin_W = 0.5 * (before.angular_W + body.angular_velocity_W);
    const Vector3 turn_W = FreeRotation(body.inertia_B, body.rotation_WB, spin_W, frame.dt);
    const Quaternion end_WB = (Exp(turn_W) * body.rotation_WB).normalized();
    body.angular_velocity_W = AngularVelocityAfter(body.inertia_B, body.rotation_WB, body.angular_velocity_W, end_WB);
    body.position_W += 0.5 * frame.dt * (before.linear_W + body.linear_velocity_W);
    body.rotation_WB = end_WB;
  }
}

// What steps 1 to 3 leave where nothing moves.
void ContactSuite::Impl::StandStill() {
  errors.assign(frame.bodies.size(), 0.0);
  frame.before_gravity.assign(frame.bodies.size(), {});
}

void ContactSuite::Impl::Begin(double dt, std::span<Body> bodies, std::span<const Contact> contacts) {
  frame.dt = dt;
  frame.gravity = settings.gravity;
  frame.rest_speed = settings.gravity.norm() * dt;
  frame.bodies = bodies;
  frame.frames.resize(contacts.size());
  pool->ForEachOf(contacts.size(), [&](size_t c) { frame.frames[c] = ContactFrame(contacts[c].normal_W); });
  approach_speeds.resize(contacts.size());
  pool->ForEachOf(contacts.size(), [&](size_t c) {
    const Contact& contact = contacts[c];
    approach_speeds[c] = contact.touches ? -NormalVelocity(contact, bodies[contact.body_a], bodies[contact.body_b]) : 0;
  });
  double fastest = FastestPoint(bodies, [](size_t) { return false; });
  for (const double approach : approach_speeds) fastest = std::max(fastest, approach);
  frame.speed_floor = std::max({frame.rest_speed, 1e-3 * fastest, 1e-12});
  frame.threshold = 10 * settings.tolerance * frame.speed_floor;
  FindMeetings(contacts);
  for (auto* impulses : {&frame.bounces, &frame.collisions, &frame.holding})
    impulses->assign(contacts.size(), Vector3::Zero());
  freeze_counters.resize(bodies.size(), 0);
  was_frozen.resize(bodies.size());
  for (size_t i = 0; i < bodies.size(); ++i) was_frozen[i] = bodies[i].frozen;
  WakeDisturbed();
  RecallHolding();
  if (settings.freezing == Freezing::kCertified) certified.BeginFrame(frame, settings, &still);
}

// What bounces at full speed, and would close its gap within the step, has its blow now: a part of a step too early, and not as deep
// inside each other as a step goes.
void ContactSuite::Impl::FindMeetings(std::span<const Contact> contacts) {
  meeting.clear();
  for (size_t c = 0; c < contacts.size(); ++c) {
    const Contact& contact = contacts[c];
    if (contact.touches || contact.restitution == 0) continue;
    const double approach = -NormalVelocity(contact, frame.bodies[contact.body_a], frame.bodies[contact.body_b]);
    if (approach * frame.dt <= contact.gap || approach <= frame.threshold ||
        !OutlastsStep(contact, approach, frame.rest_speed))
      continue;
    if (meeting.empty()) meeting.assign(contacts.begin(), contacts.end());
    meeting[c].touches = true;
  }
  frame.contacts = {meeting.empty() ? contacts : std::span<const Contact>(meeting), frame.frames};
}

// Who was frozen and has been given a velocity, or stands on a belt that runs otherwise than it did, is awake.
void ContactSuite::Impl::WakeDisturbed() {
  for (Body& body : frame.bodies)
    if (!body.linear_velocity_W.isZero(0) || !body.angular_velocity_W.isZero(0)) body.frozen = false;
  size_t p = 0;
  for (const Contact& contact : frame.contacts.contacts) {
    while (p < previous_contacts.size() && Earlier(previous_contacts[p], contact)) ++p;
    if (p == previous_contacts.size() || !SameContact(previous_contacts[p], contact) ||
        previous_contacts[p].surface_W == contact.surface_W)
      continue;
    frame.bodies[contact.body_a].frozen = frame.bodies[contact.body_b].frozen = false;
  }
}

// Contacts keep the impulses that held in the frame before, per second: where nothing moves as they are, elsewhere as what
// the static problem starts from. There the load of a contact that is no more, since its bodies now touch with other corners or
// edges, passes to the nearest one of the same two bodies.
void ContactSuite::Impl::RecallHolding() {
  if (previous_dt == 0) return;
  const std::span<const Contact> now = frame.contacts.contacts;
  ForEachPair(previous_contacts, now, [&](size_t p, size_t p_end, size_t c, size_t c_end) {
    if (p == p_end || c == c_end) return;
    const Body &a = frame.bodies[now[c].body_a], &b = frame.bodies[now[c].body_b];
    const bool moves = a.Moves() || b.Moves();
    if (moves || (StandsStill(a) && StandsStill(b))) RecallPair({p, p_end}, {c, c_end}, moves);
  });
}

// previous, now: first contact of two bodies and one past the last; neither is empty.
void ContactSuite::Impl::RecallPair(std::pair<size_t, size_t> previous, std::pair<size_t, size_t> now, bool moves) {
  const std::span<const Contact> contacts = frame.contacts.contacts.subspan(now.first, now.second - now.first);
  const double share = frame.dt / previous_dt;
  size_t place = 0;
  for (size_t p = previous.first; p < previous.second; ++p) {
    const Contact& old = previous_contacts[p];
    while (place < contacts.size() && Earlier(contacts[place], old)) ++place;
    if (place < contacts.size() && SameContact(contacts[place], old)) {
      frame.holding[now.first + place] += share * previous_holding[p];
      ++place;  // others may have the same number
    } else if (moves && !previous_holding[p].isZero(0)) {
      const auto nearer = [&](const Contact& x, const Contact& y) {
        return (x.point_W - old.point_W).squaredNorm() < (y.point_W - old.point_W).squaredNorm();
      };
      const size_t heir = now.first + (std::min_element(contacts.begin(), contacts.end(), nearer) - contacts.begin());
      const Vector3 impulse_W = ContactFrame(old.normal_W) * previous_holding[p];
      frame.holding[heir] += share * (frame.frames[heir].transpose() * impulse_W);
    }
  }
}

// The trapezoidal rule lets a contact do the work j . (u0 + u1) / 2. Where a body bounced off and gravity brought it back
// within the step that would be positive: the body would rise on energy it does not have. Along such a normal bodies move with
// their final velocity alone, and so do those that close a gap by this step's end: their final velocity is what was chosen for that.
// What the interior point leaves at a contact that does not press holds nobody.
void ContactSuite::Impl::SettleCaughtBodies() {
  const std::span<const Contact> contacts = frame.contacts.contacts;
  catches.resize(contacts.size());
  pool->ForEachOf(contacts.size(), [&](size_t c) { catches[c] = Catches(c); });
  settles.assign(contacts.size(), 0);
  held_along.resize(frame.bodies.size());
  for (Held& along : held_along) along.rank = 0;
  for (size_t c = 0; c < contacts.size(); ++c)
    if (catches[c]) Settle(c);
  SettleRiders();
}

bool ContactSuite::Impl::Catches(size_t c) const {
  const Contact& contact = frame.contacts.contacts[c];
  const auto velocity = [&](int i) -> Vector3 {
    const Twist& twist = frame.bodies[i].Moves() ? frame.before_gravity[i] : TwistOf(frame.bodies[i]);
    return twist.linear_W + twist.angular_W.cross(contact.point_W - frame.bodies[i].position_W);
  };
  const auto pushes = [&](int i) {
    return frame.bodies[i].Moves() && frame.holding[c][0] > kNegligible * frame.bodies[i].mass * frame.rest_speed;
  };
  if (!(pushes(contact.body_a) || pushes(contact.body_b))) return false;
  return !contact.touches ||
         std::abs(contact.normal_W.dot(velocity(contact.body_b) - velocity(contact.body_a))) > frame.threshold;
}

void ContactSuite::Impl::Settle(size_t c) {
  const Contact& contact = frame.contacts.contacts[c];
  settles[c] = 1;
  for (const int i : {contact.body_a, contact.body_b}) {
    if (frame.bodies[i].Moves())
      HoldAlong(contact, i);
    else
      frame.before_gravity[i] = TwistOf(frame.bodies[i]);
  }
}

// Gives the velocity before gravity that part of the final one which moves the point along the normal: the nearest by kinetic energy
// that does.
void ContactSuite::Impl::HoldAlong(const Contact& contact, int number) {
  using Vector6 = Eigen::Matrix<double, 6, 1>;
  const Body& body = frame.bodies[number];
  Held& along = held_along[number];
  const double root = std::sqrt(body.mass);
  const Matrix3 inertia = body.InertiaW();
  const Eigen::LLT<Matrix3> factor(inertia);
  Vector6 direction;
  direction << contact.normal_W / root,
      factor.matrixL().solve((contact.point_W - body.position_W).cross(contact.normal_W));
  const double length = direction.norm();
  for (int twice = 0; twice < 2; ++twice)
    for (int k = 0; k < along.rank; ++k) direction -= along.directions.col(k).dot(direction) * along.directions.col(k);
  if (along.rank == 6 || direction.norm() <= kNegligible * length) return;
  direction.normalize();
  along.directions.col(along.rank++) = direction;
  Twist& before = frame.before_gravity[number];
  Vector6 change;
  change << root * (body.linear_velocity_W - before.linear_W),
      factor.matrixL().transpose() * (body.angular_velocity_W - before.angular_W);
  const Vector6 part = direction.dot(change) * direction;
  before.linear_W += part.head<3>() / root;
  before.angular_W += factor.matrixU().solve(part.tail<3>());
}

// What bounced with a body that was caught, and presses on it, comes along, or it would rise from it. There and back again, since
// towers are numbered upwards or downwards.
void ContactSuite::Impl::SettleRiders() {
  const std::span<const Contact> contacts = frame.contacts.contacts;
  const auto rides = [&](int rider, int on) { return held_along[on].rank > 0 && frame.bodies[rider].Moves(); };
  bool more = true;
  const auto visit = [&](size_t c) {
    const Contact& contact = contacts[c];
    if (settles[c] || !(rides(contact.body_a, contact.body_b) || rides(contact.body_b, contact.body_a)) || !Catches(c))
      return;
    Settle(c);
    more = true;
  };
  while (more) {
    more = false;
    for (size_t c = 0; c < contacts.size(); ++c) visit(c);
    for (size_t c = contacts.size(); more && c-- > 0;) visit(c);
  }
}

void ContactSuite::Impl::Finish(StepReport* report) {
  SettleCaughtBodies();
  const size_t nc = frame.contacts.contacts.size();
  for (const Contact& c : frame.contacts.contacts) report->contacts += c.touches;
  impulses_W.resize(nc);
  pool->ForEachOf(nc, [&](size_t c) {
    impulses_W[c] = frame.frames[c] * (frame.bounces[c] + frame.collisions[c] + frame.holding[c]);
  });
  previous_contacts.assign(frame.contacts.contacts.begin(), frame.contacts.contacts.end());
  previous_holding = frame.holding;
  previous_dt = frame.dt;
  energies.resize(frame.bodies.size());
  pool->ForEachOf(frame.bodies.size(), [&](size_t i) { energies[i] = frame.bodies[i].KineticEnergy(); });
  for (size_t i = 0; i < frame.bodies.size(); ++i) {
    const Body& body = frame.bodies[i];
    if (body.kind != BodyKind::kDynamic || body.removed) continue;
    (body.frozen ? report->frozen : report->awake) += 1;
    report->kinetic_energy += energies[i];
  }
  if (settings.freezing == Freezing::kCertified && report->frozen > 0)
    report->frozen_imbalance = certified.worst_imbalance();
}

}  // namespace islet
