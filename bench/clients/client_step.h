// A step of the contact suite for a host that detects overlaps and moves bodies: what its clients have in common.
//
//   1  bodies and contacts at their poses                                      the client, from the host
//   2  UndoOverlaps()   by the smallest displacements; the gaps follow
//   3  Resolve()        velocities, and poses at the end of the step. Where bodies lose less energy by it than 2 gave them, it is done
//                       again with as much of 2 as they pay for: what is left waits until somebody loses more
//   4  AddFound()       the client asks the host's detection once more, at these poses: what has closed unseen becomes an open contact
//                       of the step, and 3 is done again, from the same start, at most kRounds times
//   5  the host is set so that its own integration ends there                  the client
//
// Hosts find boxes only once they overlap, and of a box that lands on a corner no other corner: without 4, what falls at 8 m/s is
// 13 cm deep in a floor before anybody knows, and what tips over as well.
// Bodies that touch and turn are left overlapping a little: hosts keep the points of pairs that are apart with the normals they once had.
//   threads: one caller at a time
#pragma once

#include <memory>
#include <span>
#include <vector>

#include "engine/contact_suite.h"

namespace islet::clients {

inline constexpr int kRounds = 8;

// turn: [rad] rotation vector.
Quaternion Turned(const Vector3& turn_W, const Quaternion& rotation_WB);

class ClientStep {
 public:
  ClientStep(const Settings& settings, parallel::WorkerPool* pool) : suite_(settings, pool) {}

  void Begin(double dt, const Vector3& gravity_W);
  std::vector<Body> bodies;       // filled by the client between Begin() and UndoOverlaps()
  std::vector<Contact> contacts;  // the same, in any order; `touches` is left to UndoOverlaps()

  void UndoOverlaps();
  void Resolve();
  // Whether it moves so far in the step that it may meet somebody unseen: a pair of which neither does needs no detection.
  bool MovesFar(int body) const;
  // A contact at the poses that Resolve() has come to; true: it was not known, so Resolve() is to be called again.
  bool AddFound(Contact contact);

  const StepReport& report() const { return report_; }

 private:
  void Place(double share);
  void ResolveOnce();
  void Move();
  bool WallsMove() const;
  bool IsPaid() const;                        // what undoing overlaps gave, by what bodies lost
  double Energy() const;                      // [J]
  double Slop(const Contact& contact) const;  // [m]

  ContactSuite suite_;
  std::shared_ptr<const SuiteMemory> memory_;  // at the start of the step
  double dt_ = 0, far_ = 0;                    // [s], [m]
  Vector3 gravity_W_ = Vector3::Zero();
  std::vector<Body> given_, start_;        // as the host has them, and without overlaps
  std::vector<Contact> touching_, found_;  // as the client filled them in
  std::vector<Contact> scratch_;
  std::vector<Twist> undo_;        // what undoes the overlaps
  double undoing_ = 0, lost_ = 0;  // [J] what undoing gave the bodies, what they lost in the step
  std::vector<double> way_;        // [m] of each body's farthest point, at most
  bool first_ = true;              // no Resolve() in this step yet
  StepReport report_;
};

}  // namespace islet::clients
