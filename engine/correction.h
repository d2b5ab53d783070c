// How one island's planned motion must change so that none of its predicted gaps closes: the frictionless contact problem with
// displacements for velocities, answered by the cheapest rung of the ladder that serves.       [SM04 refs 24 and 37]
//
//   least |d|_M  with  gap + n . (d_b - d_a) >= 0  at all contacts of the island; turns count 16-fold, light bodies as heavier
//   threads: one corrector per worker
#pragma once

#include <span>
#include <vector>

#include "engine/island_problem.h"
#include "engine/lift.h"
#include "engine/step_report.h"
#include "qp/column.h"
#include "qp/gauss_seidel.h"
#include "qp/island_solver.h"
#include "qp/ladder.h"

namespace islet {

// Corrections turn bodies less than the mass metric would: a turn is right to first order only, and a cube held back at a
// corner would be turned far enough to hit its neighbours.
inline constexpr double kTurnWeight =
    16;  // measured: 1 leaves overlaps of 0.1 m in cubejam after 8 passes, 4 none, 16 takes a quarter fewer passes

struct IslandToCorrect {
  std::span<const int> bodies, contacts;  // world numbers; of the contacts: places in the two spans below
  ContactFrames near;
  std::span<const double> gaps;      // [m] per near contact, where the planned motion leads
  std::span<const double> free_way;  // [m] per body of the world: what it goes in the step without corrections
  double scale = 0;                  // [m] overlap of which a correction may miss a small share
};

class Corrector {
 public:
  explicit Corrector(qp::Ladder ladder) : ladder_(ladder) {}

  // False if no way out was found.
  bool Solve(const IslandToCorrect& island, std::span<const Body> bodies);

  // Of the last island, by place in its bodies: [m, rad].
  Displacement CorrectionOf(size_t member) const;

  // How the position problems since the last call were answered; what has no answer counts as tried in vain.
  LadderReport TakeReport();

 private:
  bool SolveColumn(double scale);
  bool SolveProblem(double scale);
  bool SolveFine(double scale, qp::Rung* rung);
  void Sweep(double scale);
  double Share(const IslandToCorrect& island, std::span<const Body> bodies) const;

  qp::Ladder ladder_;
  IslandGatherer gatherer_;
  qp::Problem problem_;
  qp::Solution solution_;
  qp::Column column_;
  qp::IslandSolver solver_;
  qp::GaussSeidel sweeps_;
  std::vector<double> scales_;  // of the problem's impulses
  double share_ = 1;            // of the displacements that is made
  LadderReport report_;
};

}  // namespace islet
