#include "engine/world.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <tuple>
#include <utility>

#include "engine/body_definition.h"
#include "engine/contact_suite.h"
#include "engine/detection.h"
#include "engine/motion.h"
#include "engine/passing.h"
#include "engine/rebound.h"
#include "engine/state_hash.h"
#include "engine/stopwatch.h"
#include "engine/suite_frame.h"
#include "engine/suite_memory.h"
#include "parallel/worker_pool.h"

namespace islet {
namespace {

constexpr double kMeets = 1e-2;  // of the overlap tolerance: contacts that are open by less have met

}  // namespace

// All that one step leaves for the next, but for what the suite remembers.
struct WorldState {
  std::vector<Body> bodies;
  std::vector<Shape> shapes;
  std::vector<double> tolerances;      // [m] per body: overlap allowed by the motion
  std::vector<Contact> near_contacts;  // at the current poses, up to the reach of the last detection
  std::vector<Contact> touching;       // of these, those that touch
  std::vector<Contact> resolved;       // touching ones at the start of the last step, whose impulses the suite holds
  std::vector<Vector3> travel;         // [m] that the last detection expected of each body
  std::vector<double> margins;         // [m] and how far it may stray from that
  std::vector<double> unflown;     // [s] per body: what its last flight, cut short by an impact, left to the next one
  std::vector<std::uint8_t> flew;  // per body: no contact pushed it in the last step, and it met nothing
  bool stale = true;               // near_contacts do not belong to the current poses
  size_t checked_bodies = 0;       // those before it were checked for initial overlap
  double time = 0;                 // [s]
  double dt_hint = 1.0 / 30;       // [s] of the last step
};

struct WorldSnapshot::Data {
  WorldState world;
  SuiteMemory suite;
  Vector3 gravity;
};

struct World::Impl : WorldState {
  Settings settings;
  std::unique_ptr<parallel::WorkerPool> own_pool;
  parallel::WorkerPool* pool;
  ContactSuite suite;
  Detector detector;
  Mover mover;
  MaterialCallback material;
  std::vector<Contact> detected, still;  // scratch
  std::vector<std::uint8_t> in_flight;   // per body: flew, and nothing stops it yet
  std::vector<double> durations;         // [s] per body: of its motion in this step
  std::vector<std::uint8_t> flies;       // per body: no contact pushes it in this step
  struct Load {
    int body;
    Vector3 force_W, torque_W;
  };
  std::vector<Load> loaded;    // what the user wants of bodies whose forces stand in for a longer step
  std::vector<Twist> before;   // per body: velocities that its motion begins with
  std::vector<double> depths;  // [m] per body: how deep it overlaps anything

  Impl(const Settings& s, parallel::WorkerPool* p)
      : settings(s),
        own_pool(p ? nullptr : std::make_unique<parallel::WorkerPool>(s.threads)),
        pool(p ? p : own_pool.get()),
        suite(s, pool),
        detector(pool),
        mover(s, pool) {}

