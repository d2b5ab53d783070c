// De Saxce's term, s = mu |u_t|: with u_n + s in place of u_n Coulomb's law is a cone complementarity.           [DS91]
//   threads: pure functions
#pragma once

#include <algorithm>
#include <cmath>

#include "qp/cone.h"

namespace islet::qp {

inline double TangentSize(const Vector3& u) { return std::sqrt(u[1] * u[1] + u[2] * u[2]); }

// Whether friction is all that it may be, mu times the press: so it is where a contact slides.
inline bool OnCone(double friction, double most) {
  constexpr double kOnCone = 1 - 1e-3;
  return friction >= kOnCone * most;
}

// For the octagon: the support function of its base, which is largest at an edge.
inline double Slip(const Vector3& u, double friction, Cone cone) {
  if (cone == Cone::kCircular) return friction * TangentSize(u);
  double largest = 0;
  for (const auto& edge : kOctagonEdges) largest = std::max(largest, -(edge[0] * u[1] + edge[1] * u[2]));
  return friction * largest;
}

}  // namespace islet::qp
