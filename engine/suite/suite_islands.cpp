#include <algorithm>

#include "engine/suite/contact_suite_impl.h"

namespace islet {
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

// Step 1 on groups cut at fixed and kinematic bodies only, so that a bounce can travel through frozen ones.
void ContactSuite::Impl::Bounce(StepReport* report) {
  cut.resize(frame.bodies.size());
  for (size_t i = 0; i < cut.size(); ++i)
    cut[i] = frame.bodies[i].kind != BodyKind::kDynamic || frame.bodies[i].removed;
  Partition([](const Contact& c) { return c.touches; });
  bounce_counts.assign(partition.num_islands(), 0);
  ForEachIsland([this](int island, Worker* worker) {
    const IslandView view = View(island);
    if (!Approaches(view)) return;
    bounce_counts[island] =
        worker->sequential.Resolve(view.bodies, view.contacts, frame.contacts, settings.bounce_law,
                                   {frame.threshold, settings.bounce_limit}, frame.bodies, frame.bounces);
  });
  for (const int count : bounce_counts) report->bounces += count;
}

// By the paper's freezing a frozen body that bounced away wakes [SM04 Eq. 15]; one that only trembled is put back.
void ContactSuite::Impl::WakeByBounce() {
  for (size_t i = 0; i < frame.bodies.size(); ++i) {
    Body& body = frame.bodies[i];
    if (!body.frozen) continue;
    if (body.KineticEnergy() > 0.5 * body.mass * frame.rest_speed * frame.rest_speed) {
      body.frozen = false;
      freeze_counters[i] = 0;
    } else {
      SetTwist({}, &body);
    }
  }
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
  outcome.collision = worker->responder.ResolveCollisions(view, frame.contacts, settings, frame.speed_floor,
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
  const double error =
      std::max(outcome.collision.certificate.natural_map_max, outcome.resting.certificate.natural_map_max);
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
    IslandReport island{.first_body = view.bodies[0],
                        .bodies = static_cast<int>(view.bodies.size()),
                        .contacts = static_cast<int>(view.contacts.size())};
    outcomes[i].collision.AddTo(Stage::kCollision, &island);
    outcomes[i].resting.AddTo(Stage::kStatic, &island);
    report->Add(island);
  }
}

}  // namespace islet
