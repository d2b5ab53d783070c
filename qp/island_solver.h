// Solves one island's problem by the cheapest way that is exact for its size and model:
//   no contact            velocities stay
//   one contact           closed form
//   one body              held by walls: closed form where its contacts all reach their targets or do not press
//   column                bodies on each other that move along one line: one unknown a body, in linear time
//   impulses that hold    those of the frame before, where they meet the law as they are
//   mirror images         an island symmetric about a plane is solved in that plane, by what follows
//   no friction           sweeps, then Newton's method where they came near, else an interior point of one row a contact that
//                         starts from them; the general interior point where that finds no answer
//   kinetic, convex       one interior-point solve
//   coulomb, few bodies   sweeps from the frame before, Newton's method on the exact law; where it fails as below, in rounds
//   coulomb               Gauss-Seidel sweeps with momentum, from the frame before, as far as the effort goes; Newton's method
//                         where it goes farther
//
//   threads: one solver per worker
#pragma once

#include <cmath>
#include <span>
#include <vector>

#include "qp/column.h"
#include "qp/coulomb_newton.h"
#include "qp/gauss_seidel.h"
#include "qp/in_vain.h"
#include "qp/interior_point.h"
#include "qp/natural_map.h"
#include "qp/normal_interior_point.h"
#include "qp/normal_newton.h"
#include "qp/one_body.h"
#include "qp/planar_interior_point.h"
#include "qp/planar_problem.h"
#include "qp/problem.h"
#include "qp/settings.h"
#include "qp/solution.h"
#include "qp/sticking_step.h"

namespace islet::qp {

class IslandSolver {
 public:
  // start: impulses to begin with, one per contact, or empty.
  void Solve(const Problem& problem, const Settings& settings, Solution* solution, std::span<const Vector3> start = {});

 private:
  // Of the gap, on small islands. Near 1e-15 rounding of the sliding contacts moves redundant impulses off the centre of the right ones.
  static constexpr double kSmallAim = 1e-13;
  static constexpr int kSmallIsland = 20;      // bodies: up to them an answer is as good as iterations get
  static constexpr int kSweeps = 100;          // a block
  static constexpr double kAcceptShare = 0.7;  // of the tolerance: what sweeps must reach to be taken as the answer
  // Of the tolerance: what an answer in the plane may leave out of it, and what is asked for in the plane of small islands.
  static constexpr double kPlanarShare = 1e-2;

  static double Seconds();  // of a clock that only goes on
  static bool AllZero(std::span<const Vector3> impulses);
  // What a block of sweeps made of `before`, so many blocks on, if they gain as much each.
  static double AtThisPace(double before, double now, int blocks);
  bool SolveOneContact(const Problem& problem, const Settings& settings, Solution* solution);
  void Climb(const Problem& problem, const Settings& settings, std::span<const Vector3> start, Solution* solution);
  void SolveWhole(const Problem& problem, const Settings& settings, std::span<const Vector3> start, Solution* solution);
  bool SolveOneBody(const Problem& problem, const Settings& settings, Solution* solution);
  bool SolveColumn(const Problem& problem, const Settings& settings, Solution* solution);
  bool SolvePlanar(const Problem& problem, const Settings& settings, std::span<const Vector3> start,
                   Solution* solution);
  bool StillHold(const Problem& problem, const Settings& settings, std::span<const Vector3> start, Solution* solution);
  bool HoldsExactly(const Problem& problem, const Settings& settings, Solution* solution);
  void SweepHeld(const Problem& problem, double goal, double map);
  bool SolveNormal(const Problem& problem, const Settings& settings, std::span<const Vector3> start,
                   Solution* solution);
  bool SolveByNewton(const Problem& problem, const Settings& settings, std::span<const Vector3> start,
                     Solution* solution);
  bool PolishSwept(const Problem& problem, const Settings& settings, Solution* solution);
  void SolveCoulomb(const Problem& problem, const Settings& settings, Solution* solution);
  bool SolveExact(const Problem& problem, const Settings& settings, std::span<const Vector3> start, Solution* solution);
  void TakeOver(const Problem& problem, std::span<const Vector3> start);
  bool StartFrom(const Problem& problem, std::span<const Vector3> start);
  static bool Meets(const NaturalMap& map, double goal);
  NaturalMap SearchFromConvex(const Problem& problem, const Settings& settings, const NaturalMap& swept);
  NaturalMap Search(const Problem& problem, const Settings& settings);
  void RunInteriorPoint(const Problem& problem, const Settings& settings, std::span<const double> slips,
                        Solution* solution, std::span<const Vector3> near = {});
  NaturalMap MapOfSwept(const Problem& problem) const;
  double UpdateSlips(const Problem& problem, Cone cone);
  bool AcceptSweeps(const Problem& problem, const Settings& settings, double share, Solution* solution);
  bool SweepsSuffice(const Problem& problem, const Settings& settings, Solution* solution);
  bool TakeExact(const Problem& problem, const Settings& settings, double share, Solution* solution);
  bool TakeSwept(const Problem& problem, const Settings& settings, double share, Solution* solution);
  void FindFirstSlips(const Problem& problem, double goal);

  InteriorPoint interior_point_;
  NormalNewton normal_newton_;
  NormalInteriorPoint normal_interior_point_;
  OneBody one_body_;
  Column column_;
  GaussSeidel gauss_seidel_;
  StickingStep sticking_step_;
  int iterations_ = 0;  // of this solve
  InVain in_vain_;      // the same
  Solution trial_;
  PlanarProblem planar_;
  PlanarInteriorPoint planar_interior_point_;
  bool in_plane_ = false;  // what is being solved is planar_'s problem
  Solution planar_solution_;
  std::vector<Vector3> planar_start_;
  std::vector<double> whole_scales_;
  std::vector<Vector3> swept_impulses_;
  std::vector<double> swept_velocities_, swept_slips_;
  std::vector<Vector3> best_impulses_;
  std::vector<double> best_velocities_;
  CoulombNewton coulomb_newton_;
  std::vector<double> slips_, scales_;  // scales_: rho of the natural map, per contact
};

NaturalMap CoulombMap(const Problem& problem, const std::vector<double>& velocities,
                      const std::vector<Vector3>& impulses);

}  // namespace islet::qp
