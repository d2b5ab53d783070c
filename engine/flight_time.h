// How long each body moves in a step. A flight that an impact cuts short (flight.h) leaves some of its step; when the body
// then rebounds its next flight lasts so much longer, and the bounces happen at their times, whatever the time step.
//
//   order in a step:  BeginStep, Ignores (of contacts), ChooseDurations; the contact suite; PlanMotion; the move; EndStep
//   threads: one caller at a time
//   allocation: none after warm-up
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "engine/body.h"
#include "engine/contact.h"
#include "engine/contact_suite.h"
#include "engine/motion.h"
#include "engine/rebound.h"

namespace islet {

// What one step leaves for the next.
struct FlightMemory {
  std::vector<double> unflown;  // [s] per body: what its last flight left
  std::vector<std::uint8_t>
      flew;                    // per body: steps in which no contact pushed it and it met nothing, as far as they count
  std::vector<Contact> walls;  // per body: what cut that flight short

  void AddBody();
  void Forget(int body);
};

class FlightTime {
 public:
  // exact: with the law BounceLaw::kExact. Without it (as in the paper) nobody flies and nothing rebounds within a step.
  explicit FlightTime(bool exact) : exact_(exact) {}

  // tolerances: [m] of overlap, per body.
  void BeginStep(std::span<const Body> bodies, std::span<const double> tolerances,
                 std::span<const Contact> near_contacts, const FlightMemory& memory);
  // A body in flight meets what is there when it gets there, however slow it is and however near: a rebound from a little
  // above would be too high. Without rebound that makes no difference.
  bool Ignores(const Contact& contact) const { return InFlight(contact) && !Meets(contact); }
  // One of the two bodies is, and would rebound.
  bool InFlight(const Contact& contact) const {
    return contact.restitution > 0 && (in_flight_[contact.body_a] || in_flight_[contact.body_b]);
  }

  // What a flight left is added if the body now leaves all that it touches. The suite knows one time step only: forces make up
  // for it until PlanMotion. resolved: gets its rebounds (rebound.h).
  void ChooseDurations(double dt, const Vector3& gravity_W, const SuiteMemory& suite, const FlightMemory& memory,
                       std::span<Body> bodies, std::span<Contact> resolved);
  // After the suite. The plan refers to this object.
  MotionPlan PlanMotion(double dt, const Vector3& gravity_W, const ContactSuite& suite,
                        std::span<const Contact> resolved, std::span<Body> bodies);
  // After the move. A body that stopped at a wall lacks what gravity would have given it in the time left, and in the next step
  // it has that much more: as far as anybody can tell the wall took it and gives it back. These impulses [N s] on body_b join
  // those of the contacts, as do those that walls gave to bodies that paid for height (lift.h).
  void ReportImpulses(const Mover& mover, std::span<const Body> bodies, std::vector<Contact>* contacts,
                      std::vector<Vector3>* impulses) const;
  void EndStep(double dt, std::span<const Body> bodies, const Mover& mover, FlightMemory* memory) const;

 private:
  struct Load {
    int body;
    Vector3 force_W, torque_W;
  };
  struct Attributed {
    Contact contact;
    Vector3 impulse_W;  // [N s] on body_b
  };
  bool Meets(const Contact& contact) const;
  void FindPushes(double dt, const Vector3& gravity_W, std::span<const Contact> resolved,
                  std::span<const Vector3> holding, std::span<const Body> bodies);
  void FindWhatIsInTheAir(std::span<const Contact> resolved, std::span<const Body> bodies);

  bool exact_;
  BouncedMotion bounced_;
  std::span<const double> tolerances_;    // of BeginStep, during the step
  std::vector<std::uint8_t> in_flight_;   // per body: flew, and nothing stops it yet
  std::vector<double> durations_;         // [s] per body
  std::vector<Load> loads_;               // what the user wants of bodies whose forces stand in for a longer step
  std::vector<std::uint8_t> rebounded_;   // per body: a contact rebounds in this step
  std::vector<double> rounding_;          // [N s] per body: what pushes exceed
  std::vector<std::uint8_t> pushes_;      // per resolved contact: one of its bodies that move is pushed
  std::vector<std::uint8_t> flies_;       // per body: no contact pushes it in this step
  std::vector<std::uint8_t> in_the_air_;  // per body: no contact supports it, or it bounces within the step
  std::vector<int> roots_;                // scratch: bodies that push each other
  std::vector<Attributed> gained_;        // what bodies that move for longer than the step got for that
  std::vector<Twist> before_;             // per body: velocities that its motion begins with
};

}  // namespace islet
