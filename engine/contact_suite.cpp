#include "engine/contact_suite.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <stdexcept>
#include <string>
#include <tuple>

#include "engine/certified_freezing.h"
#include "engine/response.h"
#include "engine/sequential.h"
#include "engine/suite_frame.h"
#include "islands/freezing.h"
#include "islands/partition.h"
#include "parallel/schedule.h"
#include "parallel/worker_pool.h"

namespace islet {
namespace {

constexpr int kWakeRounds = 2;        // re-solves of islands into which frozen bodies woke, per frame; the last one wakes all that is joined
constexpr size_t kLocalCandidates = 200;  // larger sets of frozen bodies are balanced together with all joined to them
constexpr double kBatchCost = 64;     // contacts: smaller islands share a task

double Seconds() { return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count(); }

// Adds the time since the last lap to a stage.
class LapTimer {
 public:
  void Lap(double* stage) {
    const double now = Seconds();
    *stage += now - last_;
    last_ = now;
  }

 private:
  double last_ = Seconds();
};

void CheckContact(const Contact& c, size_t number, size_t num_bodies) {
  const auto reject = [&](const std::string& field, double value) {
    throw std::invalid_argument("contact " + std::to_string(number) + ": " + field + " = " + std::to_string(value));
  };
  if (c.body_a < 0 || c.body_a >= static_cast<int>(num_bodies)) reject("body_a", c.body_a);
  if (c.body_b <= c.body_a || c.body_b >= static_cast<int>(num_bodies)) reject("body_b", c.body_b);
  if (!c.point_W.allFinite()) reject("point", c.point_W.sum());
  if (!(std::abs(c.normal_W.norm() - 1) < 1e-6)) reject("length of normal", c.normal_W.norm());
  if (!(c.friction >= 0) || !std::isfinite(c.friction)) reject("friction", c.friction);
  if (!(c.restitution >= 0 && c.restitution <= 1)) reject("restitution", c.restitution);
}

bool SameContact(const Contact& x, const Contact& y) {
  return x.body_a == y.body_a && x.body_b == y.body_b && x.feature == y.feature;
}
bool Earlier(const Contact& x, const Contact& y) {
  return std::tie(x.body_a, x.body_b, x.feature) < std::tie(y.body_a, y.body_b, y.feature);
}

void Include(const ResponseOutcome& outcome, QpSummary* summary) {
  if (outcome.status == QpStatus::kNone) return;
  ++summary->solved;
  summary->failed += outcome.status == QpStatus::kInfeasible || outcome.status == QpStatus::kFailed;
  summary->inaccurate += outcome.status == QpStatus::kInaccurate;
  summary->coulomb_capped += outcome.coulomb_capped;
  summary->iterations += outcome.iterations;
  summary->iterations_max = std::max(summary->iterations_max, outcome.iterations);
  summary->rounds_max = std::max(summary->rounds_max, outcome.rounds);
  summary->seconds += outcome.seconds;
}

}  // namespace

struct ContactSuite::Impl {
  Settings settings;
  parallel::WorkerPool* pool;
  SuiteFrame frame;
  CertifiedFreezing certified;
  std::vector<int> freeze_counters;                       // kPaper

  std::vector<Contact> previous_contacts;
  std::vector<Vector3> previous_holding, impulses_W;
  double previous_dt = 0;
  std::vector<double> support;                            // [N s] per body

  // Partitions: numbers of contacts in a partition are places in `linked`.
  std::vector<std::uint8_t> cut;
  std::vector<std::pair<int, int>> pairs;
  std::vector<int> linked;
  std::vector<int> island_contacts;                       // partition.contacts in world numbers
  islands::Partition partition;
  std::vector<double> costs;
  parallel::Schedule schedule;

  struct Worker {
    SequentialResolver sequential;
    IslandResponder responder;
  };
  std::vector<Worker> workers;
  struct Outcome {
    ResponseOutcome collision, resting;
  };
  std::vector<Outcome> outcomes;                          // per island
  std::vector<int> bounce_counts, unbalanced, candidates, woken, caught;
  std::vector<std::uint8_t> chosen;                       // per island
  bool moves_for_sure = false;                            // a candidate got more than a trembling speed
  std::vector<std::uint8_t> was_frozen;                   // per body, at the start of the frame

