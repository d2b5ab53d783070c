#include "engine/flight_time.h"

#include <algorithm>

#include "engine/rebound.h"
#include "engine/suite_frame.h"
#include "engine/suite_memory.h"
#include "islands/disjoint_sets.h"

namespace islet {
namespace {

// Steps without a push, or one after a rebound: a ball that rolls over a crest is without one for a step, too.
constexpr int kInFlight = 2;
constexpr double kMeets = 1e-2;  // of the overlap tolerance: contacts that are open by less have met

}  // namespace

void FlightMemory::AddBody() {
  unflown.push_back(0);
  flew.push_back(0);
  walls.emplace_back();
}

void FlightMemory::Forget(int body) {
  unflown[body] = 0;
  flew[body] = 0;
}

bool FlightTime::Meets(const Contact& c) const {
  return c.gap <= kMeets * std::min(tolerances_[c.body_a], tolerances_[c.body_b]);
}

void FlightTime::BeginStep(std::span<const Body> bodies, std::span<const double> tolerances,
                           std::span<const Contact> near_contacts, const FlightMemory& memory) {
  tolerances_ = tolerances;
  in_flight_.resize(bodies.size());
  for (size_t i = 0; i < bodies.size(); ++i) in_flight_[i] = exact_ && bodies[i].Moves() && memory.flew[i] >= kInFlight;
  for (const Contact& c : near_contacts)
    if (Meets(c)) in_flight_[c.body_a] = in_flight_[c.body_b] = 0;
}

void FlightTime::ChooseDurations(double dt, const Vector3& gravity_W, const SuiteMemory& suite,
                                 const FlightMemory& memory, std::span<Body> bodies, std::span<Contact> resolved) {
  if (exact_) SetRebounds(gravity_W.norm() * dt, bodies, suite.previous_contacts, suite.previous_holding, resolved);
  rebounded_.assign(bodies.size(), 0);
  for (const Contact& c : resolved)
    if (c.rebounds) rebounded_[c.body_a] = rebounded_[c.body_b] = 1;
  durations_.assign(bodies.size(), dt);
  for (size_t i = 0; i < bodies.size(); ++i) durations_[i] += bodies[i].Moves() ? memory.unflown[i] : 0;
  loads_.clear();
  gained_.clear();
  for (size_t i = 0; i < bodies.size(); ++i) {
    if (durations_[i] == dt) continue;
    Body& body = bodies[i];
    loads_.push_back({static_cast<int>(i), body.force_W, body.torque_W});
    const double share = durations_[i] / dt;
    const Vector3 more_W = (share - 1) * (body.force_W + body.mass * gravity_W) * dt;  // [N s]
    const Contact& wall = memory.walls[i];
    gained_.push_back({wall, wall.body_b == static_cast<int>(i) ? more_W : Vector3(-more_W)});
    body.force_W = share * body.force_W + (share - 1) * body.mass * gravity_W;
    body.torque_W *= share;
  }
}

MotionPlan FlightTime::PlanMotion(double dt, const Vector3& gravity_W, const ContactSuite& suite,
                                  std::span<const Contact> resolved, std::span<Body> bodies) {
  const std::span<const Vector3> holding = suite.memory().previous_holding;  // of this step, by now
  FindPushes(dt, gravity_W, resolved, holding, bodies);
  before_.assign(suite.velocities_before_gravity().begin(), suite.velocities_before_gravity().end());
  bounced_.Restore(dt, gravity_W, bodies, resolved, holding, &before_);
  FindWhatIsInTheAir(resolved, bodies);
  // A solver's rounding is no push, but enough for the suite to take a body for caught.
  for (const Contact& contact : resolved)
    for (const int i : {contact.body_a, contact.body_b})
      if (flies_[i] && bodies[i].Moves()) before_[i] = BeforeForces(dt, gravity_W, bodies[i]);
  // Where no force acts during the step, impulses are those of its beginning: to move on with half of them would leave the
  // angular momentum behind.
  for (size_t i = 0; i < bodies.size() && gravity_W.isZero(0); ++i)
    if (bodies[i].force_W.isZero(0) && bodies[i].torque_W.isZero(0)) before_[i] = TwistOf(bodies[i]);
  for (const Load& load : loads_) {
    bodies[load.body].force_W = load.force_W;
    bodies[load.body].torque_W = load.torque_W;
  }
  return {dt, durations_, flies_, in_the_air_, before_};
}

// By the static impulses of this step.
void FlightTime::FindPushes(double dt, const Vector3& gravity_W, std::span<const Contact> resolved,
                            std::span<const Vector3> holding, std::span<const Body> bodies) {
  rounding_.resize(bodies.size());
  for (size_t i = 0; i < bodies.size(); ++i) rounding_[i] = RoundingOf(gravity_W, dt, bodies[i]);
  flies_.assign(bodies.size(), exact_);
  pushes_.resize(resolved.size());
  for (size_t c = 0; c < resolved.size(); ++c) {
    const double impulse = holding[c].norm();
    pushes_[c] = 0;
    for (const int i : {resolved[c].body_a, resolved[c].body_b}) {
      if (!(impulse > rounding_[i])) continue;
      flies_[i] = 0;
      pushes_[c] |= bodies[i].Moves();
    }
  }
}

// Supported is what contacts that push join to something immovable. Two that push each other in the air are both in it.
void FlightTime::FindWhatIsInTheAir(std::span<const Contact> resolved, std::span<const Body> bodies) {
  in_the_air_.assign(bodies.size(), exact_);
  if (!exact_) return;
  roots_.resize(bodies.size());
  islands::DisjointSets joined(roots_);
  for (size_t c = 0; c < resolved.size(); ++c) {
    const int a = resolved[c].body_a, b = resolved[c].body_b;
    if (bodies[a].Moves() && bodies[b].Moves() && pushes_[c]) joined.Union(a, b);
  }
  for (size_t c = 0; c < resolved.size(); ++c) {
    const int a = resolved[c].body_a, b = resolved[c].body_b;
    if (bodies[a].Moves() == bodies[b].Moves() || !pushes_[c]) continue;
    in_the_air_[joined.Find(bodies[a].Moves() ? a : b)] = 0;
  }
  // All members first: who bounces is in the air alone, also where the others are known by its number.
  for (size_t i = 0; i < bodies.size(); ++i) in_the_air_[i] = in_the_air_[joined.Find(static_cast<int>(i))];
  for (size_t i = 0; i < bodies.size(); ++i) in_the_air_[i] |= bounced_.Bounced(static_cast<int>(i));
}

void FlightTime::ReportImpulses(const Mover& mover, std::span<const Body> bodies, std::vector<Contact>* contacts,
                                std::vector<Vector3>* impulses) const {
  // Taken from what the wall gave in the bounce, where that is in the list.
  for (const Attributed& gained : gained_) {
    const auto same = [&](const Contact& c) {
      return c.body_a == gained.contact.body_a && c.body_b == gained.contact.body_b;
    };
    const auto found = std::find_if(contacts->begin(), contacts->end(), same);
    if (found != contacts->end()) {
      (*impulses)[found - contacts->begin()] += gained.impulse_W;
    } else {
      contacts->push_back(gained.contact);
      impulses->push_back(gained.impulse_W);
    }
  }
  for (size_t i = 0; i < bodies.size(); ++i) {
    const int number = static_cast<int>(i);
    if (!bodies[i].Moves() || mover.flights().left(number) == 0) continue;
    const Contact& wall = mover.flights().wall(number);
    const Vector3 missing = mover.flights().Missing(number, bodies[i].mass);
    contacts->push_back(wall);
    impulses->push_back(wall.body_b == number ? missing : Vector3(-missing));
  }
  for (const PaidImpulse& paid : mover.paid()) {
    contacts->push_back(paid.contact);
    impulses->push_back(paid.impulse_W);
  }
}

void FlightTime::EndStep(double dt, std::span<const Body> bodies, const Mover& mover, FlightMemory* memory) const {
  for (size_t i = 0; i < bodies.size(); ++i) {
    const int number = static_cast<int>(i);
    const double unflown = bodies[i].Moves() ? mover.flights().left(number) : 0;
    memory->unflown[i] = std::min(unflown, dt);
    if (unflown > 0) memory->walls[i] = mover.flights().wall(number);
    const bool flew = flies_[i] && mover.flights().flies(number) && unflown == 0;
    memory->flew[i] = static_cast<std::uint8_t>(flew ? std::min(kInFlight, memory->flew[i] + 1 + rebounded_[i]) : 0);
  }
}

}  // namespace islet
