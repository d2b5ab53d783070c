// The self-dual cones of the interior-point method, one per contact, and their Nesterov-Todd scaling [NT98, Van10].
//
// The friction cone of a contact becomes d rows (s, z) by a small matrix T (d x 3): s = T w for a contact velocity w,
// j = T^T z for the impulse; then z . s = j . w, and z, s in the self-dual cone says j in K, w in K*.
//
//   kind        T                                self-dual cone            d
//   kRay        (1 0 0)                          numbers >= 0              1   frictionless; tangents play no part
//   kCircular   diag(1, mu, mu)                  second-order cone         3   |j_t| <= mu j_n
//   kOctagon    eight edges (1, mu cos, mu sin)  eight numbers >= 0        8   [SM04 Eq. 8], as generators of K
//
// Scaling: W symmetric with W z = W^-1 s = lambda. All functions work on the d rows of one contact, in place of
// allocation; `scale` holds the scaling point (d numbers) and, for the second-order cone, eta.
//   threads: pure functions
#pragma once

#include <cstdint>

#include "qp/problem.h"
#include "qp/settings.h"

namespace islet::qp {

enum class ConeKind : std::uint8_t { kRay, kCircular, kOctagon };

inline constexpr int kMaxRows = 8;

struct ContactCone {
  ConeKind kind = ConeKind::kRay;
  double friction = 0;
};

// The cone of a contact under the given approximation. Friction below 1e-12 counts as none.
ContactCone ChooseCone(double friction, Cone cone);

int NumRows(ConeKind kind);  // d
int Degree(ConeKind kind);   // of the barrier: 1 for the second-order cone, else d

void MapToRows(const ContactCone& cone, const Vector3& w, double* s);  // s = T w
Vector3 MapFromRows(const ContactCone& cone, const double* z);         // j = T^T z
void Identity(ConeKind kind, double* e);                               // the cone's unit element

struct Scaling {
  double* point;   // d numbers
  double* lambda;  // d numbers
  double eta;
};
// False if s or z is not inside the cone.
bool UpdateScaling(ConeKind kind, const double* s, const double* z, Scaling* scaling);

Matrix3 ScalingBlock(const ContactCone& cone, const Scaling& scaling);                          // D = T^T W^-2 T
void ApplyScaling(ConeKind kind, const Scaling& scaling, const double* x, double* out);         // W x
void ApplyInverseScaling(ConeKind kind, const Scaling& scaling, const double* x, double* out);  // W^-1 x

void JordanProduct(ConeKind kind, const double* a, const double* b, double* out);      // a o b
void JordanDivide(ConeKind kind, const double* lambda, const double* b, double* out);  // x with lambda o x = b
// Largest step t <= limit with lambda + t direction inside the cone; direction in scaled space.
double MaxStep(ConeKind kind, const double* lambda, const double* direction, double limit);
// Smallest spectral value: positive inside the cone.
double MinEigenvalue(ConeKind kind, const double* a);

}  // namespace islet::qp

#include "qp/cone_algebra.h"  // what is inline
