#include <algorithm>
#include <cmath>
#include <functional>
#include <new>
#include <stdexcept>
#include <tuple>
#include <utility>

#include "engine/body_definition.h"
#include "engine/motion/lever.h"
#include "engine/motion/tuning.h"
#include "engine/response/suite_frame.h"
#include "engine/slice.h"
#include "engine/stopwatch.h"
#include "engine/world/world_impl.h"
#include "qp/smallness.h"

namespace islet {

using motion::Races;

// [m] of what turning moves most: of a half-space where it may meet anything.
double World::Impl::Lever(const Body& turning) const {
  if (std::isfinite(turning.radius)) return turning.radius;
  double lever = 0;
  for (const Body& body : bodies)
    if (CanMove(body)) lever = std::max(lever, (body.position_W - turning.position_W).norm() + body.radius);
  return lever;
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
    if (!moves) continue;
    const double turn = dt_hint * body.angular_velocity_W.norm();
    margins[i] += 0.01 * size + (turn > 0 ? turn * Lever(body) : 0) + settings.gravity.norm() * dt_hint * dt_hint;
  }
}

void World::Impl::MixMaterials(std::vector<Contact>* contacts) const {
  for (Contact& c : *contacts) Mix(&c, bodies[c.body_a], bodies[c.body_b]);
}

void World::Impl::DetectAll(std::span<const Body> asked) {
  const PairRule rule{&filter, asked};
  detector.Detect(bodies, shapes, travel, margins, &near_contacts, /*include_frozen=*/true, &rule);
  MixMaterials(&near_contacts);
  stale = false;
}

// Contacts between bodies that stand still are kept: their poses have not changed since they were found.
void World::Impl::DetectMoving(std::span<const Vector3> expected) {
  ChooseMargins(expected);
  if (!settings.ladder.Has(qp::Rung::kKeptPairs)) {
    DetectAll(before);
    return;
  }
  still.clear();
  const PairRule rule{&filter, before};
  std::copy_if(near_contacts.begin(), near_contacts.end(), std::back_inserter(still), [&](const Contact& c) {
    return StandsStill(bodies[c.body_a]) && StandsStill(bodies[c.body_b]) &&
           (!filter.has_callback() || rule.Allows(c.body_a, c.body_b));
  });
  detector.Detect(bodies, shapes, travel, margins, &detected, /*include_frozen=*/false, &rule);
  const KeptContacts kept = detector.kept();
  spared.Add(qp::Rung::kKeptPairs, kept.pairs, kept.contacts);
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
    if (StandsStill(bodies[i])) continue;
    const double length = travel[i].squaredNorm();
    const double along = length > 0 ? std::clamp(planned[i].dot(travel[i]) / length, 0.0, 1.0) : 0;
    const double turn = dt_hint * bodies[i].angular_velocity_W.norm() * bodies[i].radius;
    if ((planned[i] - along * travel[i]).norm() + turn > margins[i]) return false;
  }
  return true;
}

// A little more than the touch gap: people place bodies at round distances, and rounding must not decide.
bool World::Impl::Touches(const Contact& c) const {
  return c.gap <= (1 + kSamePoint) * settings.touch_gap * std::min(shapes[c.body_a].size(), shapes[c.body_b].size());
}

void World::Impl::SelectTouching() {
  touching.clear();
  for (const Contact& c : near_contacts) {
    if (Touches(c)) touching.push_back(c);
  }
}

void World::Impl::CheckTouching(std::span<const Body> asked) {
  std::vector<Vector3> expected(bodies.size());
  for (size_t i = 0; i < bodies.size(); ++i) expected[i] = dt_hint * bodies[i].linear_velocity_W;
  ChooseMargins(expected);
  DetectAll(asked);
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
  const double lap = Seconds();
  if (stale) CheckTouching(before);
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
  CountStage("detect", lap, detected_at, &report->seconds.detect);
  const double others = report->seconds.Total(),
               map_of_others = std::exchange(report->certificate.coulomb_map_max, 0.0);
  crowd_motion.Step(
      dt, [this](std::span<const Vector3> travel_W) { DetectMoving(travel_W); }, observer, bodies, shapes,
      &near_contacts, &crowd_memory, report);
  crowd_map_max = report->certificate.coulomb_map_max;
  report->certificate.coulomb_map_max = Worse(crowd_map_max, map_of_others);
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
    j.accuracy = crowd_map_max;
    ledger_impulses.push_back(j);
  }
  report->ledger = ledger.Judge({dt, whole_dt, settings.gravity, before, bodies, shapes, ledger_impulses, &filter});
  report->energy_gain = ledger.energy_gain();
}

