// What one step did and how exact it was. Plain data; filled by World::Step, and by ContactSuite::Resolve but for what poses tell.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "qp/ladder.h"

namespace islet {

// The greater of two; NaN if one of them is.
inline double Worse(double x, double y) { return x != x || x > y ? x : y; }

// How exact an answer is, computed from the answer by certificate.h, never by the solver. Velocities are relative to
// v_ref = max(|g| dt, fastest approach) of the island unless a unit is given. What each proves: engine/README.md.
struct Certificate {
  double momentum = 0;                     // |M (v - v0) - J^T j| in the mass metric, over sqrt(total mass) v_ref
  double cone = 0;                         // farthest impulse outside its friction cone, over total mass times v_ref
  double dual = 0;                         // farthest contact velocity outside the dual cone, over v_ref
  double gap = 0;                          // |sum of j . (u - b n + s n)| over the energy scale of the island
  double natural_map_max = 0;              // [m/s] |j - P_K(j - rho u)| / rho of the model that was solved
  double natural_map_rms = 0;              // [m/s]
  double coulomb_map_max = 0;              // [m/s] the same for exact Coulomb friction
  double coulomb_map_rms = 0;              // [m/s]
  double energy_gain = 0;                  // [J] kinetic energy that contact impulses added; 0 if they took some
  void Include(const Certificate& other);  // keeps the worse of each
};

// What the bodies of a step did that physics does not allow, judged by ledger.h; the worst of each, and whose it was. A body's
// number, -1: nobody. What is frozen is judged, too: the impulses of its contacts must carry it.
struct LedgerEntry {
  double value = 0;                     // how much
  int body = -1;                        // whose
  bool Include(double other, int of) {  // keeps the worse, the first NaN for good; whether that is the other
    const bool worse = other > value || (other != other && value == value);
    if (worse) value = other, body = of;
    return worse;
  }
};
// How far a step strayed from the laws of mechanics. All 0: not at all.
struct Ledger {
  LedgerEntry energy_created;  // of an island, over its kinetic energy, beyond what its solves may create as reported
  LedgerEntry momentum_unexplained;           // over the largest of momenta and impulses of the body
  LedgerEntry angular_momentum_unexplained;   // the same, about its centre
  LedgerEntry displacement_without_velocity;  // [m] of the body's farthest point
  int sides_changed = 0;                      // pairs of bodies of which one went through the other
  int side_changer = -1;                      // one of them
  void Include(const Ledger& other);          // keeps the worse of each, and adds up sides_changed
  bool Clean() const;                         // within kMostEnergy, kMostMomentum, no side changed
  static constexpr double kMostEnergy = 1e-6, kMostMomentum = 1e-9;  // bounds of Clean()
};

// How the problem of an island ended.
enum class QpStatus : std::uint8_t {
  kNone,        // no problem had to be solved
  kSolved,      // to the tolerance
  kInaccurate,  // the effort was spent before the tolerance was reached; the certificate tells how far it got
  kInfeasible,  // no velocities satisfy the contacts (walls that close on a body); the compliant answer was taken
  kFailed,      // no finite answer; the island kept its velocities without approach
};
const char* ToString(QpStatus status);  // "solved" and the like

// The problems of one stage, over the islands of one step.
struct QpSummary {
  int solved = 0;          // problems handed to the solver
  int failed = 0;          // of these, kInfeasible or kFailed
  int missed = 0;          // of these, kInaccurate: the effort was spent before the tolerance was reached
  double worst_map = 0;    // natural map of the model, rms over the contacts, over v_ref: the worst problem
  int iterations = 0;      // factorisations, sum
  int iterations_max = 0;  // in one problem
  double seconds = 0;      // wall time of the stage's solves, summed over islands
  void Include(const QpSummary& other);  // counts and times add up, what is worst or most stays
};

// How the problems of a step were answered, by rung of the ladder (qp/ladder.h). Drafts are not counted. Of detection:
// kept_pairs counts pairs of bodies, reach detections.
struct LadderReport {
  // What one rung answered.
  struct Rung {
    std::int64_t problems = 0;  // answered there
    std::int64_t contacts = 0;  // of these problems
    double seconds = 0;         // [s] wall, summed over islands
  };
  std::array<Rung, qp::kNumRungs> rungs;                                                      // by qp::Rung
  void Add(qp::Rung rung, std::int64_t problems, std::int64_t contacts, double seconds = 0);  // counts them, [s]
  void Include(const LadderReport& other);                                                    // adds it up
};

// [s] of wall time that the stages of a step took.
struct StageSeconds {
  double detect = 0,     // contacts found
      islands = 0,       // islands cut
      pq = 0,            // step 1: the queue of blows
      collision_qp = 0,  // step 2
      static_qp = 0,     // step 3
      freeze = 0,        // step 4
      move = 0;          // bodies moved, and what else there is

