// The self-dual cones of the interior-point method, one per contact [NT98, Van10].
//
// The friction cone of a contact becomes d rows (s, z) by a small matrix T (d x 3): s = T w for a contact velocity w,
// j = T^T z for the impulse; then z . s = j . w, and z, s in the self-dual cone says j in K, w in K*.
//
//   kind        T                                self-dual cone            d
//   kRay        (1 0 0)                          numbers >= 0              1   frictionless; tangents play no part
//   kCircular   diag(1, mu, mu)                  second-order cone         3   |j_t| <= mu j_n
//   kOctagon    eight edges (1, mu cos, mu sin)  eight numbers >= 0        8   [SM04 Eq. 8], as generators of K
//
// What is done with rows in every iteration is in interior_point/row_cones_impl.h, for eight contacts at once.
//   threads: pure functions
#pragma once

#include <array>
#include <cstdint>

#include "qp/problem.h"
#include "qp/settings.h"

namespace islet::qp {

enum class ConeKind : std::uint8_t { kRay, kCircular, kOctagon };

inline constexpr int kMaxRows = 8;

inline constexpr double kAlmost = 0.995;  // of the way to a cone's boundary: as far as methods go that stay inside

struct ContactCone {
  ConeKind kind = ConeKind::kRay;
  double friction = 0;
};

// Of the octagon, between the facets of [SM04 Eq. 8]: cosine and sine of pi/8 + k pi/4.
extern const std::array<std::array<double, 2>, 8> kOctagonEdges;

// The cone of a contact under the given approximation. Friction below 1e-12 counts as none.
ContactCone ChooseCone(double friction, Cone cone);

inline int NumRows(ConeKind kind) { return kind == ConeKind::kRay ? 1 : kind == ConeKind::kCircular ? 3 : 8; }  // d
inline int Degree(ConeKind kind) {
  return kind == ConeKind::kOctagon ? 8 : 1;
}  // of the barrier: 1 for the second-order cone, else d

void MapToRows(const ContactCone& cone, const Vector3& w, double* s);  // s = T w
Vector3 MapFromRows(const ContactCone& cone, const double* z);         // j = T^T z
void Identity(ConeKind kind, double* e);                               // the cone's unit element
// Smallest spectral value: positive inside the cone.
double MinEigenvalue(ConeKind kind, const double* a);

}  // namespace islet::qp
