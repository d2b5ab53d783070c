// Solves one island's problem by the cheapest way that is exact for its size and model:
//   no contact            velocities stay
//   one contact           closed form (exact Coulomb; without friction, every model)
//   kinetic, convex       one interior-point solve; coulomb too where no contact has friction
//   coulomb               rounds of two: a search for the slips s = mu |u_t|, by Gauss-Seidel sweeps and, on big islands,
//                         operator splitting; then the convex problem with these slips by the interior point, until the
//                         natural map of exact Coulomb is below the tolerance or no round helps [DS91, ACLM11]
//
//   threads: one solver per worker
#pragma once

#include <span>
#include <vector>

#include "qp/gauss_seidel.h"
#include "qp/interior_point.h"
#include "qp/problem.h"
#include "qp/settings.h"
#include "qp/solution.h"
#include "qp/splitting.h"

namespace islet::qp {

class IslandSolver {
 public:
  // start: impulses to begin with, one per contact, or empty. Only big islands with exact Coulomb friction use them.
  void Solve(const Problem& problem, const Settings& settings, Solution* solution, std::span<const Vector3> start = {});

 private:
  void SolveOneContact(const Problem& problem, Solution* solution) const;
  void SolveCoulomb(const Problem& problem, const Settings& settings, Solution* solution);

  void SolveBigCoulomb(const Problem& problem, const Settings& settings, std::span<const Vector3> start,
                       Solution* solution);
  bool StartFrom(const Problem& problem, std::span<const Vector3> start);
  double SweepFrom(const Problem& problem, const Settings& settings, const Solution& convex);
  double Search(const Problem& problem, const Settings& settings, bool cold);
  double UpdateSlips(const Problem& problem, Cone cone);
  bool AcceptSweeps(const Problem& problem, const Settings& settings, Solution* solution);
  void FindFirstSlips(const Problem& problem, double goal);

  InteriorPoint interior_point_;
  GaussSeidel gauss_seidel_;
  Splitting splitting_;
  Solution trial_;
  std::vector<Vector3> swept_impulses_;
  std::vector<double> swept_velocities_;
  std::vector<Vector3> best_impulses_;
  std::vector<double> best_velocities_;
  std::vector<double> slips_;
};

// [velocity] |j - P_K(j - rho u_hat)| / rho over the contacts, rho = 3 / tr W_cc, u_hat = u - target n + mu |u_t| n: the natural
// map of exact Coulomb friction, zero at a solution.
struct NaturalMap {
  double max, rms;
};
NaturalMap CoulombMap(const Problem& problem, const std::vector<double>& velocities,
                      const std::vector<Vector3>& impulses);

}  // namespace islet::qp
