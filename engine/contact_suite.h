// The plug-in door: bodies and contact points in; velocities, impulses, frozen flags and certificates out. No geometry, no
// integrator: this is what another simulator links in place of its own contact resolution.                     [SM04]
//
//   islet::ContactSuite suite(settings, &pool);
//   each frame:  suite.Resolve(dt, bodies, contacts, &report);    // steps 1 to 4; then move the bodies yourself
//
// Contacts must be in canonical order (by body_a, body_b, feature), body_a < body_b. With certified freezing the list must
// hold the contacts of frozen bodies too, unchanged from frame to frame while nothing there moves.
//   threads: one caller at a time; the result does not depend on the pool's number of workers
#pragma once

#include <memory>
#include <span>
#include <vector>

#include "engine/body.h"
#include "engine/contact.h"
#include "engine/problem_record.h"
#include "engine/settings.h"
#include "engine/step_report.h"

namespace islet {

namespace parallel {
class WorkerPool;
}

struct SuiteMemory;  // engine/suite/suite_memory.h

struct Twist {
  Vector3 linear_W = Vector3::Zero();   // [m/s]
  Vector3 angular_W = Vector3::Zero();  // [rad/s]
};

class ContactSuite {
 public:
  ContactSuite(const Settings& settings, parallel::WorkerPool* pool);
  ~ContactSuite();
  ContactSuite(const ContactSuite&) = delete;
  ContactSuite& operator=(const ContactSuite&) = delete;

  void SetGravity(const Vector3& gravity_W);
  // Called for each collision and static problem that a Resolve solves; empty: nobody watches, and nothing is kept for it.
  void SetProblemObserver(ProblemObserver observer);

  // Throws std::invalid_argument if a contact names no body, its numbers are not ordered, or a value is not finite.
  void Resolve(double dt, std::span<Body> bodies, std::span<const Contact> contacts, StepReport* report);

  // What it remembers from frame to frame; to be given to a suite with the same bodies. See World::Save().
  const SuiteMemory& memory() const;
  void SetMemory(const SuiteMemory& memory);

  // [N s] on body_b of each contact of the last Resolve, W: bounces, collision and static impulses together. The contacts of
  // a frozen body carry the impulses that hold it.
  std::span<const Vector3> impulses() const;
  // Per body, after the collisions and before gravity: with the final velocities the two ends of the trapezoidal rule. Of a
  // body that bounced off and was caught again within the step, and of what rides on it, the final ones.
  std::span<const Twist> velocities_before_gravity() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace islet