// Whether what comes may be done again in halves, if a crowd fails in it. What fails step after step, as where walls close, would fail in
// those, too.
bool World::Impl::MayBeTakenBack() const { return MovesGroups() && !failed; }

// Returns false, and has moved nothing, where a crowd would let something through, or fail, and races are refused. Where they are taken and
// something went through all the same, small groups that gave up stay where they are.
bool World::Impl::StepOnce(double dt, Races races, StepReport* report) {
  const bool may_retry = races == Races::kRefused ? MayBeTakenBack() : races == Races::kTaken && MovesGroups();
  if (may_retry) part_start = *this;
  dt_hint = dt;
  arcs.Follow(time - began, dt, bodies);
  before = bodies;
  const double moving = Seconds();
  const bool grouped = MovesGroups();
  if (grouped && !group_motion.Step(dt, races, bodies, shapes, filter, mix, observer, &groups, report)) return false;
  const double moved = Seconds();
  if (grouped) TellSlice({"groups", moving, moved});
  report->seconds.move += moved - moving - report->seconds.static_qp - report->seconds.collision_qp;
  if (!grouped || group_motion.any_crowd()) {
    if (grouped) {
      stale = stale || CrowdChanged();
      WakeNewcomers();
      crowd.assign(group_motion.crowd().begin(), group_motion.crowd().end());
      SetApart(true);
    }
    const double begin = Seconds();
    StepCrowd(dt, report);
    TellSlice({"crowd", begin, Seconds()});
    if (grouped) SetApart(false);
  } else {
    CarryKinematic(dt);
    crowd_motion.Rest();
    crowd_memory.contacts.clear();
    crowd_memory.forces_W.clear();
    crowd.assign(bodies.size(), 0);
    resolved.clear();
    impulses.clear();
    touching.clear();
    near_contacts.clear();
    stale = true;
  }
  const double begin = Seconds();
  KeepLedger(dt, report);
  TellSlice({"ledger", begin, Seconds()});
  if (may_retry && group_motion.any_crowd() &&
      (races == Races::kRefused ? report->Failed() : report->ledger.sides_changed > 0)) {
    static_cast<WorldState&>(*this) = part_start;
    stale = true;
    if (races == Races::kRefused) return false;
    *report = {};
    return StepOnce(dt, Races::kHalted, report);
  }
  AddHits();
  AddPassed();
  AddGroups(report);
  time += dt;
  return true;
}

// In halves, where a crowd would let something through in one.
void World::Impl::StepInParts(double dt, int halvings, StepReport* report) {
  StepReport part;
  if (!StepOnce(dt, halvings == 0 ? Races::kTaken : Races::kRefused, &part)) {
    StepInParts(0.5 * dt, halvings - 1, report);
    StepInParts(0.5 * dt, halvings - 1, report);
    return;
  }
  report->Append(std::move(part));
  for (size_t c = 0; c < resolved.size(); ++c) acted.emplace_back(resolved[c], impulses[c]);
}

// Bodies that were frozen as the step began and are not as it ends, and the other way round.
void World::Impl::CountFrozen(StepReport* report) const {
  for (size_t i = 0; i < bodies.size(); ++i) {
    report->woken += frozen_before[i] && !bodies[i].frozen;
    report->newly_frozen += !frozen_before[i] && bodies[i].frozen;
  }
}

// What is done again costs nothing only where nothing was done. A callback may change its mind without telling.
void World::Impl::Remember(double dt, const StepReport& report) {
  rest.reset();
  if (material || filter.has_callback() || !AllStandStill(before) || !AllStandStill(bodies) || report.woken > 0 ||
      report.newly_frozen > 0 || report.static_qp.solved > 0 || report.collision_qp.solved > 0)
    return;
  rest = report;
  rest->seconds = {};
  rest_dt = dt;
}

void World::Impl::ForgetAll() {
  groups = {};
  crowd_memory = {};
  crowd.clear();
  failed = false;
  for (Body& b : bodies) b.frozen = false;
  Changed();
}

bool World::Impl::WasInCrowd(const Contact& contact) const {
  const auto was = [&](int i) {
    return bodies[i].kind == BodyKind::kDynamic && static_cast<size_t>(i) < crowd.size() && crowd[i];
  };
  return !MovesGroups() || was(contact.body_a) || was(contact.body_b);
}

