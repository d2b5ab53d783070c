// Moves the bodies of one step so that none overlap: free motion by the trapezoidal rule, and where that would overlap,
// the nearest displacements in the mass metric that do not (OBA position update).              [SM04 refs 24 and 37]
//
//   free motion      x += dt (v0 + v1) / 2, v0 after the collisions, v1 after the static contacts: exact for free flight and
//                    for sliding under constant friction; rotation by rotation.h
//   flights          a body that no contact pushes stops at the moment at which it meets a wall, see flight.h
//   position QP      min |d - d*|_M  with  n . (d_b - d_a) >= -gap  at near contacts (correction.h), per island, only for islands
//                    in which something would overlap; repeated from the new poses until no pair overlaps by more than the
//                    tolerance
//   last resort      bodies that still overlap after the last pass stay where the step began
//   velocities       are those that the contact suite certified: a correction changes none but its direction in the body,
//                    those of an island in flight by what keeps its momenta and energy (island_spin.h), and those of bodies
//                    in the air by what the height took that it gave them (lift.h)
//
//   threads: islands run on the pool; the result does not depend on the number of workers
#pragma once

#include <functional>
#include <span>
#include <vector>

#include "engine/contact_suite.h"
#include "engine/correction.h"
#include "engine/earlier_overlaps.h"
#include "engine/flight.h"
#include "engine/island_spin.h"
#include "engine/lift.h"
#include "engine/settings.h"
#include "engine/step_report.h"
#include "engine/stops.h"
#include "islands/partition.h"

namespace islet {

// Detects the contacts at the bodies' present poses, for bodies about to travel as given [m].
using DetectContacts = std::function<void(std::span<const Vector3> travel_W, std::vector<Contact>* contacts)>;

// How the bodies are to move: per body, for how long [s], whether free of contacts, and from which velocities.
struct MotionPlan {
  double dt = 0;  // [s] of the step
  std::span<const double> durations;
  std::span<const std::uint8_t> flies;
  std::span<const std::uint8_t> owes;  // whether it owes for the height that corrections give it, see lift.h
  std::span<const Twist> before;       // with the bodies' velocities the two ends of the trapezoidal rule
};

struct MotionOutcome {
  int passes = 0;              // position problems solved one after the other
  bool reached = true;         // no pair overlaps by more than the tolerance
  double penetration_max = 0;  // [m] at the end
  int held_back = 0;           // bodies that stayed where the step began, since the passes could not part them
};

struct PaidImpulse {
  Contact contact;
  Vector3 impulse_W;  // [N s] on body_b
};

class Mover {
 public:
  Mover(const Settings& settings, parallel::WorkerPool* pool);

  // After PlanTravel with the same plan and bodies. contacts: near contacts at the poses before the move, on return those after
  // it. tolerances: [m] per body; a pair's is the smaller one. detect is called after each pass.
  MotionOutcome Move(const MotionPlan& plan, std::span<const double> tolerances, const DetectContacts& detect,
                     std::span<Body> bodies, std::vector<Contact>* contacts);

  // In its place where nothing moves.
  MotionOutcome Stay(const MotionPlan& plan, std::span<const double> tolerances, std::span<const Body> bodies,
                     const std::vector<Contact>& contacts);

  // Of the last move. Paid: what walls gave to bodies that paid for height.
  const Flights& flights() const { return flights_; }
  std::span<const PaidImpulse> paid() const { return paid_; }

  // How the position problems since the last call were answered. Those that nobody had to solve: rung free_motion, one for each
  // island, or one for a whole pass in which nothing would overlap.
  LadderReport TakeLadder();

  void SetGravity(const Vector3& gravity_W) { settings_.gravity = gravity_W; }

  // [m] where free motion would take each body; zero for those that stand still.
  std::span<const Vector3> PlanTravel(const MotionPlan& plan, std::span<const Body> bodies);

 private:
  struct Pose {
    Vector3 position_W;  // [m]
    Quaternion rotation_WB;
  };
  void PlanFreeMotion(const MotionPlan& plan, std::span<const Body> bodies);
  void PlanFlights(int pass, std::span<const double> tolerances, std::span<const Body> bodies,
                   const std::vector<Contact>& contacts);
  void StopShort(const MotionPlan& plan, std::span<const double> tolerances, std::span<const Body> bodies,
                 const std::vector<Contact>& contacts);
  void GroundFlights(bool all, std::span<Body> bodies);
  void PredictGaps(std::span<const Body> bodies, const std::vector<Contact>& contacts);
  bool Correct(bool ask_all, std::span<const double> tolerances, std::span<const Body> bodies,
               const std::vector<Contact>& contacts);
  void CountSpared(size_t contacts);
  void FindIslands(double deepest, std::span<const double> tolerances, std::span<const Body> bodies,
                   const std::vector<Contact>& contacts);
  void CorrectIsland(int island, int worker, double scale, std::span<const Body> bodies,
                     const std::vector<Contact>& contacts);
  void RememberSpins(std::span<const Body> bodies, const std::vector<Contact>& contacts);
  void RestoreSpins(std::span<Body> bodies);
  void RememberCorrections(const std::vector<Contact>& contacts);
  void PayForLifts(std::span<Body> bodies);
  void Apply(std::span<Body> bodies);
  static void Judge(std::span<const double> tolerances, const std::vector<Contact>& contacts, MotionOutcome* outcome);
  void HoldBack(std::span<const double> tolerances, const DetectContacts& detect, std::span<Body> bodies,
                std::vector<Contact>* contacts, MotionOutcome* outcome);

  Settings settings_;
  parallel::WorkerPool* pool_;
  Flights flights_;
  Stops stops_;
  EarlierOverlaps earlier_;
  std::span<const std::uint8_t> owes_;         // of the plan, during the step
  bool flights_move_ = false;                  // in this pass
  std::vector<Displacement> planned_, flown_;  // of this pass; of flying bodies: before corrections
  std::vector<Displacement> corrections_;      // of this pass: what `planned_` has of them
  std::vector<Displacement> shifts_;           // of this step: their sum
  std::vector<std::uint8_t> handled_;          // per contact: left to the flights
  std::vector<Vector3> free_turns_;            // [rad] per body: what is left of the planned free rotation
  std::vector<Vector3> travel_;                // [m] per body
  std::vector<Pose> start_, end_;              // per body, of this step
  std::vector<double> free_way_;               // [m] per body, of this step: without corrections
  std::vector<double> ways_;                   // [m] per body: of its farthest point as planned first, at most
  std::vector<std::uint8_t> cut_, held_;       // per body
  std::vector<std::uint8_t> wanted_, corrected_, free_;  // per island
  std::vector<std::pair<int, int>> pairs_, shifted_pairs_;        // of this pass; of this step: joined by corrections
  std::vector<int> linked_, island_contacts_;
  std::vector<Matrix3> frames_;
  std::vector<Matrix3> turns_;             // per body: what planned_ turns a lever by
  std::vector<double> gaps_;               // [m] per contact, where planned_ leads
  std::vector<Contact> shifted_contacts_;  // of shifted_pairs_; gap: as it was predicted
  std::vector<PaidImpulse> paid_;
  islands::Partition partition_;
  std::vector<IslandSpin> spins_;      // per island
  std::vector<Corrector> correctors_;  // per worker
  LadderReport spared_;                // position problems that nobody had to solve
};

}  // namespace islet
