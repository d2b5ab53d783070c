// The algebra of one contact's cone, plainly, as reference for the kernels that take eight contacts at once: Nesterov-Todd scaling W,
// symmetric with W z = W^-1 s = lambda, and the Jordan product. `scale` holds the scaling point (d numbers) and, for the second-order
// cone, eta.                                                                                                     [NT98, Van10]
#pragma once

#include <algorithm>
#include <cmath>

#include "qp/cone.h"

namespace islet::qp {

struct Scaling {
  double* point;   // d numbers
  double* lambda;  // d numbers
  double eta;
};

inline double Square(double x) { return x * x; }

// (x0 - |x1|)(x0 + |x1|), with less cancellation than x0^2 - |x1|^2.
inline double Determinant(const double* x) {
  const double tangent = std::sqrt(Square(x[1]) + Square(x[2]));
  return (x[0] - tangent) * (x[0] + tangent);
}

// (2 w w^T - J) of a unit hyperbolic w is the square of the arrow-shaped W; W x = [w.x; x1 + w1 (x0 + w1.x1/(1+w0))].
inline void ApplyArrow(const double* w, double sign, const double* x, double factor, double* out) {
  const double dot = sign * (w[1] * x[1] + w[2] * x[2]);
  const double first = w[0] * x[0] + dot;
  const double share = sign * (x[0] + dot / (1 + w[0]));
  out[1] = factor * (x[1] + share * w[1]);
  out[2] = factor * (x[2] + share * w[2]);
  out[0] = factor * first;
}

inline void ApplyScaling(ConeKind kind, const Scaling& scaling, const double* x, double* out) {
  if (kind == ConeKind::kCircular) return ApplyArrow(scaling.point, 1, x, scaling.eta, out);
  for (int i = 0; i < NumRows(kind); ++i) out[i] = scaling.point[i] * x[i];
}

inline void ApplyInverseScaling(ConeKind kind, const Scaling& scaling, const double* x, double* out) {
  if (kind == ConeKind::kCircular) return ApplyArrow(scaling.point, -1, x, 1 / scaling.eta, out);
  for (int i = 0; i < NumRows(kind); ++i) out[i] = x[i] / scaling.point[i];
}

// False if s or z is not inside the cone.
inline bool UpdateScaling(ConeKind kind, const double* s, const double* z, Scaling* scaling) {
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

inline Matrix3 ScalingBlock(const ContactCone& cone, const Scaling& scaling) {
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

inline void JordanProduct(ConeKind kind, const double* a, const double* b, double* out) {
  if (kind != ConeKind::kCircular) {
    for (int i = 0; i < NumRows(kind); ++i) out[i] = a[i] * b[i];
    return;
  }
  const double first = a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
  const double y = a[0] * b[1] + b[0] * a[1], z = a[0] * b[2] + b[0] * a[2];
  out[0] = first, out[1] = y, out[2] = z;
}

inline void JordanDivide(ConeKind kind, const double* lambda, const double* b, double* out) {
  if (kind != ConeKind::kCircular) {
    for (int i = 0; i < NumRows(kind); ++i) out[i] = b[i] / lambda[i];
    return;
  }
  const double first = (lambda[0] * b[0] - lambda[1] * b[1] - lambda[2] * b[2]) / Determinant(lambda);
  const double y = (b[1] - first * lambda[1]) / lambda[0], z = (b[2] - first * lambda[2]) / lambda[0];
  out[0] = first, out[1] = y, out[2] = z;
}

inline double MaxStep(ConeKind kind, const double* lambda, const double* direction, double limit) {
  double inverse = 0;  // 1 / step
  if (kind != ConeKind::kCircular) {
    for (int i = 0; i < NumRows(kind); ++i) inverse = std::max(inverse, -direction[i] / lambda[i]);
  } else {
    // Transform lambda to the unit element; the step then follows from the smaller spectral value of the direction.
    const double norm = std::sqrt(Determinant(lambda));
    const double l[3] = {lambda[0] / norm, lambda[1] / norm, lambda[2] / norm};
    const double dot = l[0] * direction[0] - l[1] * direction[1] - l[2] * direction[2];
    const double share = (dot + direction[0]) / (1 + l[0]);
    const double y = direction[1] - share * l[1], z = direction[2] - share * l[2];
    inverse = std::max(0.0, (std::sqrt(y * y + z * z) - dot) / norm);
  }
  return inverse * limit > 1 ? 1 / inverse : limit;
}

// Mehrotra's corrector: the target, in scaled space, that leads to s o z = goal e, with what the direction (ds, dz) leaves of
// second order taken off.
inline void AimAtCentre(ConeKind kind, const double* lambda, const double* ds, const double* dz, double goal,
                        double* target) {
  double unit[kMaxRows], product[kMaxRows];
  JordanProduct(kind, ds, dz, product);
  Identity(kind, unit);
  for (int i = 0; i < NumRows(kind); ++i) product[i] = goal * unit[i] - product[i];
  JordanDivide(kind, lambda, product, product);
  for (int i = 0; i < NumRows(kind); ++i) target[i] = product[i] - lambda[i];
}

// Replaces the spectral values of v by what they lack to lie in [low, high]; no value falls by more than `high`.
inline void BandCorrection(ConeKind kind, double low, double high, double* v) {
  const auto lack = [&](double value) {
    return value < low ? low - value : value > high ? std::max(high - value, -high) : 0.0;
  };
  if (kind != ConeKind::kCircular) {
    for (int i = 0; i < NumRows(kind); ++i) v[i] = lack(v[i]);
    return;
  }
  const double tangent = std::sqrt(v[1] * v[1] + v[2] * v[2]);
  const double small = lack(v[0] - tangent), large = lack(v[0] + tangent);
  const double share = tangent > 0 ? (large - small) / (2 * tangent) : 0;
  v[0] = (large + small) / 2;
  v[1] *= share;
  v[2] *= share;
}

// Adds to the target what pulls the products after the step (ds, dz) back into the band [low, high].            [Gon96]
inline void CorrectCentrality(ConeKind kind, const double* lambda, const double* ds, const double* dz, double low,
                              double high, double* target) {
  double a[kMaxRows], b[kMaxRows];
  for (int i = 0; i < NumRows(kind); ++i) {
    a[i] = lambda[i] + ds[i];
    b[i] = lambda[i] + dz[i];
  }
  JordanProduct(kind, a, b, a);
  BandCorrection(kind, low, high, a);
  JordanDivide(kind, lambda, a, a);
  for (int i = 0; i < NumRows(kind); ++i) target[i] += a[i];
}

}  // namespace islet::qp