// What rides on walls and belts whose velocity the user changed, by what held it as the step before ended.
void World::Impl::BeginRide(double dt, double dt_before) {
  ride.Clear();
  arcs.Clear();
  if (settings.stateless || !motion::Ride::AnyChanged(bodies)) {
    for (Body& b : bodies) b.rides = false;
    return;
  }
  arcs.Begin(dt, dt_before, bodies);
  held = groups.contacts;
  held_by_W = groups.forces_W;
  for (size_t c = 0; c < crowd_memory.contacts.size(); ++c) {
    if (!WasInCrowd(crowd_memory.contacts[c])) continue;
    held.push_back(crowd_memory.contacts[c]);
    held_by_W.push_back(crowd_memory.forces_W[c]);
  }
  ride.Begin(dt, settings, shapes, filter, mix, held, held_by_W, bodies);
}

// What is refused leaves all as it was.
void World::Impl::AdmitNewcomers() {
  if (!AnyNewcomers()) return;
  const std::tuple kept(near_contacts, touching, travel, margins, stale);
  try {
    CheckNewcomers();
  } catch (...) {
    std::tie(near_contacts, touching, travel, margins, stale) = kept;
    throw;
  }
}

StepReport World::Impl::StepWhole(double dt) {
  StepReport report;
  const double start_seconds = Seconds();
  AdmitNewcomers();  // first: it may throw
  found = bodies;
  filter.SetFound(found);
  const double dt_before = std::exchange(whole_dt, dt);
  dt_hint = dt;
  began = time;
  crowd_motion.SetWholeStep(dt);
  group_motion.SetWholeStep(dt);
  hits.clear();
  passed.clear();
  if (settings.stateless) ForgetAll();
  frozen_before.resize(bodies.size());
  for (size_t i = 0; i < bodies.size(); ++i) frozen_before[i] = bodies[i].frozen;
  BeginRide(dt, dt_before);
  double checked = 0;
  CountStage("detect", start_seconds, Seconds(), &checked);
  if (StepOnce(dt, Races::kRefused, &report)) {
    TellHits();
    ride.End(bodies, &resolved, &impulses);
    arcs.End(bodies);
    report.seconds.detect += checked;
    CountFrozen(&report);
    failed = report.Failed();
    Remember(dt, report);
    return report;
  }
  rest.reset();
  report = {};
  report.seconds.detect += checked;
  const double end = time + dt;
  acted.clear();
  for (int half = 0; half < 2; ++half) StepInParts(0.5 * dt, motion::kMostHalvings - 1, &report);
  resolved.clear();
  impulses.clear();
  for (const auto& [contact, impulse] : acted) {
    resolved.push_back(contact);
    impulses.push_back(impulse);
  }
  time = end;
  TellHits();
  ride.End(bodies, &resolved, &impulses);
  arcs.End(bodies);
  CountFrozen(&report);
  failed = report.Failed();
  return report;
}

// Whether a step has enough to do for several workers to be called once for all of it.
bool World::Impl::IsShared() const { return bodies.size() > parallel::kAtOnce || group_motion.any_crowd(); }

StepReport World::Step(double dt) {
  RequireStep(dt);
  Impl& w = *impl_;
  const Impl::Busy busy(&w, "Step");
  if (w.lost) throw std::logic_error("World: a step ran out of memory half done; Restore a snapshot to go on");
  if (w.rest && w.rest_dt == dt) {
    w.time += dt;
    w.RepeatEvents();
    return *w.rest;
  }
  const bool custom =
      std::any_of(w.shapes.begin(), w.shapes.end(), [](const Shape& s) { return s.kind() == ShapeKind::kCustom; });
  const bool may_throw = w.material || w.filter.has_callback() || w.observer || custom;
  if (may_throw) w.start = w;
  try {
    StepReport report;
    const auto step = [&] {
      report = w.StepWhole(dt);
      w.FindEvents();
    };
    if (w.IsShared())
      w.pool->Together(std::cref(step));
    else
      step();
    w.vacant.insert(w.vacant.end(), w.leaving.begin(), w.leaving.end());
    if (!w.leaving.empty()) std::sort(w.vacant.begin(), w.vacant.end(), std::greater<>());
    w.leaving.clear();
    return report;
  } catch (const std::bad_alloc&) {
    if (may_throw) static_cast<WorldState&>(w) = w.start;
    w.rest.reset();
    w.lost = !may_throw;
    throw;
  } catch (...) {
    if (may_throw) static_cast<WorldState&>(w) = w.start;
    w.rest.reset();
    throw;
  }
}

}  // namespace islet
