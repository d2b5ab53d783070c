// De Saxce's term, s = mu |u_t|: with u_n + s in place of u_n Coulomb's law is a cone complementarity.           [DS91]
//   threads: pure functions
#pragma once

#include <algorithm>
#include <cmath>
#include <numbers>

#include "qp/problem.h"
#include "qp/settings.h"

namespace islet::qp {

inline double TangentSize(const Vector3& u) { return std::sqrt(u[1] * u[1] + u[2] * u[2]); }

// For the octagon: the support function of its base, which is largest at an edge.
inline double Slip(const Vector3& u, double friction, Cone cone) {
  if (cone == Cone::kCircular) return friction * TangentSize(u);
  double largest = 0;
  for (int k = 0; k < 8; ++k) {
    const double angle = (0.5 + k) * std::numbers::pi / 4;
    largest = std::max(largest, -(std::cos(angle) * u[1] + std::sin(angle) * u[2]));
  }
  return friction * largest;
}

}  // namespace islet::qp
