#include "engine/world.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <stdexcept>
#include <utility>

#include "engine/body_definition.h"
#include "engine/detection/detection.h"
#include "engine/ledger.h"
#include "engine/motion/crowd.h"
#include "engine/motion/group_motion.h"
#include "engine/motion/lever.h"
#include "engine/response/suite_frame.h"
#include "engine/state_hash.h"
#include "engine/stopwatch.h"
#include "parallel/worker_pool.h"

namespace islet {

static constexpr int kMostHalvings = 6;  // of a step in which a crowd would let something through

[[noreturn]] static void RefuseMaterial(const Contact& c, const std::string& field, double value) {
  throw std::invalid_argument("contact of bodies " + std::to_string(c.body_a) + " and " + std::to_string(c.body_b) +
                              ": " + field + " = " + std::to_string(value));
}

// All that one step leaves for the next, but for what the suite remembers.
struct WorldState {
  std::vector<Body> bodies;
  std::vector<Shape> shapes;
  std::vector<Contact> near_contacts;  // at the current poses, up to the reach of the last detection
  std::vector<Contact> touching;       // of these, those that touch
  std::vector<Contact> resolved;       // those at which impulses acted in the last step
  std::vector<Vector3> impulses;       // [N s] at those, W, on body_b
  std::vector<Vector3> travel;         // [m] that the last detection expected of each body
  std::vector<double> margins;         // [m] and how far it may stray from that
  motion::GroupMemory groups;
  motion::CrowdMemory crowd_memory;
  std::vector<std::uint8_t>
      crowd;                  // per body: it was of a crowd in the last step, and its contacts are in near_contacts
  bool stale = true;          // near_contacts do not belong to the current poses
  size_t checked_bodies = 0;  // those before it were checked for initial overlap
  double time = 0;            // [s]
  double dt_hint = 1.0 / 30;  // [s] of the last step
};

struct WorldSnapshot::Data {
  WorldState world;
  Vector3 gravity;
};

struct [[gnu::visibility("hidden")]] World::Impl : WorldState {
  Settings settings;
  std::unique_ptr<parallel::WorkerPool> own_pool;
  parallel::WorkerPool* pool;
  Detector detector;
  MaterialCallback material;
  std::vector<Contact> detected, still;  // scratch
  motion::GroupMotion group_motion;
  motion::Crowd crowd_motion;
  motion::MixMaterial mix;
  LedgerKeeper ledger;
  ProblemObserver observer;
  std::vector<Body> before;                        // the step
  std::vector<Vector3> planned;                    // [m] per body: its way without contacts
  std::vector<std::pair<Contact, Vector3>> acted;  // [N s] in all parts of the step
  std::vector<std::uint8_t> frozen_apart;
  std::vector<LedgerImpulse> ledger_impulses;
  std::vector<int> group_places;  // in impulses, of those of small groups
  LadderReport spared;            // what detection was spared in this step
  // Of a step in which all stood still before and after: the next one does the same again, unless somebody changes something.
  std::optional<StepReport> rest;
  double rest_dt = 0;  // [s]

  Impl(const Settings& s, parallel::WorkerPool* p)
      : settings(s),
        own_pool(p ? nullptr : std::make_unique<parallel::WorkerPool>(s.threads)),
        pool(p ? p : own_pool.get()),
        detector(pool, s.ladder.Has(qp::Rung::kKeptPairs)),
        group_motion(s, pool),
        crowd_motion(s, pool),
        mix([this](Contact* c, const Body& a, const Body& b) {
          c->friction = MixFriction(a.friction, b.friction);
          c->restitution = MixRestitution(a.restitution, b.restitution);
          if (!material) return;
          const Material m = material(*c, a, b);
          c->friction = m.friction;
          c->restitution = m.restitution;
          if (!(m.friction >= 0 && std::isfinite(m.friction))) RefuseMaterial(*c, "friction", m.friction);
          if (!(m.restitution >= 0 && m.restitution <= 1)) RefuseMaterial(*c, "restitution", m.restitution);
        }),
        ledger(pool) {}

