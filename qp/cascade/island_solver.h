// Solves one island's problem by the cheapest way that is exact for its size and model:
//   no contact            velocities stay
//   one contact           closed form
//   column                bodies on each other that move along one line: one unknown a body, in linear time
//   impulses that hold    those of the frame before, where they meet the law as they are
//   coulomb, circular     sweeps and Newton's method from the frame before, as far as the effort goes; where they are lost, from
//                         the interior point; without friction every model is this one                (island_coulomb.cpp)
//   kinetic, convex       one interior-point solve
//   coulomb, octagon      interior-point solves, each with the slips of the one before
//
//   threads: one solver per worker
#pragma once

#include <span>
#include <vector>

#include "qp/direct/column.h"
#include "qp/gauss_seidel/gauss_seidel.h"
#include "qp/interior_point/interior_point.h"
#include "qp/natural_map.h"
#include "qp/newton/coulomb_newton.h"
#include "qp/problem.h"
#include "qp/settings.h"
#include "qp/solution.h"

namespace islet::qp {

class IslandSolver {
 public:
  // start: impulses to begin with, one per contact, or empty.
  void Solve(const Problem& problem, const Settings& settings, Solution* solution, std::span<const Vector3> start = {});

 private:
  // Of the gap, on small islands. Near 1e-15 rounding of the sliding contacts moves redundant impulses off the centre of the right ones.
  static constexpr double kSmallAim = 1e-13;
  static constexpr int kSmallIsland = 32;  // bodies: up to them an answer is as good as iterations get
  static constexpr int kFewLoops =
      4;  // of pairs of bodies that touch: a factor of such an island is no larger than a tower's
  static constexpr double kSmallShare = 0.7e-5;  // of the tolerance: what is sought there
  static constexpr int kNewtonSteps = 300;  // factorisations of a search; 26 bodies from no impulses take 100 to 200

  static bool AllZero(std::span<const Vector3> impulses);
  static bool IsSmall(const Problem& problem) { return problem.num_bodies() <= kSmallIsland; }
  static bool HasFewLoops(const Problem& problem);
  bool SolveOneContact(const Problem& problem, const Settings& settings, Solution* solution);
  void Climb(const Problem& problem, const Settings& settings, std::span<const Vector3> start, Solution* solution);
  void SolveWhole(const Problem& problem, const Settings& settings, std::span<const Vector3> start, Solution* solution);
  bool SolveColumn(const Problem& problem, const Settings& settings, Solution* solution);
  bool StillHold(const Problem& problem, const Settings& settings, std::span<const Vector3> start, Solution* solution);
  void RunInteriorPoint(const Problem& problem, const Settings& settings, std::span<const double> slips,
                        Solution* solution);
  void SolveExact(const Problem& problem, const Settings& settings, std::span<const Vector3> start, Solution* solution);
  bool SolveFromConvex(const Problem& problem, const Settings& settings, NaturalMap* map, Solution* solution);
  NaturalMap TryAgain(const Problem& problem, const Settings& settings, const NaturalMap& found);
  static bool MayBeRough(const Problem& problem, const Settings& settings);
  bool IsUncarried(const Problem& problem, const Settings& settings, const NaturalMap& map) const;
  bool IsLost(const Problem& problem, const Settings& settings, const NaturalMap& map) const;
  NaturalMap Improve(const Problem& problem, const Settings& settings, NaturalMap map);
  NaturalMap Search(const Problem& problem, const Settings& settings, NaturalMap best);
  void SolveOctagon(const Problem& problem, const Settings& settings, Solution* solution);
  double UpdateSlips(const Problem& problem, Cone cone);

  // Of swept_.
  void TakeNone(const Problem& problem);
  void TakeOver(const Problem& problem, std::span<const Vector3> start);
  NaturalMap StartFrom(const Problem& problem, const Settings& settings, std::span<const Vector3> start);
  void PrepareSweeps(const Problem& problem);
  NaturalMap SweepOn(const Problem& problem);
  NaturalMap MapOfSwept(const Problem& problem) const;
  bool IsUseful(const Problem& problem, const Settings& settings) const;
  bool HoldsExactly(const Problem& problem, const Settings& settings, double share, Solution* solution);
  void ReturnSwept(const Problem& problem, const Settings& settings, Solution* solution);

  InteriorPoint interior_point_;
  Column column_;
  GaussSeidel gauss_seidel_;
  bool prepared_ = false;  // for the sweeps of this solve
  CoulombNewton coulomb_newton_;
  int iterations_ = 0;  // of this solve
  InVain in_vain_;      // the same
  Solution trial_;
  struct Point {
    std::vector<Vector3> impulses;
    std::vector<double> velocities;
  };
  Point swept_, best_, before_;
  std::vector<double> slips_, scales_;  // scales_: rho of the natural map, per contact
};

}  // namespace islet::qp
