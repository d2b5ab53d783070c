// Solves one island's problem by the first of these strategies that fits and whose answer meets the law:
//   closed form           one contact
//   column                bodies on each other that move along one line: one unknown a body, in linear time
//   held                  impulses of the frame before that meet the law as they are
//   exact friction        coulomb on the circular cone, and all models without friction: coulomb_search.h
//   octagon               coulomb on the octagon: slip_rounds.h
//   convex                the rest: one interior-point solve
//
//   threads: one solver per worker
#pragma once

#include <span>
#include <vector>

#include "qp/cascade/candidate.h"
#include "qp/cascade/convex_solver.h"
#include "qp/cascade/coulomb_search.h"
#include "qp/cascade/slip_rounds.h"
#include "qp/cascade/task.h"
#include "qp/direct/column.h"
#include "qp/problem.h"
#include "qp/settings.h"
#include "qp/solution.h"

namespace islet::qp {

class IslandSolver {
 public:
  // start: impulses to begin with, one per contact, or empty.
  void Solve(const Problem& problem, const Settings& settings, Solution* solution, std::span<const Vector3> start = {});

 private:
  // fits: a cheap look, which may prepare. solve: whether its answer stands; if not, the solution is none.
  struct Strategy {
    Rung rung;  // that has to be on the ladder; kInteriorPoint: always allowed, its solver names the rung of the answer
    bool (IslandSolver::*fits)(const Task& task);
    bool (IslandSolver::*solve)(const Task& task, Solution* solution);
  };
  static const Strategy kStrategies[];

  bool IsOneContact(const Task& task);
  bool SolveOneContact(const Task& task, Solution* solution);
  bool IsColumn(const Task& task);
  bool SolveColumn(const Task& task, Solution* solution);
  bool StillHolds(const Task& task);
  bool Hold(const Task& task, Solution* solution);
  bool HasExactFriction(const Task& task) { return IsExactFriction(task); }
  bool SolveExactFriction(const Task& task, Solution* solution);
  bool IsOctagon(const Task& task) { return task.coulomb(); }
  bool SolveOctagon(const Task& task, Solution* solution);
  bool Always(const Task&) { return true; }
  bool SolveConvex(const Task& task, Solution* solution);

  Column column_;
  ConvexSolver convex_;
  CoulombSearch coulomb_search_;
  SlipRounds slip_rounds_;
  Candidate candidate_;  // of column and held
  bool tried_ = false;   // of this call: the candidate is what it starts from
  NaturalMap map_of_tried_{};
  std::vector<double> scales_;
};

}  // namespace islet::qp
