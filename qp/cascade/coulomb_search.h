// Exact Coulomb friction on the circular cone: sweeps and Newton's method from the impulses of the frame before, as far as the effort
// goes; where they are lost, from the convex problem without slips.
//
//   threads: one per worker    allocation: none for a problem of a size that was met before
#pragma once

#include <span>

#include "qp/cascade/candidate.h"
#include "qp/cascade/convex_solver.h"
#include "qp/gauss_seidel/gauss_seidel.h"
#include "qp/newton/coulomb_newton.h"

namespace islet::qp {

class CoulombSearch {
 public:
  // tried: what the task starts from and its map, where that is known; it is taken. solution->rung says where the answer came from.
  void Solve(const Task& task, Candidate* tried, const NaturalMap& map_of_tried, ConvexSolver* convex,
             Solution* solution);
  int factorisations() const { return factorisations_; }  // of Newton's method, in the last call

 private:
  bool IsAtRest(const Task& task);
  NaturalMap NewtonOn(const Task& task, double least);
  bool CanStand(const Task& task, ConvexSolver* convex);
  NaturalMap Start(const Task& task, Candidate* tried, const NaturalMap& map_of_tried);
  NaturalMap Improve(const Task& task, NaturalMap map);
  NaturalMap Search(const Task& task, NaturalMap best);
  NaturalMap TryAgain(const Task& task, const NaturalMap& found);
  void SolveWithoutSlips(const Task& task, ConvexSolver* convex);
  bool SolveFromConvex(const Task& task, ConvexSolver* convex, NaturalMap* map, Solution* solution);
  bool Stands(const Task& task) const;
  bool IsLost(const Task& task, const NaturalMap& map) const;
  void PrepareSweeps(const Problem& problem);
  NaturalMap SweepOn(const Task& task);

  GaussSeidel gauss_seidel_;
  CoulombNewton coulomb_newton_;
  bool prepared_ = false;  // for the sweeps of this call
  int factorisations_ = 0;
  Candidate now_, best_, before_;
  Solution convex_answer_;  // of the problem without slips
  bool answered_ = false;   // so far in this call
};

}  // namespace islet::qp
