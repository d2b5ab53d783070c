// The plug-in door: bodies and contact points in; velocities, impulses, frozen flags and certificates out. No geometry, no
// integrator: this is what another simulator links in place of its own contact resolution.                     [SM04]
//
//   islet::ContactSuite suite(settings, &pool);
//   each frame:  suite.Resolve(dt, bodies, contacts, &report);    // steps 1 to 4
//                suite.Move(bodies);                              // or move them yourself
//
// In
//   bodies    of any kind, by number; of dynamic ones mass, inertia and radius (farthest point from the centre: freezing measures motion by
//             it), poses, velocities, forces. What the user moves is kinematic. Friction, restitution, surface velocity, layers, sensor and
//             velocities before of a body are not read: contacts say what matters of that (surface_W: MixSurfaces in contact.h)
//   contacts  in canonical order (by body_a, body_b, feature), body_a < body_b, with mixed friction and restitution. Those that touch or
//             overlap: touches = true; what counts as touching is up to the caller, World takes 1e-3 of the smaller body's size. Those still
//             open that the step may close: touches = false with their gap, or two supported bodies close it unseen. Of these, what would
//             bounce within the step has its blow at once, a part of a step too early. `feature` tells points
//             of a pair apart from frame to frame; where it flickers or is always 0, the nearest point inherits the load.
//             With certified freezing the list holds the contacts of frozen bodies too, unchanged while nothing there moves
// Out
//   velocities of bodies, their frozen flags, impulses(), and the report, which starts afresh. A frozen body that is given a velocity wakes.
//     Of the report the parts about poses stay 0, since the caller moves: ledger, penetration_max, unstepped, overlapping, and so Failed().
//     What could not be solved is collision_qp.failed and static_qp.failed; how exact the rest is, certificate
//   Poses are the caller's. Move() moves bodies by the mean of velocities_before_gravity() and their final velocities (the trapezoidal rule)
//     and turns them at constant angular momentum, which changes the angular velocity; frozen ones not at all
//   Overlaps are the caller's, too: velocities keep contacts from closing, and what one step of rotation closes is not taken back. Project()
//     tells the smallest displacements that undo them; World's step leaves none
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

// Velocity of a body, or a small displacement.
struct Twist {
  Vector3 linear_W = Vector3::Zero();   // [m/s] of its centre of mass; [m]
  Vector3 angular_W = Vector3::Zero();  // [rad/s]; [rad]
};

class ContactSuite {
 public:
  ContactSuite(const Settings& settings, parallel::WorkerPool* pool);  // the pool, not null, must outlive it
  ~ContactSuite();
  ContactSuite(const ContactSuite&) = delete;
  ContactSuite& operator=(const ContactSuite&) = delete;

  void SetGravity(const Vector3& gravity_W);  // [m/s^2]
  // Called for each collision and static problem that a Resolve solves; empty: nobody watches, and nothing is kept for it.
  void SetProblemObserver(ProblemObserver observer);

  // Steps 1 to 4 over dt > 0 [s]: changes velocities and frozen flags.
  // Throws std::invalid_argument that names body or contact, field and value: a value that is not finite, a mass or inertia that is not
  // positive, a rotation or normal that is not of unit length, a contact of no body, or one out of order. Nothing has changed then.
  void Resolve(double dt, std::span<Body> bodies, std::span<const Contact> contacts, StepReport* report);

  // Moves bodies that contacts can move over the dt of the last Resolve, as they left it: poses, and angular velocities, which turn with the
  // inertia. Throws where their number is another one.
  void Move(std::span<Body> bodies) const;

  // The smallest displacements, measured by mass and inertia, that bring every gap < 0 to 0 and close none, to first order. They are of poses
  // alone: velocities, impulses and memory stay. Frozen bodies do not move. Takes the same contacts as Resolve, and checks them so. Called
  // before it: move the bodies, then detect again, or add to each gap what the displacements open it by. What is deep is better undone in
  // shares of a few steps, by gaps that are less deep than they are: neighbours that are not in the list may be in the way. Returns [m] the
  // deepest overlap that is left to first order: where walls or frozen bodies leave no room, and in heaps so deep that the search ends.
  double Project(std::span<const Body> bodies, std::span<const Contact> contacts);
  // Of the last Project, per body: [m] by which to move it, and the vector [rad] by which to turn it about its centre, W.
  std::span<const Twist> displacements() const;

  // What it remembers from frame to frame; to be given to a suite with the same bodies.
  const SuiteMemory& memory() const;
  void SetMemory(const SuiteMemory& memory);  // goes on from there
  // A copy to keep, for who resolves the same step more than once: suite.SetMemory(*copy).
  std::shared_ptr<const SuiteMemory> CopyMemory() const;

  // [N s] on body_b of each contact of the last Resolve, W: bounces, collision and static impulses together. The contacts of
  // a frozen body carry the impulses that hold it.
  std::span<const Vector3> impulses() const;
  // Per body, after the collisions and before gravity: with the final velocities the two ends of the trapezoidal rule. Along normals at
  // which a gap is closed by the end of the step, or a body bounced off and was caught again, and of what rides on it, the final ones.
  std::span<const Twist> velocities_before_gravity() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace islet
