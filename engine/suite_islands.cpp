#include <algorithm>

#include "engine/contact_suite_impl.h"

namespace islet {
namespace {

constexpr size_t kMergedBodies = 5;  // smaller islands cost microseconds: nothing to save
constexpr double kParallel = 1e-10;  // of normals along one line
// Blows in heaps bounce until the rest is slight, where they are few: a bounce takes 2 to 3 us, a collision problem of 5,000
// contacts 80 ms on two cores.
constexpr int kHeapContacts = 150;  // of bodies that move
constexpr double kFewBlows = 0.05;  // of them
constexpr int kHeapBounces = 2;     // for each of them

}  // namespace

IslandView ContactSuite::Impl::View(int island) const {
  const int first = partition.contact_start[island], last = partition.contact_start[island + 1];
  return {partition.bodies_of(island), std::span<const int>(island_contacts).subspan(first, last - first)};
}

void ContactSuite::Impl::CutAtImmovable() {
  cut.resize(frame.bodies.size());
  for (size_t i = 0; i < cut.size(); ++i) cut[i] = !frame.bodies[i].Moves();
}

bool ContactSuite::Impl::Approaches(const IslandView& view) const {
  return std::any_of(view.contacts.begin(), view.contacts.end(), [this](int number) {
    const Contact& contact = frame.contacts.contacts[number];
    return contact.touches &&
           -NormalVelocity(contact, frame.bodies[contact.body_a], frame.bodies[contact.body_b]) > frame.threshold;
  });
}

// Bodies on each other along one line. As a column they cost microseconds twice, too, and nothing is lost.
bool ContactSuite::Impl::IsLine(const IslandView& view, Worker* worker) const {
  const Vector3& first = frame.contacts.contacts[view.contacts[0]].normal_W;
  worker->neighbours.assign(view.bodies.size(), {kNobody, kNobody});
  const auto meets = [&](int body, int other) {
    if (!frame.bodies[body].Moves()) return true;
    const int neighbour = frame.bodies[other].Moves() ? other : kWall;
    const auto place = std::lower_bound(view.bodies.begin(), view.bodies.end(), body) - view.bodies.begin();
    for (int& known : worker->neighbours[place]) {
      if (known == kNobody) known = neighbour;
      if (known == neighbour) return true;
    }
    return false;
  };
  return std::all_of(view.contacts.begin(), view.contacts.end(), [&](int number) {
    const Contact& contact = frame.contacts.contacts[number];
    return first.cross(contact.normal_W).norm() <= kParallel && meets(contact.body_a, contact.body_b) &&
           meets(contact.body_b, contact.body_a);
  });
}

// Whether slight approaches of the island may go to the static problem. (The paper's laws of bouncing resolve every collision.
// Bodies that only touch each other fly: nothing presses them together, and their momenta are to stay.)
bool ContactSuite::Impl::MayMerge(const IslandView& view) const {
  return settings.ladder.Has(qp::Rung::kMerged) && settings.bounce_law == BounceLaw::kExact &&
         view.bodies.size() >= kMergedBodies &&
         std::any_of(view.contacts.begin(), view.contacts.end(), [this](int number) {
           const Contact& contact = frame.contacts.contacts[number];
           return contact.touches && (!frame.bodies[contact.body_a].Moves() || !frame.bodies[contact.body_b].Moves());
         });
}

// [m/s] approaches that may go to the static problem. A moving wall's on a frozen body may not: no problem would take it along.
double ContactSuite::Impl::LeftUpTo(const Contact& contact) const {
  const Body &a = frame.bodies[contact.body_a], &b = frame.bodies[contact.body_b];
  const bool driven = a.kind == BodyKind::kKinematic || b.kind == BodyKind::kKinematic;
  return driven && !a.Moves() && !b.Moves() ? 0 : SlightApproach(contact, frame.gravity, frame.dt);
}

// Something approaches, and all that does is slight.
bool ContactSuite::Impl::CollidesSlightly(const IslandView& view, Worker* worker) const {
  if (!MayMerge(view)) return false;
  bool approaches = false;
  for (const int number : view.contacts) {
    const Contact& contact = frame.contacts.contacts[number];
    if (!contact.touches) continue;
    const double speed = -NormalVelocity(contact, frame.bodies[contact.body_a], frame.bodies[contact.body_b]);
    if (speed <= frame.threshold) continue;
    if (speed > LeftUpTo(contact)) return false;
    approaches = true;
  }
  return approaches && !(settings.ladder.Has(qp::Rung::kColumn) && IsLine(view, worker));
}

// In big heaps with few blows those bounce, more often than elsewhere, until what is left is slight. Not where the usual limit lets
// elastic blows go farther. (By the paper's freezing a body that is put back to rest would keep what it got to itself.)
BounceRule ContactSuite::Impl::RuleOf(const IslandView& view, Worker* worker) const {
  const BounceRule usual{frame.threshold, {}, settings.bounce_limit};
  if (settings.bounce_limit != kAutoBounceLimit || settings.freezing == Freezing::kPaper || !MayMerge(view))
    return usual;
  worker->slight.clear();
  int moving = 0, blows = 0;
  double restitution = 0;
  for (const int number : view.contacts) {
    const Contact& contact = frame.contacts.contacts[number];
    worker->slight.push_back(LeftUpTo(contact));
    moving += frame.bodies[contact.body_a].Moves() || frame.bodies[contact.body_b].Moves();
    blows += approach_speeds[number] > std::max(frame.threshold, worker->slight.back());
    restitution = std::max(restitution, contact.restitution);
  }
  const auto bodies = static_cast<int>(view.bodies.size()), contacts = static_cast<int>(view.contacts.size());
  const int heap = kHeapBounces * moving;
  if (moving < kHeapContacts || blows > kFewBlows * moving ||
      BounceLimit(kAutoBounceLimit, bodies, contacts) >= heap * BounceCost(restitution, bodies) ||
      (settings.ladder.Has(qp::Rung::kColumn) && IsLine(view, worker)))
    return usual;
  return {frame.threshold, worker->slight, heap};
}

// Step 1 on groups cut at fixed and kinematic bodies only, so that a bounce can travel through frozen ones.
void ContactSuite::Impl::Bounce(StepReport* report) {
  cut.resize(frame.bodies.size());
  for (size_t i = 0; i < cut.size(); ++i)
    cut[i] = frame.bodies[i].kind != BodyKind::kDynamic || frame.bodies[i].removed;
  Partition([](const Contact& c) { return c.touches; });
  bounce_counts.assign(partition.num_islands(), 0);
  ForEachIsland([this](int island, Worker* worker) {
    const IslandView view = View(island);
    if (!Approaches(view) || CollidesSlightly(view, worker)) return;
    bounce_counts[island] = worker->sequential.Resolve(view.bodies, view.contacts, frame.contacts, settings.bounce_law,
                                                       RuleOf(view, worker), frame.bodies, frame.bounces);
  });
  for (const int count : bounce_counts) report->bounces += count;
}

// By the paper's freezing a frozen body that bounced away wakes [SM04 Eq. 15]; one that only trembled is put back.
void ContactSuite::Impl::WakeByBounce() {
  frame.after_bounces.resize(frame.bodies.size());
  for (size_t i = 0; i < frame.bodies.size(); ++i) {
    Body& body = frame.bodies[i];
    frame.after_bounces[i] = TwistOf(body);
    if (!body.frozen) continue;
    if (body.KineticEnergy() > 0.5 * body.mass * frame.rest_speed * frame.rest_speed) {
      body.frozen = false;
      freeze_counters[i] = 0;
    } else {
      SetTwist({}, &body);
    }
  }
}

// Takes the place of a collision problem: no impulses, and what an earlier pass of the frame found is gone.
ResponseOutcome ContactSuite::Impl::LeaveToStatic(const IslandView& view) {
  ResponseOutcome outcome;
  outcome.rung = qp::Rung::kMerged;
  for (const int number : view.contacts) {
    outcome.contacts += frame.contacts.contacts[number].touches;
    frame.collisions[number].setZero();
  }
  return outcome;
}

// What the static problem may hold, once blows have passed. An open contact that a blow has set going is left to the motion, to
// bounce when it touches: its load would brake it to gap / dt, and all of its energy would be gone.
IslandView ContactSuite::Impl::HeldView(const IslandView& view, Worker* worker) {
  const auto bounces = [this](int number) {
    const Contact& contact = frame.contacts.contacts[number];
    if (contact.touches) return false;
    const double approach = -NormalVelocity(contact, frame.bodies[contact.body_a], frame.bodies[contact.body_b]);
    return approach > frame.threshold && OutlastsStep(contact, approach, frame.rest_speed);
  };
  worker->held.clear();
  for (const int number : view.contacts) {
    if (bounces(number)) {
      frame.holding[number].setZero();
    } else {
      worker->held.push_back(number);
    }
  }
  return {view.bodies, worker->held};
}

void ContactSuite::Impl::ResolveIsland(int island, Worker* worker) {
  const IslandView view = View(island);
  Outcome& outcome = outcomes[island];
  for (const int i : view.bodies) SetTwist(frame.after_bounces[i], &frame.bodies[i]);
  outcome.collision = CollidesSlightly(view, worker)
                          ? LeaveToStatic(view)
                          : worker->responder.ResolveCollisions(view, frame.contacts, settings, frame.speed_floor,
                                                                frame.threshold, frame.bodies, frame.collisions);
  if (observer) Record(island, Stage::kCollision, outcome.collision.status, worker->responder);
  const IslandView held = HeldView(view, worker);
  for (const int i : view.bodies) {
    Body& body = frame.bodies[i];
    frame.before_gravity[i] = TwistOf(body);
    const Twist change = ChangeByForces(frame.dt, frame.gravity, body);
    SetTwist({body.linear_velocity_W + change.linear_W, body.angular_velocity_W + change.angular_W}, &body);
  }
  outcome.resting = worker->responder.ResolveStatic(held, frame.contacts, settings, frame.speed_floor, frame.dt,
                                                    frame.bodies, frame.holding);
  if (observer) Record(island, Stage::kStatic, outcome.resting.status, worker->responder);
  const double error = std::max(outcome.collision.certificate.natural_map_max, outcome.resting.certificate.natural_map_max);
  for (const int i : view.bodies) errors[i] = error;
}

void ContactSuite::Impl::Record(int island, Stage stage, QpStatus status, const IslandResponder& responder) {
  if (status == QpStatus::kNone) return;
  records[island].push_back({0, island, stage, status, responder.problem(), responder.solution()});
}

void ContactSuite::Impl::ResolveIslands(StepReport* report, LapTimer* timer) {
  frame.before_gravity.assign(frame.bodies.size(), {});
  errors.assign(frame.bodies.size(), 0.0);
  CutAtImmovable();
  Partition([this](const Contact& c) { return frame.bodies[c.body_a].Moves() || frame.bodies[c.body_b].Moves(); });
  outcomes.assign(partition.num_islands(), {});
  if (observer) records.assign(partition.num_islands(), {});
  timer->Lap(&report->seconds.islands);
  ForEachIsland([this](int island, Worker* worker) { ResolveIsland(island, worker); });
  if (observer)
    for (const auto& solved : records)
      for (const ProblemRecord& record : solved) observer(record);
  for (const Outcome& outcome : outcomes) {
    outcome.collision.AddTo(&report->collision_qp, &report->ladder);
    outcome.resting.AddTo(&report->static_qp, &report->ladder);
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
  ReportIslands(report);
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
    island.map = std::max(outcome.collision.map, outcome.resting.map);
    island.certificate = outcome.collision.certificate;
    island.certificate.Include(outcome.resting.certificate);
    report->islands.push_back(island);
  }
  std::sort(report->islands.begin(), report->islands.end(),
            [](const IslandReport& x, const IslandReport& y) { return x.first_body < y.first_body; });
  report->largest_island_contacts = report->active_contacts = 0;
  for (const IslandReport& island : report->islands) {
    report->largest_island_contacts = std::max(report->largest_island_contacts, island.contacts);
    report->active_contacts += island.contacts;
  }
}

}  // namespace islet