  Body& At(int number);
  void DetectAll();
  void DetectMoving(std::span<const Vector3> expected);
  void CountKept();
  void ChooseMargins(std::span<const Vector3> expected);
  bool StaysInReach() const;
  void MixMaterials(std::vector<Contact>* contacts) const;
  void SelectTouching();
  bool Touches(const Contact& c) const;
  bool MovesGroups() const;
  void CarryKinematic(double dt);
  void SetApart(bool apart);
  bool CrowdChanged() const;
  void WakeNewcomers();
  void StepCrowd(double dt, StepReport* report);
  bool StepOnce(double dt, bool races, StepReport* report);
  void StepInParts(double dt, int halvings, StepReport* report);
  void KeepLedger(double dt, StepReport* report);
  void AddImpulses(std::span<const LedgerImpulse> of_part);
  void AddGroups(StepReport* report);
  void CheckTouching();
  void Changed();
  void Remember(double dt, const StepReport& report);
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
  w.Changed();
  return number;
}

void World::Remove(int body) {
  impl_->At(body).removed = true;
  impl_->bodies[body].frozen = false;
  SetTwist({}, &impl_->bodies[body]);
  impl_->Changed();
}

void World::Teleport(int body, const Vector3& position_W, const Quaternion& rotation_WB) {
  const std::string name = "body " + std::to_string(body);
  Body& b = impl_->At(body);
  RequireFinite(name, "position", position_W);
  RequireUnit(name, rotation_WB);
  b.position_W = position_W;
  b.rotation_WB = rotation_WB.normalized();
  b.frozen = false;
  impl_->Changed();
}

void World::SetVelocity(int body, const Vector3& linear_W, const Vector3& angular_W) {
  const std::string name = "body " + std::to_string(body);
  Body& b = impl_->At(body);
  RequireFinite(name, "linear velocity", linear_W);
  RequireFinite(name, "angular velocity", angular_W);
  if (b.kind == BodyKind::kFixed) Reject(name, "velocity", "of a fixed body must be zero; make it kinematic");
  SetTwist({linear_W, angular_W}, &b);
  b.frozen = false;
  impl_->Changed();
}

void World::SetForce(int body, const Vector3& force_W, const Vector3& torque_W) {
  const std::string name = "body " + std::to_string(body);
  Body& b = impl_->At(body);
  RequireFinite(name, "force", force_W);
  RequireFinite(name, "torque", torque_W);
  if (b.force_W == force_W && b.torque_W == torque_W) return;
  b.force_W = force_W;
  b.torque_W = torque_W;
  impl_->rest.reset();
  impl_->groups.Disturb();
}

void World::SetGravity(const Vector3& gravity_W) {
  if (!gravity_W.allFinite()) throw std::invalid_argument("gravity is not finite");
  impl_->settings.gravity = gravity_W;
  impl_->crowd_motion.SetGravity(gravity_W);
  impl_->group_motion.SetGravity(gravity_W);
  impl_->rest.reset();
  impl_->groups.Disturb();
}

void World::SetProblemObserver(ProblemObserver observer) {
  impl_->observer = std::move(observer);
  impl_->rest.reset();
}
void World::SetMaterialCallback(MaterialCallback callback) {
  impl_->material = std::move(callback);
  std::fill(impl_->groups.mark.begin(), impl_->groups.mark.end(), motion::GroupMemory::kAwake);
  impl_->Changed();
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

void World::Impl::CountKept() {
  const KeptContacts kept = detector.kept();
  spared.Add(qp::Rung::kKeptPairs, kept.pairs, kept.contacts);
}

// Contacts between bodies that stand still are kept: their poses have not changed since they were found.
void World::Impl::DetectMoving(std::span<const Vector3> expected) {
  ChooseMargins(expected);
  if (!settings.ladder.Has(qp::Rung::kKeptPairs)) {
    DetectAll();
    CountKept();
    return;
  }
  still.clear();
  std::copy_if(near_contacts.begin(), near_contacts.end(), std::back_inserter(still),
               [&](const Contact& c) { return StandsStill(bodies[c.body_a]) && StandsStill(bodies[c.body_b]); });
  detector.Detect(bodies, shapes, travel, margins, &detected);
  CountKept();
  MixMaterials(&detected);
  if (still.empty()) {
    std::swap(near_contacts, detected);
    return;
  }
  near_contacts.clear();
  std::merge(still.begin(), still.end(), detected.begin(), detected.end(), std::back_inserter(near_contacts),
             EarlierPair);
}

// Every body ends near the path that the last detection swept for it.
bool World::Impl::StaysInReach() const {
  for (size_t i = 0; i < bodies.size(); ++i) {
    if (!bodies[i].Moves()) continue;
    const double length = travel[i].squaredNorm();
    const double along = length > 0 ? std::clamp(planned[i].dot(travel[i]) / length, 0.0, 1.0) : 0;
    const double turn = dt_hint * bodies[i].angular_velocity_W.norm() * bodies[i].radius;
    if ((planned[i] - along * travel[i]).norm() + turn > margins[i]) return false;
  }
  return true;
}

// A little more than the touch gap: people place bodies at round distances, and rounding must not decide.
bool World::Impl::Touches(const Contact& c) const {
  constexpr double kMore = 1 + 1e-6;
  return c.gap <= kMore * settings.touch_gap * std::min(shapes[c.body_a].size(), shapes[c.body_b].size());
}

void World::Impl::SelectTouching() {
  touching.clear();
  for (const Contact& c : near_contacts) {
    if (Touches(c)) touching.push_back(c);
  }
}

void World::Impl::CheckTouching() {
  std::vector<Vector3> expected(bodies.size());
  for (size_t i = 0; i < bodies.size(); ++i) expected[i] = dt_hint * bodies[i].linear_velocity_W;
  ChooseMargins(expected);
  DetectAll();
  SelectTouching();
}

// What corrects a spread impulse is told with it.
void World::Impl::AddImpulses(std::span<const LedgerImpulse> of_part) {
  group_places.clear();
  for (const LedgerImpulse& j : of_part) {
    group_places.push_back(j.corrects < 0 ? static_cast<int>(impulses.size()) : group_places[j.corrects]);
    if (j.corrects >= 0) {
      impulses[group_places.back()] += j.impulse_W;
      continue;
    }
    resolved.push_back(j.contact);
    impulses.push_back(j.impulse_W);
  }
}

// The contacts and impulses of small groups, beside those of the crowd.
void World::Impl::AddGroups(StepReport* report) {
  AddImpulses(group_motion.impulses());
  const size_t own = touching.size();
  for (const Contact& c : groups.contacts)
    if (Touches(c)) touching.push_back(c);
  report->contacts += static_cast<int>(touching.size());
  if (own > 0 && own < touching.size()) std::stable_sort(touching.begin(), touching.end(), EarlierPair);
  std::sort(report->islands.begin(), report->islands.end(),
            [](const IslandReport& x, const IslandReport& y) { return x.first_body < y.first_body; });
}

void World::CheckInitialOverlap() {
  Impl& w = *impl_;
  if (w.stale) w.CheckTouching();
  for (const Contact& c : w.near_contacts) {
    const double allowed = w.settings.touch_gap * std::min(w.shapes[c.body_a].size(), w.shapes[c.body_b].size());
    if (std::max(c.body_a, c.body_b) < static_cast<int>(w.checked_bodies) || -c.gap <= allowed) continue;
    throw std::invalid_argument("bodies " + std::to_string(c.body_a) + " and " + std::to_string(c.body_b) +
                                " overlap by " + std::to_string(-c.gap) + " m at the start");
  }
  w.checked_bodies = w.bodies.size();
}

void World::Impl::Changed() {
  stale = true;
  rest.reset();
  groups.Disturb();
}

// Small groups are solved by exact friction; the paper's models and freezing are for crowds.
bool World::Impl::MovesGroups() const {
  return settings.group_bodies > 0 && settings.model == Model::kCoulomb && settings.cone == Cone::kCircular &&
         settings.bounce_law == BounceLaw::kExact && settings.freezing != Freezing::kPaper;
}

void World::Impl::CarryKinematic(double dt) {
  for (Body& body : bodies) {
    if (body.kind != BodyKind::kKinematic || body.removed) continue;
    body.position_W += dt * body.linear_velocity_W;
    body.rotation_WB = motion::Turned(dt * body.angular_velocity_W, body.rotation_WB);
  }
}

bool World::Impl::CrowdChanged() const {
  return !std::equal(crowd.begin(), crowd.end(), group_motion.crowd().begin(), group_motion.crowd().end());
}

// What rested in a small group is new to the crowd, which does not know what held it.
void World::Impl::WakeNewcomers() {
  for (size_t i = 0; i < bodies.size(); ++i)
    if (group_motion.crowd()[i] && (i >= crowd.size() || !crowd[i])) bodies[i].frozen = false;
}

// Bodies of small groups are not there for the crowd.
void World::Impl::SetApart(bool apart) {
  if (apart) frozen_apart.assign(bodies.size(), 0);
  for (size_t i = 0; i < bodies.size(); ++i) {
    Body& body = bodies[i];
    if (body.kind != BodyKind::kDynamic || crowd[i] || before[i].removed) continue;
    body.removed = apart;
    if (apart) frozen_apart[i] = std::exchange(body.frozen, false);
    if (!apart) body.frozen = frozen_apart[i] != 0;
  }
}

void World::Impl::StepCrowd(double dt, StepReport* report) {
  double lap = Seconds();
  if (stale) CheckTouching();
  planned.resize(bodies.size());
  for (size_t i = 0; i < bodies.size(); ++i) {
    planned[i] = dt * bodies[i].linear_velocity_W;
    if (bodies[i].Moves()) planned[i] += 0.5 * dt * dt * (settings.gravity + bodies[i].force_W / bodies[i].mass);
  }
  if (settings.ladder.Has(qp::Rung::kReach) && StaysInReach()) {
    spared.Add(qp::Rung::kReach, 1, static_cast<std::int64_t>(near_contacts.size()));
  } else {
    DetectMoving(planned);
  }
  const double detected_at = Seconds();
  report->seconds.detect += detected_at - lap;
  const double others = report->seconds.Total();
  crowd_motion.Step(
      dt, [this](std::span<const Vector3> travel_W, std::vector<Contact>*) { DetectMoving(travel_W); }, observer,
      bodies, shapes, &near_contacts, &crowd_memory, report);
  resolved.clear();
  impulses.clear();
  AddImpulses(crowd_motion.impulses());
  SelectTouching();
  report->seconds.move += Seconds() - detected_at - (report->seconds.Total() - others);
  report->motion_ladder.Include(std::exchange(spared, {}));
}

void World::Impl::KeepLedger(double dt, StepReport* report) {
  ledger_impulses.assign(group_motion.impulses().begin(), group_motion.impulses().end());
  const int own = static_cast<int>(ledger_impulses.size());
  for (LedgerImpulse j : crowd_motion.impulses()) {
    if (j.corrects >= 0) j.corrects += own;
    ledger_impulses.push_back(j);
  }
  report->ledger = ledger.Judge(
      {dt, settings.gravity, before, bodies, shapes, ledger_impulses, report->certificate.coulomb_map_max});
  report->energy_gain = ledger.energy_gain();
}

// Returns false, and has done nothing, where a crowd would let something through and `races` are refused.
bool World::Impl::StepOnce(double dt, bool races, StepReport* report) {
  dt_hint = dt;
  before = bodies;
  const double moving = Seconds();
  const bool grouped = MovesGroups();
  if (grouped && !group_motion.Step(dt, races, bodies, shapes, mix, observer, &groups, report)) return false;
  report->seconds.move += Seconds() - moving - report->seconds.static_qp - report->seconds.collision_qp;
  if (!grouped || group_motion.any_crowd()) {
    const bool apart = grouped;
    if (apart) {
      stale = stale || CrowdChanged();
      WakeNewcomers();
      crowd.assign(group_motion.crowd().begin(), group_motion.crowd().end());
      SetApart(true);
    }
    StepCrowd(dt, report);
    if (apart) SetApart(false);
  } else {
    CarryKinematic(dt);
    crowd_motion.Rest();
    crowd.assign(bodies.size(), 0);
    resolved.clear();
    impulses.clear();
    touching.clear();
    near_contacts.clear();
    stale = true;
  }
  KeepLedger(dt, report);
  AddGroups(report);
  time += dt;
  return true;
}

// In halves, where a crowd would let something through in one.
void World::Impl::StepInParts(double dt, int halvings, StepReport* report) {
  StepReport part;
  if (!StepOnce(dt, halvings == 0, &part)) {
    StepInParts(0.5 * dt, halvings - 1, report);
    StepInParts(0.5 * dt, halvings - 1, report);
    return;
  }
  report->Append(std::move(part));
  for (size_t c = 0; c < resolved.size(); ++c) acted.emplace_back(resolved[c], impulses[c]);
}

// A callback may change its mind without telling.
void World::Impl::Remember(double dt, const StepReport& report) {
  rest.reset();
  if (material || !AllStandStill(before) || !AllStandStill(bodies) || report.woken > 0 || report.newly_frozen > 0)
    return;
  rest = report;
  rest->seconds = {};
  rest_dt = dt;
}

StepReport World::Step(double dt) {
  if (!(dt > 0) || !std::isfinite(dt))
    throw std::invalid_argument("dt = " + std::to_string(dt) + " must be a positive time");
  Impl& w = *impl_;
  if (w.rest && w.rest_dt == dt) {
    w.time += dt;
    return *w.rest;
  }
  StepReport report;
  w.dt_hint = dt;
  const double start = Seconds();
  if (w.checked_bodies < w.bodies.size()) CheckInitialOverlap();
  report.seconds.detect += Seconds() - start;
  if (w.StepOnce(dt, false, &report)) {
    w.Remember(dt, report);
    return report;
  }
  const double end = w.time + dt;
  w.acted.clear();
  for (int half = 0; half < 2; ++half) w.StepInParts(0.5 * dt, kMostHalvings - 1, &report);
  w.resolved.clear();
  w.impulses.clear();
  for (const auto& [contact, impulse] : w.acted) {
    w.resolved.push_back(contact);
    w.impulses.push_back(impulse);
  }
  w.time = end;
  return report;
}

WorldSnapshot World::Save() const {
  return WorldSnapshot(
      std::make_shared<const WorldSnapshot::Data>(WorldSnapshot::Data{*impl_, impl_->settings.gravity}));
}

void World::Restore(const WorldSnapshot& snapshot) {
  SetGravity(snapshot.data_->gravity);  // first: it disturbs what rests, and what is restored was not
  static_cast<WorldState&>(*impl_) = snapshot.data_->world;
  impl_->rest.reset();
}

std::span<const Body> World::bodies() const { return impl_->bodies; }
const Body& World::body(int number) const { return impl_->bodies.at(number); }
const Shape& World::shape(int number) const { return impl_->shapes.at(number); }
std::span<const Contact> World::contacts() const { return impl_->touching; }
std::span<const Contact> World::resolved_contacts() const { return impl_->resolved; }
std::span<const Vector3> World::impulses() const { return impl_->impulses; }
const Settings& World::settings() const { return impl_->settings; }
double World::time() const { return impl_->time; }
std::uint64_t World::StateHash() const { return HashBodies(impl_->bodies); }

}  // namespace islet
