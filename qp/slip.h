// Tangents of contacts: how long, how long at most, and what their slip adds to the normal velocity.
//
// De Saxce's term, s = mu |u_t|: with u_n + s in place of u_n Coulomb's law is a cone complementarity.           [DS91]
//   threads: pure functions
#pragma once

#include <algorithm>
#include <cmath>

#include "qp/cone.h"

namespace islet::qp {

inline double TangentSize(const Vector3& u) { return std::sqrt(u[1] * u[1] + u[2] * u[2]); }

// What a contact on a spring answers a pull by: the normal cut at 0, then the tangent at the disc of radius mu times the normal.
inline Vector3 CutToCone(const Vector3& pull, double friction) {
  if (pull[0] <= 0) return Vector3::Zero();
  const double tangent = TangentSize(pull), share = tangent > friction * pull[0] ? friction * pull[0] / tangent : 1;
  return {pull[0], share * pull[1], share * pull[2]};
}

// Whether friction is all that it may be, mu times the press: so it is where a contact slides.
inline bool OnCone(double friction, double most) {
  constexpr double kOnCone = 1 - 1e-3;
  return friction >= kOnCone * most;
}

// De Saxce's term. For the octagon: the support function of its base, which is largest at an edge.
inline double Slip(const Vector3& u, double friction, Cone cone) {
  if (cone == Cone::kCircular) return friction * TangentSize(u);
  double largest = 0;
  for (const auto& edge : kOctagonEdges) largest = std::max(largest, -(edge[0] * u[1] + edge[1] * u[2]));
  return friction * largest;
}

}  // namespace islet::qp
