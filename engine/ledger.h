// The ledger of a step: what bodies did against what physics allows. From poses and velocities before and after, and the
// impulses that were reported, by code that neither the solver nor the motion shares: each body's way is integrated anew
// under gravity, external force and those impulses, and compared with where it is.
//
//   energy       kinetic and potential energy may change by what forces, torques and moving walls did, and fall
//   momentum     m (v1 - v0) is what forces and the body's impulses give
//   angular      the same for the angular momentum about the body's centre, at the moment and place of each impulse
//   sides        no body's centre goes through another body
//   way          a body is where its velocities took it
//
// A body that is frozen all the step stays where it is, and what acts on it over the step must cancel.
//
//   units: SI; relative numbers are over what is at hand, see LedgerEntry    threads: bodies are shared by the pool
#pragma once

#include <span>
#include <vector>

#include "engine/body.h"
#include "engine/contact.h"
#include "engine/contact_filter.h"
#include "engine/shape.h"
#include "engine/step_report.h"

namespace islet {

namespace parallel {
class WorkerPool;
}

// An impulse at one point of two bodies, spread evenly over a part of the step; duration 0: a blow.
struct LedgerImpulse {
  Contact contact;      // bodies, and the point where it acted: halfway
  Vector3 impulse_W;    // [N s] on body_b
  double time = 0;      // [s] from the start of the step
  double duration = 0;  // [s]
  int corrects = -1;    // place of the spread impulse of the same contact that it takes something back of, -1: none
  double accuracy = 0;  // [m/s] to which the solves of its group obey the law, as reported
};

struct LedgerStep {
  double dt = 0;  // [s]
  double whole_dt =
      0;  // [s] of the step that this is a part of: what is at hand in it does not depend on into how many parts it was cut
  Vector3 gravity_W = Vector3::Zero();
  std::span<const Body> before, after;
  std::span<const Shape> shapes;
  std::span<const LedgerImpulse> impulses;
  const ContactFilter* filter = nullptr;  // pairs that may go through each other
};

class LedgerKeeper {
 public:
  explicit LedgerKeeper(parallel::WorkerPool* pool) : pool_(pool) {}
  Ledger Judge(const LedgerStep& step);

  // [m] where a body's centre was when an impulse of the last step acted; of a spread one: halfway.
  Vector3 CentreAt(const LedgerImpulse& impulse, int body) const { return CentreAt(accounts_[body], impulse); }
  double energy_gain() const { return energy_gain_; }  // [J] of the last step, all islands that gained some

 private:
  struct Moment {  // of a body's centre on its way
    double time;   // [s]
    Vector3 position_W, velocity_W;
  };
  struct Spin {       // from a kick on: turns freely
    double time = 0;  // [s]
    Quaternion rotation_WB;
    Vector3 momentum_W;  // [N m s]
  };
  struct Account {                              // of one body
    double gain = 0, at_hand = 0, allowed = 0;  // [J] beyond the work done on it; what it has; what solves may create
    double momentum = 0, angular = 0, way = 0;
    std::vector<Moment> course;
    std::vector<Spin> spins;  // of one that contacts move
  };
  void JudgeBody(const LedgerStep& step, int body, Account* account);
  void FindCourse(const LedgerStep& step, int body, Account* account) const;
  Vector3 PositionAt(const Account& account, double time) const;
  Vector3 CentreAt(const Account& account, const LedgerImpulse& impulse) const;
  Vector3 OffChord(const Account& account, const LedgerImpulse& impulse) const;
  void JudgeTurningWall(const LedgerImpulse& impulse, const Body& wall, const Vector3& velocity_W, double sign,
                        Account* account) const;
  // last: what was asked last, no later; is set to what is answered.
  Quaternion RotationAt(const LedgerStep& step, int body, double time, Spin* last) const;
  void JudgeIslands(const LedgerStep& step, Ledger* ledger);
  void JudgeSides(const LedgerStep& step, Ledger* ledger) const;
  static bool Sinks(const LedgerStep& step, size_t body, size_t plane);
  bool Misses(const Account& account, const Account& partner, double begin, double end, double radius) const;
  bool GoesThrough(const LedgerStep& step, int body, int other) const;

  parallel::WorkerPool* pool_;
  std::vector<int> start_, places_;  // impulses of each body
  std::vector<Account> accounts_;
  std::vector<int> parent_;
  double energy_gain_ = 0;
};

}  // namespace islet
