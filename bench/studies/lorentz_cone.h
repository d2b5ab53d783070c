// Arithmetic of the cone x_0 >= |(x_1, x_2)|: Jordan product and its inverse, Nesterov-Todd scaling, way to the boundary.  [NT98]
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <limits>

namespace islet::studies::lorentz {

using Vector3 = Eigen::Vector3d;
using Matrix3 = Eigen::Matrix3d;

inline double Determinant(const Vector3& x) {
  const double tail = std::hypot(x[1], x[2]);
  return (x[0] - tail) * (x[0] + tail);
}

inline Vector3 Mirror(const Vector3& x) { return {x[0], -x[1], -x[2]}; }

inline Vector3 Product(const Vector3& x, const Vector3& y) {
  return {x.dot(y), x[0] * y[1] + y[0] * x[1], x[0] * y[2] + y[0] * x[2]};
}

// y with Product(x, y) = d.
inline Vector3 Quotient(const Vector3& d, const Vector3& x) {
  const double first = Mirror(x).dot(d) / Determinant(x);
  return {first, (d[1] - first * x[1]) / x[0], (d[2] - first * x[2]) / x[0]};
}

// Largest step with x + step d in the cone; x inside.
inline double StepToBoundary(const Vector3& x, const Vector3& d) {
  const double root = std::sqrt(Determinant(x));
  const Vector3 unit = x / root, scaled = d / root;
  const double first = Mirror(unit).dot(scaled);
  const Eigen::Vector2d rest = scaled.tail<2>() - (first + scaled[0]) / (unit[0] + 1) * unit.tail<2>();
  const double rate = rest.norm() - first;
  return rate > 0 ? 1 / rate : std::numeric_limits<double>::infinity();
}

// Symmetric W with W z = W^-1 s.
struct Scaling {
  Matrix3 w, inverse;
  Matrix3 inverse_squared;  // for the matrix; vectors: InverseTwice

  Scaling(const Vector3& s, const Vector3& z) {
    const double det_s = Determinant(s), det_z = Determinant(z);
    const Vector3 s_unit = s / std::sqrt(det_s), z_unit = z / std::sqrt(det_z);
    const double gamma = std::sqrt(0.5 * (1 + s_unit.dot(z_unit)));
    Vector3 p = (s_unit + Mirror(z_unit)) / (2 * gamma);
    p[0] = std::sqrt(1 + p.tail<2>().squaredNorm());  // det p = 1: near the boundary rounding moves it
    const double eta = std::pow(det_s / det_z, 0.25);
    w = eta * Boost(p);
    inverse = Boost(Mirror(p)) / eta;
    inverse_squared = inverse * inverse;
  }

  // W^-2 x to more digits than inverse_squared * x: the condition of W^2 is up to the square of that of W.
  Vector3 InverseTwice(const Vector3& x) const { return inverse * (inverse * x); }

 private:
  static Matrix3 Boost(const Vector3& p) {
    Matrix3 m;
    const Eigen::Vector2d tail = p.tail<2>();
    m(0, 0) = p[0];
    m.bottomLeftCorner<2, 1>() = tail;
    m.topRightCorner<1, 2>() = tail.transpose();
    m.bottomRightCorner<2, 2>() = Eigen::Matrix2d::Identity() + tail * tail.transpose() / (1 + p[0]);
    return m;
  }
};

}  // namespace islet::studies::lorentz
