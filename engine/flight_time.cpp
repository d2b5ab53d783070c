#include "engine/flight_time.h"

#include <algorithm>

#include "engine/rebound.h"
#include "engine/suite_frame.h"
#include "engine/suite_memory.h"

namespace islet {
namespace {

constexpr double kMeets = 1e-2;  // of the overlap tolerance: contacts that are open by less have met

}  // namespace

void FlightMemory::AddBody() {
  unflown.push_back(0);
  flew.push_back(1);
}

void FlightMemory::Forget(int body) {
  unflown[body] = 0;
  flew[body] = 1;
}

bool FlightTime::Meets(const Contact& c) const {
  return c.gap <= kMeets * std::min(tolerances_[c.body_a], tolerances_[c.body_b]);
}

void FlightTime::BeginStep(std::span<const Body> bodies, std::span<const double> tolerances,
                           std::span<const Contact> near_contacts, const FlightMemory& memory) {
  tolerances_ = tolerances;
  in_flight_.resize(bodies.size());
  for (size_t i = 0; i < bodies.size(); ++i) in_flight_[i] = bodies[i].Moves() && memory.flew[i];
  for (const Contact& c : near_contacts)
    if (Meets(c)) in_flight_[c.body_a] = in_flight_[c.body_b] = 0;
}

bool FlightTime::Ignores(const Contact& c) const { return (in_flight_[c.body_a] || in_flight_[c.body_b]) && !Meets(c); }

void FlightTime::ChooseDurations(double dt, const Vector3& gravity_W, bool rebound, const SuiteMemory& suite,
                                 const FlightMemory& memory, std::span<Body> bodies, std::span<Contact> resolved) {
  if (rebound) SetRebounds(bodies, suite.previous_contacts, suite.previous_holding, resolved);
  durations_.assign(bodies.size(), dt);
  for (size_t i = 0; i < bodies.size(); ++i) durations_[i] += bodies[i].Moves() ? memory.unflown[i] : 0;
  loads_.clear();
  for (size_t i = 0; i < bodies.size(); ++i) {
    if (durations_[i] == dt) continue;
    Body& body = bodies[i];
    loads_.push_back({static_cast<int>(i), body.force_W, body.torque_W});
    const double share = durations_[i] / dt;
    body.force_W = share * body.force_W + (share - 1) * body.mass * gravity_W;
    body.torque_W *= share;
  }
}

MotionPlan FlightTime::PlanMotion(double dt, const Vector3& gravity_W, const ContactSuite& suite,
                                  std::span<const Contact> resolved, std::span<Body> bodies) {
  const std::span<const Vector3> holding = suite.memory().previous_holding;  // of this step, by now
  motions_.assign(bodies.size(), Motion::kFlies);
  for (size_t c = 0; c < resolved.size(); ++c) {
    const Contact& contact = resolved[c];
    const bool wall =
        bodies[contact.body_a].kind == BodyKind::kFixed || bodies[contact.body_b].kind == BodyKind::kFixed;
    const bool rebounds =
        contact.rebounds && NormalVelocity(contact, bodies[contact.body_a], bodies[contact.body_b]) < 0;
    for (const int i : {contact.body_a, contact.body_b}) {
      if (Pushes(holding[c], gravity_W, dt, bodies[i]))
        motions_[i] = std::min(motions_[i], wall && !rebounds ? Motion::kGlides : Motion::kPushed);
    }
  }
  before_.assign(suite.velocities_before_gravity().begin(), suite.velocities_before_gravity().end());
  RestoreBounced(dt, gravity_W, bodies, resolved, holding, &before_);
  // A solver's rounding is no push, but enough for the suite to take a body for caught.
  for (const Contact& contact : resolved)
    for (const int i : {contact.body_a, contact.body_b})
      if (motions_[i] == Motion::kFlies && bodies[i].Moves()) before_[i] = BeforeForces(dt, gravity_W, bodies[i]);
  // Where no force acts during the step, impulses are those of its beginning: to move on with half of them would leave the
  // angular momentum behind.
  for (size_t i = 0; i < bodies.size() && gravity_W.isZero(0); ++i)
    if (bodies[i].force_W.isZero(0) && bodies[i].torque_W.isZero(0)) before_[i] = TwistOf(bodies[i]);
  for (const Load& load : loads_) {
    bodies[load.body].force_W = load.force_W;
    bodies[load.body].torque_W = load.torque_W;
  }
  return {dt, durations_, motions_, before_};
}

void FlightTime::EndStep(double dt, std::span<const Body> bodies, const Mover& mover, FlightMemory* memory) const {
  for (size_t i = 0; i < bodies.size(); ++i) {
    const double unflown = bodies[i].Moves() && motions_[i] == Motion::kFlies ? mover.left()[i] : 0;
    memory->unflown[i] = std::min(unflown, dt);
    memory->flew[i] = motions_[i] == Motion::kFlies && mover.flew(static_cast<int>(i)) && unflown == 0;
  }
}

}  // namespace islet