  void Include(const StageSeconds& other);                                                           // adds it up
  double Total() const { return detect + islands + pq + collision_qp + static_qp + freeze + move; }  // their sum
};

// One island of a step.
struct IslandReport {
  int first_body = 0;                           // smallest body number: the island's name
  int bodies = 0;                               // that move
  int contacts = 0;                             // between them, and of them with walls
  QpStatus collision_status = QpStatus::kNone;  // of step 2
  QpStatus static_status = QpStatus::kNone;     // of step 3
  int collision_iterations = 0;                 // factorisations of step 2
  int static_iterations = 0;                    // of step 3
  double map = 0;             // natural map of the law, rms, over v_ref: the worse of the two problems
  Certificate certificate{};  // the worse of the two problems, number by number
};

struct StepReport {
  std::vector<IslandReport> islands;  // numbered by smallest body
  int contacts = 0;                   // touching points
  int active_contacts = 0;            // of these, between bodies of which at least one moves
  int largest_island_contacts = 0;    // of the island with most of them
  int bounces = 0;                    // of the priority queue
  int woken = 0;                      // bodies frozen before the step and not after it
  int newly_frozen = 0;               // the other way round
  int awake = 0;                      // dynamic bodies after the step
  int frozen = 0;                     // the others of them
  // Certified freezing in crowds: worst sum of all impulses on a frozen body, over the sum of their magnitudes; at most 5e-10, half of
  // what the ledger forgives, or the body would not be frozen.
  double frozen_imbalance = 0;
  int restitution_lowered = 0;        // islands in which restitution was lowered: it would create energy, or has no answer
  QpSummary collision_qp, static_qp;  // problems of step 2 and of step 3
  LadderReport ladder;                // of the contact problems
  LadderReport motion_ladder;         // of detection
  StageSeconds seconds;               // where the time went
  Certificate certificate;            // worst over the islands
  double penetration_max = 0;         // [m] deepest overlap after the move
  int motion_passes = 0;              // most that one piece took until its gaps met its end
  int motion_failures = 0;  // small groups that gave up a step, and pieces of a crowd that missed their end for good
  int gave_up = 0;  // bodies of small groups that needed more work than a step has: they go with a crowd, less exactly
  double kinetic_energy = 0;  // [J] after the step
  Ledger ledger;              // what physics does not allow
  double energy_gain = 0;     // [J] of the whole step, potential energy and moving walls included; 0 if it lost some
  int pieces = 0;             // into which the steps of small groups were cut, together
  double unstepped = 0;       // [s] for which a group stood still since no way on was found, the longest
  int overlapping = 0;        // pairs of bodies that are inside of each other at the end, by a fiftieth of a size
  // Adds an island, and counts its contacts.
  void Add(const IslandReport& island);
  // Adds the report of the same step's next part: counts and times add up, the worse of each judgement stays, what is told of the
  // end of the step is the later one's.
  void Append(StepReport later);
  // A step that did what physics does not allow, or did not do all of it.
  bool Failed() const { return !ledger.Clean() || unstepped > 0 || overlapping > 0; }
};

}  // namespace islet
