// The cones of cone.h with one contact in each lane. N is the number of rows: 1 a ray, 3 a second-order cone, 8 the octagon.
// Part of row_kernels_impl.h.
#pragma once

#include "qp/interior_point/row_kernels.h"
#include "qp/linear_algebra/lanes_impl.h"

namespace islet::qp {
namespace {

template <int N>
inline void LoadRows(const Lanes* from, int lane, Vec (&out)[N]) {
  for (int i = 0; i < N; ++i) out[i] = Load(from[i].at + lane);
}
template <int N>
inline void StoreRows(const Vec (&in)[N], int lane, Lanes* to) {
  for (int i = 0; i < N; ++i) Store(to[i].at + lane, in[i]);
}

// (x0 - |x1|)(x0 + |x1|), with less cancellation than x0^2 - |x1|^2.
inline Vec Determinant(const Vec (&x)[3]) {
  const Vec tangent = Root(x[1] * x[1] + x[2] * x[2]);
  return (x[0] - tangent) * (x[0] + tangent);
}

// s = T u.
template <int N>
inline void MapToRows(Vec mu, const double* edges, const Vec (&u)[3], Vec (&s)[N]) {
  if constexpr (N == 8) {
    const Vec u1 = mu * u[1], u2 = mu * u[2];
    for (int k = 0; k < 8; ++k) s[k] = u[0] + (edges[2 * k] * u1 + edges[2 * k + 1] * u2);
  } else {
    s[0] = u[0];
    for (int i = 1; i < N; ++i) s[i] = mu * u[i];
  }
}

// j = T^T z.
template <int N>
inline void MapFromRows(Vec mu, const double* edges, const Vec (&z)[N], Vec (&j)[3]) {
  j[0] = z[0];
  j[1] = j[2] = Vec{};
  if constexpr (N == 8) {
    j[1] = edges[0] * z[0], j[2] = edges[1] * z[0];
    for (int k = 1; k < 8; ++k) {
      j[0] += z[k];
      j[1] += edges[2 * k] * z[k];
      j[2] += edges[2 * k + 1] * z[k];
    }
    j[1] *= mu, j[2] *= mu;
  } else {
    for (int i = 1; i < N; ++i) j[i] = mu * z[i];
  }
}

// x <- W^-1 x. The arrow-shaped W: W x = eta [w.x; x1 + w1 (x0 + w1.x1 / (1 + w0))], w1 -> -w1 for its inverse.
template <int N>
inline void Unscale(const Vec (&point)[N], const Vec (&inverse)[N], Vec (&x)[N]) {
  if constexpr (N == 3) {
    const Vec dot = point[1] * x[1] + point[2] * x[2], share = x[0] - dot * inverse[2];
    x[0] = inverse[1] * (point[0] * x[0] - dot);
    x[1] = inverse[1] * (x[1] - share * point[1]);
    x[2] = inverse[1] * (x[2] - share * point[2]);
  } else {
    for (int i = 0; i < N; ++i) x[i] *= inverse[i];
  }
}

// Nesterov-Todd scaling of s and z; `fails` becomes 1 where one of them is outside its cone.
template <int N>
inline void FindScaling(const Vec (&s)[N], const Vec (&z)[N], Vec (&point)[N], Vec (&inverse)[N], Vec (&lambda)[N],
                        Vec* fails) {
  const Vec zero = {}, one = zero + 1;
  if constexpr (N == 3) {
    const Vec det_s = Determinant(s), det_z = Determinant(z);
    *fails = ((det_s > zero) & (det_z > zero) & (s[0] > zero) & (z[0] > zero)) ? *fails : one;
    const Vec norm_s = Root(det_s), norm_z = Root(det_z), per_s = one / norm_s, per_z = one / norm_z;
    Vec dot = (s[0] * per_s) * (z[0] * per_z);
    for (int i = 1; i < 3; ++i) dot += (s[i] * per_s) * (z[i] * per_z);
    const Vec half = one / (2 * Root((one + dot) * 0.5));
    for (int i = 1; i < 3; ++i) point[i] = (s[i] * per_s - z[i] * per_z) * half;
    point[0] =
        Root(one + (point[1] * point[1] + point[2] * point[2]));  // on the unit hyperboloid, whatever was rounded
    inverse[0] = Root(norm_s * per_z);
    inverse[1] = one / inverse[0];
    inverse[2] = one / (one + point[0]);
    const Vec along = point[1] * z[1] + point[2] * z[2], share = z[0] + along * inverse[2];
    lambda[0] = inverse[0] * (point[0] * z[0] + along);
    for (int i = 1; i < 3; ++i) lambda[i] = inverse[0] * (z[i] + share * point[i]);
  } else {
    for (int i = 0; i < N; ++i) {
      *fails = ((s[i] > zero) & (z[i] > zero)) ? *fails : one;
      point[i] = Root(s[i] / z[i]);
      inverse[i] = one / point[i];
      lambda[i] = Root(s[i] * z[i]);
    }
  }
}

// D = T^T W^-2 T.
template <int N>
inline void ScalingBlock(Vec mu, const double* edges, const Vec (&point)[N], const Vec (&inverse)[N], Vec (&d)[3][3]) {
  for (auto& row : d)
    for (Vec& value : row) value = Vec{};
  if constexpr (N == 1) {
    d[0][0] = inverse[0] * inverse[0];
  } else if constexpr (N == 3) {
    const Vec factor = inverse[1] * inverse[1], v[3] = {point[0], -mu * point[1], -mu * point[2]};
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j) d[i][j] = 2 * factor * v[i] * v[j];
    d[0][0] -= factor;
    d[1][1] += factor * (mu * mu);
    d[2][2] += factor * (mu * mu);
  } else {
    for (int k = 0; k < 8; ++k) {
      const Vec g[3] = {Vec{} + 1, mu * edges[2 * k], mu * edges[2 * k + 1]}, weight = inverse[k] * inverse[k];
      for (int i = 0; i < 3; ++i)
        for (int j = 0; j <= i; ++j) d[i][j] += weight * (g[i] * g[j]);
    }
    d[0][1] = d[1][0], d[0][2] = d[2][0], d[1][2] = d[2][1];
  }
}

// out = a o b.
template <int N>
inline void JordanProduct(const Vec (&a)[N], const Vec (&b)[N], Vec (&out)[N]) {
  if constexpr (N == 3) {
    out[0] = a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    out[1] = a[0] * b[1] + b[0] * a[1];
    out[2] = a[0] * b[2] + b[0] * a[2];
  } else {
    for (int i = 0; i < N; ++i) out[i] = a[i] * b[i];
  }
}

// x <- the solution of lambda o y = x.
template <int N>
inline void JordanDivide(const Vec (&lambda)[N], Vec (&x)[N]) {
  if constexpr (N == 3) {
    const Vec first = (lambda[0] * x[0] - lambda[1] * x[1] - lambda[2] * x[2]) / Determinant(lambda);
    const Vec per = (Vec{} + 1) / lambda[0];
    x[0] = first;
    x[1] = (x[1] - first * lambda[1]) * per;
    x[2] = (x[2] - first * lambda[2]) * per;
  } else {
    for (int i = 0; i < N; ++i) x[i] /= lambda[i];
  }
}

// Of the larger of `bound` and 1 / the longest step from lambda along a direction in scaled space. A number that is none loses.
template <int N>
inline Vec StepBound(const Vec (&lambda)[N], const Vec (&direction)[N], Vec bound) {
  if constexpr (N == 3) {
    // Transform lambda to the unit element; the step then follows from the smaller spectral value of the direction.
    const Vec per = (Vec{} + 1) / Root(Determinant(lambda));
    const Vec l[3] = {lambda[0] * per, lambda[1] * per, lambda[2] * per};
    const Vec dot = l[0] * direction[0] - l[1] * direction[1] - l[2] * direction[2];
    const Vec share = (dot + direction[0]) / (1 + l[0]);
    const Vec y = direction[1] - share * l[1], z = direction[2] - share * l[2];
    return Max((Root(y * y + z * z) - dot) * per, bound);
  } else {
    for (int i = 0; i < N; ++i) bound = Max(-direction[i] / lambda[i], bound);
    return bound;
  }
}

// What a spectral value lacks to lie in [low, high]; no value falls by more than `high`.
inline Vec Lack(Vec value, double low, double high) {
  const Vec zero = {};
  const Vec above = Max(high - value, zero - high);
  return value < low ? low - value : value > high ? above : zero;
}

// Replaces the spectral values of x by what they lack.                                                          [Gon96]
template <int N>
inline void BandCorrection(double low, double high, Vec (&x)[N]) {
  if constexpr (N == 3) {
    const Vec zero = {}, tangent = Root(x[1] * x[1] + x[2] * x[2]);
    const Vec small = Lack(x[0] - tangent, low, high), large = Lack(x[0] + tangent, low, high);
    const Vec share = tangent > zero ? (large - small) / (2 * tangent) : zero;
    x[0] = (large + small) * 0.5;
    x[1] *= share;
    x[2] *= share;
  } else {
    for (int i = 0; i < N; ++i) x[i] = Lack(x[i], low, high);
  }
}

// inverse = (I + D R)^-1 and D <- inverse D. Similar to a positive definite matrix, so that no pivots have to be sought. By
// rows, I + D R is well scaled even where D spans many orders; updating D by a matrix of rank one instead would lose its
// small part.
inline void Soften(Vec compliance, Vec (&d)[3][3], Vec (&inverse)[3][3]) {
  Vec m[3][3];
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) {
      m[i][j] = d[i][j] * compliance;
      inverse[i][j] = Vec{};
    }
    m[i][i] += 1;
    inverse[i][i] += 1;
  }
  for (int k = 0; k < 3; ++k) {
    const Vec per = (Vec{} + 1) / m[k][k];
    for (int j = 0; j < 3; ++j) m[k][j] *= per, inverse[k][j] *= per, d[k][j] *= per;
    for (int i = 0; i < 3; ++i) {
      if (i == k) continue;
      const Vec share = m[i][k];
      for (int j = 0; j < 3; ++j) {
        m[i][j] -= share * m[k][j];
        inverse[i][j] -= share * inverse[k][j];
        d[i][j] -= share * d[k][j];
      }
    }
  }
  d[1][0] = d[0][1], d[2][0] = d[0][2], d[2][1] = d[1][2];  // the other half has lost digits
}

}  // namespace
}  // namespace islet::qp
