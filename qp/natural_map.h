// How far impulses and velocities are from exact Coulomb friction: [velocity] |j - P_K(j - rho u_hat)| / rho over the
// contacts, rho = 3 / tr W_cc, u_hat = u - target n + mu |u_t| n: zero at a solution, and nowhere else.
//   threads: pure functions
#pragma once

#include <vector>

#include "qp/problem.h"

namespace islet::qp {

struct NaturalMap {
  double max, rms;
  // What is asked for: rms over the contacts at most the goal, and ten times that at any.
  bool Meets(double goal) const { return rms <= goal && max <= 10 * goal; }
};

NaturalMap CoulombMap(const Problem& problem, const std::vector<double>& velocities,
                      const std::vector<Vector3>& impulses);

// The same with rho given, one number a contact: for callers who ask again and again.
void ImpulseScales(const Problem& problem, std::vector<double>* rho);
NaturalMap CoulombMap(const Problem& problem, const std::vector<double>& velocities,
                      const std::vector<Vector3>& impulses, const std::vector<double>& rho);

// The point of the friction cone |j_t| <= mu j_n nearest to x.
Vector3 ProjectOnCircularCone(const Vector3& x, double friction);

}  // namespace islet::qp