  Body& At(int number);
  void DetectAll();
  void DetectMoving(std::span<const Vector3> expected);
  void ChooseMargins(std::span<const Vector3> expected);
  bool StaysInReach(std::span<const Vector3> planned) const;
  void MixMaterials(std::vector<Contact>* contacts) const;
  void SelectTouching();
  void WakeBeforeMovers(double dt);
  bool Meets(const Contact& c) const;
  bool IsSupported(int body, double dt) const;
  void SelectResolved(double dt);
  void ChooseDurations(double dt);
  void LoadUnflown(double dt);
  MotionPlan PlanMotion(double dt);
  void RememberFlights(double dt);
  void FindDepths();
  bool Passes(double dt, std::span<const Vector3> linear, Contact* contact) const;
};

World::World(const Settings& settings) : World(settings, nullptr) {}
World::World(const Settings& settings, parallel::WorkerPool* pool) {
  settings.Validate();
  impl_ = std::make_unique<Impl>(settings, pool);
}
World::~World() = default;
World::World(World&&) noexcept = default;
World& World::operator=(World&&) noexcept = default;

Body& World::Impl::At(int number) {
  if (number < 0 || number >= static_cast<int>(bodies.size()) || bodies[number].removed)
    throw std::invalid_argument("no body has number " + std::to_string(number));
  return bodies[number];
}

int World::Add(const BodyDefinition& definition) {
  Impl& w = *impl_;
  const int number = static_cast<int>(w.bodies.size());
  w.bodies.push_back(MakeBody(definition, "body " + std::to_string(number)));
  w.shapes.push_back(definition.shape);
  w.tolerances.push_back(w.settings.overlap_tolerance * definition.shape.size());
  w.unflown.push_back(0);
  w.flew.push_back(1);
  w.stale = true;
  return number;
}

void World::Remove(int body) {
  impl_->At(body).removed = true;
  impl_->bodies[body].frozen = false;
  SetTwist({}, &impl_->bodies[body]);
  impl_->stale = true;
}

void World::Teleport(int body, const Vector3& position_W, const Quaternion& rotation_WB) {
  const std::string name = "body " + std::to_string(body);
  Body& b = impl_->At(body);
  RequireFinite(name, "position", position_W);
  RequireUnit(name, rotation_WB);
  b.position_W = position_W;
  b.rotation_WB = rotation_WB.normalized();
  b.frozen = false;
  impl_->unflown[body] = 0;
  impl_->stale = true;
}

void World::SetVelocity(int body, const Vector3& linear_W, const Vector3& angular_W) {
  const std::string name = "body " + std::to_string(body);
  Body& b = impl_->At(body);
  RequireFinite(name, "linear velocity", linear_W);
  RequireFinite(name, "angular velocity", angular_W);
  if (b.kind == BodyKind::kFixed) Reject(name, "velocity", "of a fixed body must be zero; make it kinematic");
  SetTwist({linear_W, angular_W}, &b);
  b.frozen = false;
  impl_->unflown[body] = 0;
  impl_->stale = true;
}

void World::SetForce(int body, const Vector3& force_W, const Vector3& torque_W) {
  const std::string name = "body " + std::to_string(body);
  Body& b = impl_->At(body);
  RequireFinite(name, "force", force_W);
  RequireFinite(name, "torque", torque_W);
  b.force_W = force_W;
  b.torque_W = torque_W;
}

void World::SetGravity(const Vector3& gravity_W) {
  impl_->suite.SetGravity(gravity_W);
  impl_->settings.gravity = gravity_W;
  impl_->mover.SetGravity(gravity_W);
}

void World::SetProblemObserver(ProblemObserver observer) { impl_->suite.SetProblemObserver(std::move(observer)); }
void World::SetMaterialCallback(MaterialCallback callback) {
  impl_->material = std::move(callback);
  impl_->stale = true;
}

// Twice the touch gap holds what resting contacts do; the rest is turning and falling within a step.
void World::Impl::ChooseMargins(std::span<const Vector3> expected) {
  travel.assign(expected.begin(), expected.end());
  margins.resize(bodies.size());
  for (size_t i = 0; i < bodies.size(); ++i) {
    const Body& body = bodies[i];
    const bool moves = body.Moves() || body.kind == BodyKind::kKinematic;
    const double size = std::isfinite(shapes[i].size()) ? shapes[i].size() : 0;
    margins[i] = 2 * settings.touch_gap * size;
    if (!moves || !std::isfinite(body.radius)) continue;
    margins[i] += 0.01 * size + dt_hint * body.angular_velocity_W.norm() * body.radius +
                  settings.gravity.norm() * dt_hint * dt_hint;
  }
}

void World::Impl::MixMaterials(std::vector<Contact>* contacts) const {
  if (!material) return;
  for (Contact& c : *contacts) {
    const Material m = material(c, bodies[c.body_a], bodies[c.body_b]);
    c.friction = m.friction;
    c.restitution = m.restitution;
  }
}

void World::Impl::DetectAll() {
  detector.Detect(bodies, shapes, travel, margins, &near_contacts, /*include_frozen=*/true);
  MixMaterials(&near_contacts);
  stale = false;
}

// Contacts between bodies that stand still are kept: their poses have not changed since they were found.
void World::Impl::DetectMoving(std::span<const Vector3> expected) {
  ChooseMargins(expected);
  still.clear();
  std::copy_if(near_contacts.begin(), near_contacts.end(), std::back_inserter(still),
               [&](const Contact& c) { return StandsStill(bodies[c.body_a]) && StandsStill(bodies[c.body_b]); });
  detector.Detect(bodies, shapes, travel, margins, &detected);
  MixMaterials(&detected);
  if (still.empty()) {
    std::swap(near_contacts, detected);
    return;
  }
  near_contacts.clear();
  std::merge(
      still.begin(), still.end(), detected.begin(), detected.end(), std::back_inserter(near_contacts),
      [](const Contact& x, const Contact& y) { return std::tie(x.body_a, x.body_b) < std::tie(y.body_a, y.body_b); });
}

// Every body ends near the path that the last detection swept for it.
bool World::Impl::StaysInReach(std::span<const Vector3> planned) const {
  for (size_t i = 0; i < bodies.size(); ++i) {
    if (!bodies[i].Moves()) continue;
    const double length = travel[i].squaredNorm();
    const double along = length > 0 ? std::clamp(planned[i].dot(travel[i]) / length, 0.0, 1.0) : 0;
    const double turn = dt_hint * bodies[i].angular_velocity_W.norm() * bodies[i].radius;
    if ((planned[i] - along * travel[i]).norm() + turn > margins[i]) return false;
  }
  return true;
}

void World::Impl::SelectTouching() {
  touching.clear();
  for (const Contact& c : near_contacts) {
    const double size = std::min(shapes[c.body_a].size(), shapes[c.body_b].size());
    if (c.gap <= settings.touch_gap * size) touching.push_back(c);
  }
}

// Frozen bodies that a kinematic one reaches within the step wake before it arrives: the motion takes them for walls, and
// nothing stops the other.
void World::Impl::WakeBeforeMovers(double dt) {
  for (const Contact& c : near_contacts) {
    Body& a = bodies[c.body_a];
    Body& b = bodies[c.body_b];
    if (a.frozen == b.frozen || StandsStill(a.frozen ? b : a) || (a.frozen ? b : a).Moves()) continue;
    const double size = std::min(shapes[c.body_a].size(), shapes[c.body_b].size());
    if (c.gap <= settings.touch_gap * size || c.gap > -NormalVelocity(c, a, b) * dt)
      continue;  // touching: the suite's task
    (a.frozen ? a : b).frozen = false;
  }
}

// A body that rests on something, for the moment.
bool World::Impl::IsSupported(int body, double dt) const {
  const Body& b = bodies[body];
  if (!b.Moves()) return true;
  const std::span<const double> support = suite.support();
  return static_cast<size_t>(body) < support.size() && support[body] >= 0.1 * b.mass * settings.gravity.norm() * dt &&
         support[body] > 0;
}

bool World::Impl::Meets(const Contact& c) const {
  return c.gap <= kMeets * std::min(tolerances[c.body_a], tolerances[c.body_b]);
}

// What the step resolves: the contacts that touch, and open ones that two supported bodies would close within the step. Left
// to the motion, those would be undone by lifting a body, and cubes would rock for ever. Bodies in flight are not slowed down
// before they hit, so their bounce is that of the full speed; and what touches them in no more than name is left out. Nor are
// supported bodies slowed down before a hit from which they would rebound for longer than the step.
void World::Impl::SelectResolved(double dt) {
  resolved.clear();
  in_flight = flew;
  for (const Contact& c : near_contacts)
    if (Meets(c)) in_flight[c.body_a] = in_flight[c.body_b] = 0;
  FindDepths();
  for (const Contact& c : near_contacts) {
    const double size = std::min(shapes[c.body_a].size(), shapes[c.body_b].size());
    const bool touches = c.gap <= settings.touch_gap * size;
    if (touches) {
      // In flight: it meets what is there when it gets there, however slow it is.
      if (!Meets(c) && (in_flight[c.body_a] || in_flight[c.body_b])) continue;
    } else {
      const double pull = settings.gravity.norm() * dt;
      const double approach = pull - NormalVelocity(c, bodies[c.body_a], bodies[c.body_b]);
      const bool rebounds = 2 * c.restitution * (approach - pull) > (1 - c.restitution) * pull;
      if (rebounds || c.gap > approach * dt || !IsSupported(c.body_a, dt) || !IsSupported(c.body_b, dt)) continue;
    }
    resolved.push_back(c);
    const bool passes = Passes(dt, {}, &resolved.back());
    resolved.back().touches = touches && !passes;
    if (passes && touches && !(IsSupported(c.body_a, dt) && IsSupported(c.body_b, dt))) resolved.pop_back();
  }
}

// What a flight left of its step is added to the next one if the body then leaves all that it touches.
void World::Impl::ChooseDurations(double dt) {
  durations.assign(bodies.size(), dt);
  for (size_t i = 0; i < bodies.size(); ++i) durations[i] += bodies[i].Moves() ? unflown[i] : 0;
  for (const Contact& c : resolved) {
    if (!c.touches || (durations[c.body_a] == dt && durations[c.body_b] == dt)) continue;
    const double speed = NormalVelocity(c, bodies[c.body_a], bodies[c.body_b]);
    if (speed > 0 || (speed < 0 && c.restitution > 0)) continue;
    durations[c.body_a] = durations[c.body_b] = dt;
  }
}

// The suite knows one time step: forces make up for it where a body moves for longer.
void World::Impl::LoadUnflown(double dt) {
  loaded.clear();
  for (size_t i = 0; i < bodies.size(); ++i) {
    if (durations[i] == dt) continue;
    Body& body = bodies[i];
    loaded.push_back({static_cast<int>(i), body.force_W, body.torque_W});
    const double share = durations[i] / dt;
    body.force_W = share * body.force_W + (share - 1) * body.mass * settings.gravity;
    body.torque_W *= share;
  }
}

// After the suite, before the move.
MotionPlan World::Impl::PlanMotion(double dt) {
  const SuiteMemory& memory = suite.memory();
  flies.assign(bodies.size(), 1);
  for (size_t c = 0; c < resolved.size(); ++c) {
    for (const int i : {resolved[c].body_a, resolved[c].body_b})
      if (Pushes(memory.previous_holding[c], settings.gravity, dt, bodies[i])) flies[i] = 0;
  }
  before.assign(suite.velocities_before_gravity().begin(), suite.velocities_before_gravity().end());
  RestoreBounced(dt, settings.gravity, bodies, resolved, memory.previous_holding, &before);
  for (const Load& load : loaded) {
    bodies[load.body].force_W = load.force_W;
    bodies[load.body].torque_W = load.torque_W;
  }
  return {dt, durations, flies, before};
}

void World::Impl::RememberFlights(double dt) {
  for (size_t i = 0; i < bodies.size(); ++i) {
    const double left = bodies[i].Moves() ? mover.left()[i] : 0;
    unflown[i] = std::min(left, dt);
    flew[i] = flies[i] && left == 0;
  }
}

void World::Impl::FindDepths() {
  depths.assign(bodies.size(), 0.0);
  for (const Contact& c : near_contacts)
    for (const int i : {c.body_a, c.body_b}) depths[i] = std::max(depths[i], -c.gap);
}

// linear: [m] where each body goes; empty: on at its present velocity. A sphere that rests deeper than it should may pass as
// deep as that.
bool World::Impl::Passes(double dt, std::span<const Vector3> linear, Contact* contact) const {
  constexpr double kDepth = 1e-6;  // [sphere radii]
  const auto traveller = [&](int i) -> Traveller {
    if (StandsStill(bodies[i])) return {bodies[i], shapes[i], Vector3::Zero(), Vector3::Zero()};
    return {bodies[i], shapes[i], linear.empty() ? Vector3(dt * bodies[i].linear_velocity_W) : linear[i],
            dt * bodies[i].angular_velocity_W};
  };
  const int a = contact->body_a, b = contact->body_b;
  const int sphere = shapes[b].kind() == ShapeKind::kSphere ? b : a;
  if (shapes[sphere].kind() != ShapeKind::kSphere) return false;
  return PassesBy(traveller(a), traveller(b), depths[sphere] + kDepth * shapes[sphere].radius(), contact);
}

void World::CheckInitialOverlap() {
  Impl& w = *impl_;
  if (w.stale) {
    w.travel.resize(w.bodies.size());
    for (size_t i = 0; i < w.bodies.size(); ++i) w.travel[i] = w.dt_hint * w.bodies[i].linear_velocity_W;
    w.ChooseMargins(std::vector<Vector3>(w.travel));
    w.DetectAll();
    w.SelectTouching();
  }
  for (const Contact& c : w.near_contacts) {
    const double allowed = w.settings.touch_gap * std::min(w.shapes[c.body_a].size(), w.shapes[c.body_b].size());
    if (std::max(c.body_a, c.body_b) < static_cast<int>(w.checked_bodies) || -c.gap <= allowed) continue;
    throw std::invalid_argument("bodies " + std::to_string(c.body_a) + " and " + std::to_string(c.body_b) +
                                " overlap by " + std::to_string(-c.gap) + " m at the start");
  }
  w.checked_bodies = w.bodies.size();
}

StepReport World::Step(double dt) {
  if (!(dt > 0) || !std::isfinite(dt))
    throw std::invalid_argument("dt = " + std::to_string(dt) + " must be a positive time");
  Impl& w = *impl_;
  StepReport report;
  double lap = Seconds();
  const auto finish = [&lap](double* stage) {
    const double now = Seconds();
    *stage += now - lap;
    lap = now;
  };
  w.dt_hint = dt;
  CheckInitialOverlap();  // detection, if anything changed
  w.WakeBeforeMovers(dt);
  w.SelectResolved(dt);
  if (w.settings.bounce_law == BounceLaw::kExact)
    SetRebounds(w.bodies, w.suite.memory().previous_contacts, w.suite.memory().previous_holding, w.resolved);
  w.ChooseDurations(dt);
  w.LoadUnflown(dt);
  finish(&report.seconds.detect);

  w.suite.Resolve(dt, w.bodies, w.resolved, &report);  // steps 1 to 4
  lap = Seconds();

  const MotionPlan plan = w.PlanMotion(dt);
  const std::span<const Vector3> planned = w.mover.PlanTravel(plan, w.bodies);
  if (!w.StaysInReach(planned)) {
    w.DetectMoving(planned);
    finish(&report.seconds.detect);
  }
  w.FindDepths();
  for (Contact& c : w.near_contacts) w.Passes(dt, planned, &c);
  double detect_seconds = 0;
  const DetectContacts detect = [&](std::span<const Vector3> travel, std::vector<Contact>*) {
    const double start = Seconds();
    w.DetectMoving(travel);
    detect_seconds += Seconds() - start;
  };
  const MotionOutcome moved = w.mover.Move(plan, w.tolerances, detect, w.bodies, &w.near_contacts);
  w.RememberFlights(dt);
  w.SelectTouching();
  finish(&report.seconds.move);
  report.seconds.move -= detect_seconds;
  report.seconds.detect += detect_seconds;

  report.penetration_max = moved.penetration_max;
  report.motion_passes = moved.passes;
  report.motion_failures = moved.reached ? 0 : 1;
  w.time += dt;
  return report;
}

WorldSnapshot World::Save() const {
  return WorldSnapshot(std::make_shared<const WorldSnapshot::Data>(
      WorldSnapshot::Data{*impl_, impl_->suite.memory(), impl_->settings.gravity}));
}

void World::Restore(const WorldSnapshot& snapshot) {
  static_cast<WorldState&>(*impl_) = snapshot.data_->world;
  impl_->suite.SetMemory(snapshot.data_->suite);
  SetGravity(snapshot.data_->gravity);
}

std::span<const Body> World::bodies() const { return impl_->bodies; }
const Body& World::body(int number) const { return impl_->bodies.at(number); }
const Shape& World::shape(int number) const { return impl_->shapes.at(number); }
std::span<const Contact> World::contacts() const { return impl_->touching; }
std::span<const Contact> World::resolved_contacts() const { return impl_->resolved; }
std::span<const Vector3> World::impulses() const { return impl_->suite.impulses(); }
const Settings& World::settings() const { return impl_->settings; }
double World::time() const { return impl_->time; }
std::uint64_t World::StateHash() const { return HashBodies(impl_->bodies); }

}  // namespace islet
