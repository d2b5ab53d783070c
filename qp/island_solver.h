// Solves one island's problem by the cheapest way that is exact for its size and model:
//   no contact            velocities stay
//   one contact           closed form (exact Coulomb; without friction, every model)
//   kinetic, convex       one interior-point solve; coulomb too where no contact has friction
//   coulomb               interior-point solves with lagged slip s = mu |u_t|, Gauss-Seidel sweeps between them, until
//                         the natural map of exact Coulomb is below the tolerance or the cap on rounds is reached [DS91, ACLM11]
//
//   threads: one solver per worker
#pragma once

#include <vector>

#include "qp/gauss_seidel.h"
#include "qp/interior_point.h"
#include "qp/problem.h"
#include "qp/settings.h"
#include "qp/solution.h"

namespace islet::qp {

class IslandSolver {
 public:
  void Solve(const Problem& problem, const Settings& settings, Solution* solution);

 private:
  void SolveOneContact(const Problem& problem, Solution* solution) const;
  void SolveCoulomb(const Problem& problem, const Settings& settings, Solution* solution);

  double UpdateSlips(const Problem& problem, Cone cone);
  bool AcceptSweeps(const Problem& problem, const Settings& settings, Solution* solution);
  void FindFirstSlips(const Problem& problem, double goal);

  InteriorPoint interior_point_;
  GaussSeidel gauss_seidel_;
  Solution trial_;
  std::vector<Vector3> swept_impulses_;
  std::vector<double> swept_velocities_;
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
