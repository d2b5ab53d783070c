#include "qp/cone.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "qp/elementary.h"

namespace islet::qp {

const std::array<std::array<double, 2>, 8> kOctagonEdges = [] {
  std::array<std::array<double, 2>, 8> edges;
  for (int k = 0; k < 8; ++k) {
    const double angle = (0.5 + k) * std::numbers::pi / 4;
    edges[k] = {Cosine(angle), Sine(angle)};
  }
  return edges;
}();

ContactCone ChooseCone(double friction, Cone cone) {
  if (friction < 1e-12) return {ConeKind::kRay, 0};
  return {cone == Cone::kCircular ? ConeKind::kCircular : ConeKind::kOctagon, friction};
}

void MapToRows(const ContactCone& cone, const Vector3& w, double* s) {
  s[0] = w[0];
  if (cone.kind == ConeKind::kCircular) {
    s[1] = cone.friction * w[1];
    s[2] = cone.friction * w[2];
  } else if (cone.kind == ConeKind::kOctagon) {
    for (int k = 0; k < 8; ++k) s[k] = w[0] + cone.friction * (kOctagonEdges[k][0] * w[1] + kOctagonEdges[k][1] * w[2]);
  }
}

Vector3 MapFromRows(const ContactCone& cone, const double* z) {
  if (cone.kind == ConeKind::kRay) return {z[0], 0, 0};
  if (cone.kind == ConeKind::kCircular) return {z[0], cone.friction * z[1], cone.friction * z[2]};
  Vector3 j = Vector3::Zero();
  for (int k = 0; k < 8; ++k)
    j += Vector3(z[k], cone.friction * kOctagonEdges[k][0] * z[k], cone.friction * kOctagonEdges[k][1] * z[k]);
  return j;
}

void Identity(ConeKind kind, double* e) {
  e[0] = 1;
  for (int i = 1; i < NumRows(kind); ++i) e[i] = kind == ConeKind::kOctagon ? 1 : 0;
}

double MinEigenvalue(ConeKind kind, const double* a) {
  if (kind == ConeKind::kCircular) return a[0] - std::sqrt(a[1] * a[1] + a[2] * a[2]);
  return *std::min_element(a, a + NumRows(kind));
}

}  // namespace islet::qp
