#include "qp/cone.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

namespace islet::qp {

const std::array<std::array<double, 2>, 8> kOctagonEdges = [] {
  std::array<std::array<double, 2>, 8> edges;
  for (int k = 0; k < 8; ++k) {
    const double angle = (0.5 + k) * std::numbers::pi / 4;
    edges[k] = {std::cos(angle), std::sin(angle)};
  }
  return edges;
}();

ContactCone ChooseCone(double friction, Cone cone) {
  if (friction < 1e-12) return {ConeKind::kRay, 0};
  return {cone == Cone::kCircular ? ConeKind::kCircular : ConeKind::kOctagon, friction};
}

bool UpdateScaling(ConeKind kind, const double* s, const double* z, Scaling* scaling) {
  if (kind != ConeKind::kCircular) {
    for (int i = 0; i < NumRows(kind); ++i) {
      if (!(s[i] > 0) || !(z[i] > 0)) return false;
      scaling->point[i] = std::sqrt(s[i] / z[i]);
      scaling->lambda[i] = std::sqrt(s[i] * z[i]);
    }
    scaling->eta = 1;
    return true;
  }
  const double det_s = Determinant(s), det_z = Determinant(z);
  if (!(det_s > 0) || !(det_z > 0) || !(s[0] > 0) || !(z[0] > 0)) return false;
  const double norm_s = std::sqrt(det_s), norm_z = std::sqrt(det_z);
  double dot = 0;
  for (int i = 0; i < 3; ++i) dot += (s[i] / norm_s) * (z[i] / norm_z);
  const double gamma = std::sqrt((1 + dot) / 2);
  double* w = scaling->point;
  w[0] = (s[0] / norm_s + z[0] / norm_z) / (2 * gamma);
  for (int i = 1; i < 3; ++i) w[i] = (s[i] / norm_s - z[i] / norm_z) / (2 * gamma);
  w[0] = std::sqrt(1 + Square(w[1]) + Square(w[2]));  // exactly on the unit hyperboloid, whatever was rounded
  scaling->eta = std::sqrt(norm_s / norm_z);
  ApplyArrow(w, 1, z, scaling->eta, scaling->lambda);
  return true;
}

Matrix3 ScalingBlock(const ContactCone& cone, const Scaling& scaling) {
  Matrix3 block = Matrix3::Zero();
  const double* w = scaling.point;
  if (cone.kind == ConeKind::kRay) {
    block(0, 0) = 1 / Square(w[0]);
  } else if (cone.kind == ConeKind::kCircular) {
    const double mu = cone.friction, factor = 1 / Square(scaling.eta);
    const double v[3] = {w[0], -mu * w[1], -mu * w[2]};
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j) block(i, j) = 2 * factor * v[i] * v[j];
    block(0, 0) -= factor;
    block(1, 1) += factor * mu * mu;
    block(2, 2) += factor * mu * mu;
  } else {
    for (int k = 0; k < 8; ++k) {
      const Vector3 g(1, cone.friction * kOctagonEdges[k][0], cone.friction * kOctagonEdges[k][1]);
      block += g * g.transpose() / Square(w[k]);
    }
  }
  return block;
}

double MinEigenvalue(ConeKind kind, const double* a) {
  if (kind == ConeKind::kCircular) return a[0] - std::sqrt(Square(a[1]) + Square(a[2]));
  return *std::min_element(a, a + NumRows(kind));
}

}  // namespace islet::qp