  void Begin(double dt, std::span<Body> bodies, std::span<const Contact> contacts);
  void RecallHolding();
  template <typename LinkContact>
  void Partition(LinkContact link);
  template <typename Task>
  void ForEachIsland(Task task);
  IslandView View(int island) const;
  void CutAtImmovable();
  void Bounce(StepReport* report);
  void WakeByBounce();
  void ResolveIsland(int island, Worker* worker);
  void ResolveIslands(bool only_woken, StepReport* report, LapTimer* timer);
  bool CheckFrozen(bool all, StepReport* report);
  void AddJoinedFrozen();
  void BalanceCandidates(StepReport* report);
  void ReportIslands(StepReport* report) const;
  void Freeze(StepReport* report);
  void FreezeLikePaper();
  void SettleCaughtBodies();
  void Finish(StepReport* report);
};

ContactSuite::ContactSuite(const Settings& settings, parallel::WorkerPool* pool) : impl_(std::make_unique<Impl>()) {
  settings.Validate();
  impl_->settings = settings;
  impl_->pool = pool;
  impl_->workers.resize(pool->num_workers());
}
ContactSuite::~ContactSuite() = default;

void ContactSuite::SetGravity(const Vector3& gravity_W) {
  if (!gravity_W.allFinite()) throw std::invalid_argument("gravity is not finite");
  impl_->settings.gravity = gravity_W;
}
std::span<const Vector3> ContactSuite::impulses() const { return impl_->impulses_W; }
std::span<const double> ContactSuite::support() const { return impl_->support; }
std::span<const Twist> ContactSuite::velocities_before_gravity() const { return impl_->frame.before_gravity; }

void ContactSuite::Resolve(double dt, std::span<Body> bodies, std::span<const Contact> contacts, StepReport* report) {
  if (!(dt > 0) || !std::isfinite(dt)) throw std::invalid_argument("dt = " + std::to_string(dt) + " is not a positive time");
  for (size_t c = 0; c < contacts.size(); ++c) CheckContact(contacts[c], c, bodies.size());
  LapTimer timer;
  Impl& s = *impl_;
  s.Begin(dt, bodies, contacts);
  timer.Lap(&report->seconds.islands);
  s.Bounce(report);                                       // step 1
  s.WakeByBounce();
  timer.Lap(&report->seconds.pq);
  s.ResolveIslands(false, report, &timer);                // steps 2 and 3
  for (int round = 0; s.settings.freezing == Freezing::kCertified && s.CheckFrozen(round > 0, report); ++round) {
    timer.Lap(&report->seconds.freeze);
    if (round == kWakeRounds) {
      for (const int i : s.woken) s.certified.Disturb(i);
      break;
    }
    s.ResolveIslands(true, report, &timer);
  }
  s.Freeze(report);                                       // step 4
  s.Finish(report);
  timer.Lap(&report->seconds.freeze);
}

void ContactSuite::Impl::Begin(double dt, std::span<Body> bodies, std::span<const Contact> contacts) {
  frame.dt = dt;
  frame.gravity = settings.gravity;
  frame.rest_speed = settings.gravity.norm() * dt;
  frame.bodies = bodies;
  frame.frames.resize(contacts.size());
  double fastest = 0;
  for (size_t c = 0; c < contacts.size(); ++c) {
    frame.frames[c] = ContactFrame(contacts[c].normal_W);
    if (!contacts[c].touches) continue;
    fastest = std::max(fastest, -NormalVelocity(contacts[c], bodies[contacts[c].body_a], bodies[contacts[c].body_b]));
  }
  frame.speed_floor = std::max({frame.rest_speed, 1e-3 * fastest, 1e-12});
  frame.threshold = 10 * settings.tolerance * frame.speed_floor;
  frame.contacts = {contacts, frame.frames};
  for (auto* impulses : {&frame.bounces, &frame.collisions, &frame.holding}) impulses->assign(contacts.size(), Vector3::Zero());
  if (settings.freezing == Freezing::kCertified) certified.TrackTravel(bodies, dt, settings);
  freeze_counters.resize(bodies.size(), 0);
  was_frozen.resize(bodies.size());
  for (size_t i = 0; i < bodies.size(); ++i) was_frozen[i] = bodies[i].frozen;
  RecallHolding();
}

// Contacts at which nothing moves keep the impulses that held in the frame before, per second.
void ContactSuite::Impl::RecallHolding() {
  if (previous_dt == 0) return;
  size_t p = 0;
  for (size_t c = 0; c < frame.holding.size(); ++c) {
    const Contact& contact = frame.contacts.contacts[c];
    while (p < previous_contacts.size() && Earlier(previous_contacts[p], contact)) ++p;
    if (p == previous_contacts.size()) return;
    if (!SameContact(previous_contacts[p], contact)) continue;
    if (StandsStill(frame.bodies[contact.body_a]) && StandsStill(frame.bodies[contact.body_b]))
      frame.holding[c] = previous_holding[p] * (frame.dt / previous_dt);
    ++p;
  }
}

// Islands of the bodies that are not cut, joined by the contacts for which link(contact) holds.
template <typename LinkContact>
void ContactSuite::Impl::Partition(LinkContact link) {
  pairs.clear();
  linked.clear();
  for (size_t c = 0; c < frame.contacts.contacts.size(); ++c) {
    const Contact& contact = frame.contacts.contacts[c];
    if (!link(contact)) continue;
    pairs.emplace_back(contact.body_a, contact.body_b);
    linked.push_back(static_cast<int>(c));
  }
  islands::BuildPartition({cut, pairs}, &partition);
  island_contacts.resize(partition.contacts.size());
  for (size_t i = 0; i < island_contacts.size(); ++i) island_contacts[i] = linked[partition.contacts[i]];
}

IslandView ContactSuite::Impl::View(int island) const {
  const int first = partition.contact_start[island], last = partition.contact_start[island + 1];
  return {partition.bodies_of(island), std::span<const int>(island_contacts).subspan(first, last - first)};
}

template <typename Task>
void ContactSuite::Impl::ForEachIsland(Task task) {
  costs.resize(partition.num_islands());
  for (int i = 0; i < partition.num_islands(); ++i) costs[i] = 1.0 + static_cast<double>(View(i).contacts.size());
  parallel::MakeSchedule(costs, kBatchCost, &schedule);
  pool->ForEach(schedule.num_batches(), [&](int batch, int worker) {
    for (const int island : schedule.batch(batch)) task(island, &workers[worker]);
  });
}

void ContactSuite::Impl::CutAtImmovable() {
  cut.resize(frame.bodies.size());
  for (size_t i = 0; i < cut.size(); ++i) cut[i] = !frame.bodies[i].Moves();
}

// Step 1 on groups cut at fixed and kinematic bodies only, so that a bounce can travel through frozen ones.
void ContactSuite::Impl::Bounce(StepReport* report) {
  cut.resize(frame.bodies.size());
  for (size_t i = 0; i < cut.size(); ++i) cut[i] = frame.bodies[i].kind != BodyKind::kDynamic || frame.bodies[i].removed;
  Partition([](const Contact& c) { return c.touches; });
  bounce_counts.assign(partition.num_islands(), 0);
  ForEachIsland([this](int island, Worker* worker) {
    const IslandView view = View(island);
    bounce_counts[island] = worker->sequential.Resolve(view.bodies, view.contacts, frame.contacts, settings, frame.threshold,
                                                       frame.bodies, frame.bounces);
  });
  for (const int count : bounce_counts) report->bounces += count;
}

// A frozen body that bounced away wakes; one that only trembled is put back, and what it got counts as load.
void ContactSuite::Impl::WakeByBounce() {
  frame.after_bounces.resize(frame.bodies.size());
  for (size_t i = 0; i < frame.bodies.size(); ++i) {
    Body& body = frame.bodies[i];
    frame.after_bounces[i] = TwistOf(body);
    if (!body.frozen) continue;
    const bool wakes = settings.freezing == Freezing::kPaper
                           ? body.KineticEnergy() > 0.5 * body.mass * frame.rest_speed * frame.rest_speed  // [SM04 Eq. 15]
                           : FastestPoint(TwistOf(body), body.radius) > certified.StillSpeed(body, settings);
    if (wakes) {
      body.frozen = false;
      freeze_counters[i] = 0;
    } else {
      SetTwist({}, &body);
    }
  }
}

void ContactSuite::Impl::ResolveIsland(int island, Worker* worker) {
  const IslandView view = View(island);
  for (const int i : view.bodies) SetTwist(frame.after_bounces[i], &frame.bodies[i]);
  Outcome& outcome = outcomes[island];
  outcome.collision = worker->responder.ResolveCollisions(view, frame.contacts, settings, frame.speed_floor, frame.threshold,
                                                          frame.bodies, frame.collisions);
  for (const int i : view.bodies) {
    Body& body = frame.bodies[i];
    frame.before_gravity[i] = TwistOf(body);
    body.linear_velocity_W += frame.dt * (frame.gravity + body.force_W / body.mass);
    if (!body.torque_W.isZero(0)) body.angular_velocity_W += frame.dt * (body.InverseInertiaW() * body.torque_W);
  }
  outcome.resting = worker->responder.ResolveStatic(view, frame.contacts, settings, frame.speed_floor, frame.dt, frame.bodies,
                                                      frame.holding);
}

// only_woken: just the islands that a woken body joined; the others keep what they have.
void ContactSuite::Impl::ResolveIslands(bool only_woken, StepReport* report, LapTimer* timer) {
  if (!only_woken) frame.before_gravity.assign(frame.bodies.size(), {});
  CutAtImmovable();
  Partition([this](const Contact& c) { return frame.bodies[c.body_a].Moves() || frame.bodies[c.body_b].Moves(); });
  outcomes.assign(partition.num_islands(), {});
  chosen.assign(partition.num_islands(), !only_woken);
  if (only_woken)
    for (const int body : woken) chosen[partition.body_to_island[body]] = 1;
  timer->Lap(&report->seconds.islands);
  ForEachIsland([this](int island, Worker* worker) {
    if (chosen[island]) ResolveIsland(island, worker);
  });
  for (const Outcome& outcome : outcomes) {
    Include(outcome.collision, &report->collision_qp);
    Include(outcome.resting, &report->static_qp);
    report->restitution_lowered += outcome.collision.restitution_lowered;
    report->certificate.Include(outcome.collision.certificate);
    report->certificate.Include(outcome.resting.certificate);
  }
  // Both problems of an island run in one task: the stage's wall time is shared out by the time spent in each.
  double stage = 0;
  timer->Lap(&stage);
  double collision = 0, resting = 0;
  for (const Outcome& outcome : outcomes) collision += outcome.collision.seconds, resting += outcome.resting.seconds;
  const double share = collision + resting > 0 ? collision / (collision + resting) : 0;
  report->seconds.collision_qp += share * stage;
  report->seconds.static_qp += (1 - share) * stage;
  if (!only_woken) ReportIslands(report);
}

void ContactSuite::Impl::ReportIslands(StepReport* report) const {
  for (int i = 0; i < partition.num_islands(); ++i) {
    const IslandView view = View(i);
    if (view.contacts.empty()) continue;
    const Outcome& outcome = outcomes[i];
    IslandReport island;
    island.first_body = view.bodies[0];
    island.bodies = static_cast<int>(view.bodies.size());
    island.contacts = static_cast<int>(view.contacts.size());
    island.collision_status = outcome.collision.status;
    island.static_status = outcome.resting.status;
    island.collision_iterations = outcome.collision.iterations;
    island.static_iterations = outcome.resting.iterations;
    island.certificate = outcome.collision.certificate;
    island.certificate.Include(outcome.resting.certificate);
    report->largest_island_contacts = std::max(report->largest_island_contacts, island.contacts);
    report->active_contacts += island.contacts;
    report->islands.push_back(island);
  }
}

// Certified freezing: are the frozen bodies still held? Holding the unbalanced ones again may disturb their neighbours, so
// the set grows until nothing is disturbed: first by those alone, then by all that are joined to them, and only what that
// cannot hold either is suspected to move. `all`: whatever is joined to a suspect is suspected too. True if any is.
bool ContactSuite::Impl::CheckFrozen(bool all, StepReport* report) {
  candidates.clear();
  woken.clear();
  bool joined = false;
  while (true) {
    certified.FindUnbalanced(frame, &unbalanced);
    const size_t before = candidates.size();
    candidates.insert(candidates.end(), unbalanced.begin(), unbalanced.end());
    std::sort(candidates.begin(), candidates.end());
    candidates.erase(std::unique(candidates.begin(), candidates.end()), candidates.end());
    if (candidates.size() == before && woken.empty()) return false;
    if (joined) break;
    joined = candidates.size() == before || candidates.size() > kLocalCandidates;
    if (joined) AddJoinedFrozen();
    woken.clear();
    BalanceCandidates(report);
    if (moves_for_sure) break;
  }
  if (woken.empty()) return false;
  if (all) {
    candidates = woken;
    AddJoinedFrozen();
    woken = candidates;
  }
  // Suspects only: with its neighbours as walls a body can be squeezed in ways that the joint problem would not. They join
  // the bodies that move, and freeze again at the end of the frame if the joint problem leaves them at rest.
  for (const int i : woken) frame.bodies[i].frozen = false;
  return true;
}

// All frozen bodies that contacts join to a candidate through frozen bodies.
void ContactSuite::Impl::AddJoinedFrozen() {
  cut.resize(frame.bodies.size());
  for (size_t i = 0; i < cut.size(); ++i) cut[i] = !frame.bodies[i].frozen;
  Partition([this](const Contact& c) { return !cut[c.body_a] && !cut[c.body_b]; });
  chosen.assign(partition.num_islands(), 0);
  for (const int i : candidates) chosen[partition.body_to_island[i]] = 1;
  candidates.clear();
  for (int island = 0; island < partition.num_islands(); ++island) {
    const std::span<const int> members = partition.bodies_of(island);
    if (chosen[island]) candidates.insert(candidates.end(), members.begin(), members.end());
  }
  std::sort(candidates.begin(), candidates.end());
}

// The static problem of the candidates alone: bodies that move load them, everything else that stands still holds them. The
// question is whether they stay at rest, and at rest the convex model is exact: nothing slides.
void ContactSuite::Impl::BalanceCandidates(StepReport* report) {
  cut.assign(frame.bodies.size(), 1);
  for (const int i : candidates) {
    cut[i] = 0;
    SetTwist(certified.LoadedVelocity(frame, i), &frame.bodies[i]);
  }
  Partition([this](const Contact& c) {
    return (!cut[c.body_a] || !cut[c.body_b]) && !frame.bodies[c.body_a].Moves() && !frame.bodies[c.body_b].Moves();
  });
  Settings at_rest = settings;
  at_rest.model = Model::kConvex;
  outcomes.assign(partition.num_islands(), {});
  ForEachIsland([&](int island, Worker* worker) {
    const IslandView view = View(island);
    double limit = INFINITY;
    for (const int i : view.bodies) limit = std::min(limit, certified.WakeSpeed(frame, frame.bodies[i], settings));
    outcomes[island].resting = worker->responder.ResolveHolding(view, frame.contacts, at_rest, frame.speed_floor, 0.1 * limit,
                                                                frame.dt, frame.bodies, frame.holding);
  });
  moves_for_sure = false;
  for (const int i : candidates) {
    Body& body = frame.bodies[i];
    const double speed = FastestPoint(TwistOf(body), body.radius);
    if (speed > certified.WakeSpeed(frame, body, settings)) woken.push_back(i);
    moves_for_sure = moves_for_sure || speed > certified.StillSpeed(body, settings);
    SetTwist({}, &body);
  }
  for (const Outcome& outcome : outcomes) Include(outcome.resting, &report->static_qp);
}

void ContactSuite::Impl::Freeze(StepReport* report) {
  if (settings.freezing == Freezing::kCertified) {
    certified.Freeze(frame, settings);
    certified.FindUnbalanced(frame, &unbalanced);         // by what the last round changed
    for (const int i : unbalanced) {
      frame.bodies[i].frozen = false;
      certified.Disturb(i);
    }
  }
  if (settings.freezing == Freezing::kPaper) FreezeLikePaper();
  for (size_t i = 0; i < frame.bodies.size(); ++i) {
    report->newly_frozen += frame.bodies[i].frozen && !was_frozen[i];
    report->woken += !frame.bodies[i].frozen && was_frozen[i];
  }
}

void ContactSuite::Impl::FreezeLikePaper() {
  const size_t n = frame.bodies.size();
  std::vector<double> energy(n), threshold(n);
  std::vector<std::uint8_t> touches(n, 0), may(n, 0), frozen(n, 0);
  for (size_t i = 0; i < n; ++i) {
    const Body& body = frame.bodies[i];
    energy[i] = body.KineticEnergy();
    threshold[i] = 0.5 * body.mass * frame.rest_speed * frame.rest_speed;
    frozen[i] = body.frozen;
    const auto inside = [&](const Region& r) {
      return (body.position_W.array() >= r.lower.array()).all() && (body.position_W.array() <= r.upper.array()).all();
    };
    may[i] = body.Moves() && (settings.cold_volumes.empty() || std::any_of(settings.cold_volumes.begin(), settings.cold_volumes.end(), inside));
  }
  for (const Contact& c : frame.contacts.contacts) {
    const auto stands = [&](int i) { return frozen[i] || frame.bodies[i].kind == BodyKind::kFixed; };
    touches[c.body_a] |= stands(c.body_b);
    touches[c.body_b] |= stands(c.body_a);
  }
  islands::UpdateFreezing({energy, threshold, touches, may}, settings.freeze_count, freeze_counters, frozen);
  for (size_t i = 0; i < n; ++i) {
    if (!frozen[i]) continue;
    frame.bodies[i].frozen = true;
    SetTwist({}, &frame.bodies[i]);
  }
}

// The trapezoidal rule lets a contact do the work j . (u0 + u1) / 2. Where a body bounced off and gravity brought it back
// within the step that would be positive: the body would rise on energy it does not have. Such bodies move with their final
// velocity alone, and so do those that close a gap by this step's end: their final velocity is what was chosen for that.
void ContactSuite::Impl::SettleCaughtBodies() {
  caught.clear();
  for (size_t c = 0; c < frame.contacts.contacts.size(); ++c) {
    const Contact& contact = frame.contacts.contacts[c];
    if (!(frame.holding[c][0] > 0)) continue;
    const auto velocity = [&](int i) -> Vector3 {
      const Twist& twist = frame.bodies[i].Moves() ? frame.before_gravity[i] : TwistOf(frame.bodies[i]);
      return twist.linear_W + twist.angular_W.cross(contact.point_W - frame.bodies[i].position_W);
    };
    if (contact.touches && contact.normal_W.dot(velocity(contact.body_b) - velocity(contact.body_a)) <= frame.threshold) continue;
    caught.push_back(contact.body_a);
    caught.push_back(contact.body_b);
  }
  for (const int i : caught) frame.before_gravity[i] = TwistOf(frame.bodies[i]);
}

void ContactSuite::Impl::Finish(StepReport* report) {
  SettleCaughtBodies();
  const size_t nc = frame.contacts.contacts.size();
  for (const Contact& c : frame.contacts.contacts) report->contacts += c.touches;
  impulses_W.resize(nc);
  for (size_t c = 0; c < nc; ++c) impulses_W[c] = frame.frames[c] * (frame.bounces[c] + frame.collisions[c] + frame.holding[c]);
  previous_contacts.assign(frame.contacts.contacts.begin(), frame.contacts.contacts.end());
  previous_holding = frame.holding;
  previous_dt = frame.dt;
  support.assign(frame.bodies.size(), 0.0);
  for (size_t c = 0; c < nc; ++c) {
    support[frame.contacts.contacts[c].body_a] += frame.holding[c][0];
    support[frame.contacts.contacts[c].body_b] += frame.holding[c][0];
  }
  for (const Body& body : frame.bodies) {
    if (body.kind != BodyKind::kDynamic || body.removed) continue;
    (body.frozen ? report->frozen : report->awake) += 1;
    report->kinetic_energy += body.KineticEnergy();
  }
  if (settings.freezing == Freezing::kCertified && report->frozen > 0) report->frozen_imbalance = certified.WorstImbalance(frame);
}

}  // namespace islet
