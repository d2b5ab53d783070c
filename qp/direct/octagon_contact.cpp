#include "qp/direct/octagon_contact.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include <Eigen/LU>

#include "qp/direct/one_contact.h"
#include "qp/elementary.h"
#include "qp/slip.h"
#include "qp/smallness.h"

namespace islet::qp {
namespace {

// The facet between the edges k - 1 and k faces this way.
const std::array<Vector3, 8> kFacets = [] {
  std::array<Vector3, 8> facets;
  for (int k = 0; k < 8; ++k) facets[k] = {0, Cosine(k * std::numbers::pi / 4), Sine(k * std::numbers::pi / 4)};
  return facets;
}();

Vector3 ToEdge(int k) { return {0, kOctagonEdges[k % 8][0], kOctagonEdges[k % 8][1]}; }

}  // namespace

OctagonContact::OctagonContact(const Matrix3& w, double friction) : w_(w), friction_(friction) {}

Vector3 OctagonContact::Edge(int k) const { return Vector3::UnitX() + friction_ * ToEdge(k); }

OctagonContact::Matrix OctagonContact::Span(int face) const {
  if (face == 0) return Matrix3::Identity();
  const int k = (face - 1) % 8;
  if (face > 8) return Edge(k);
  Eigen::Matrix<double, 3, 2> facet;
  facet << Edge(k), Edge(k + 1);
  return facet;
}

OctagonContact::Matrix OctagonContact::Opens(int face) const {
  if (face == 0) return Matrix3::Identity();
  if (face > 8) return Vector3::UnitX().transpose();
  Eigen::Matrix<double, 2, 3> facet;  // its edges are equally far behind
  facet << Vector3::UnitX().transpose(), (ToEdge(face - 1) - ToEdge(face)).transpose();
  return facet;
}

// How far the impulse is from lying in the cone, the dual velocity in the dual cone, and both from being perpendicular; of their
// sizes.
double OctagonContact::Missed(const Vector3& q, const Vector3& impulse, const Vector3& dual) const {
  double outside = 0, below = 0;
  for (int k = 0; k < 8; ++k) {
    outside = std::max(outside, kFacets[k].dot(impulse) - friction_ * Cosine(std::numbers::pi / 8) * impulse[0]);
    below = std::max(below, -Edge(k).dot(dual));
  }
  // (What is nearly zero is measured by what made it so.)
  const double force = impulse.norm(), speed = std::max(q.norm(), (w_ * impulse).norm());
  const double missed = std::max({outside / force, below / speed, std::abs(impulse.dot(dual)) / (force * speed)});
  return std::isfinite(missed) ? missed : INFINITY;
}

bool OctagonContact::SolveConvex(const Vector3& q, Vector3* impulse) const {
  double multiplier;
  return SolveKinetic(q, -INFINITY, impulse, &multiplier);
}

bool OctagonContact::SolveCoulomb(const Vector3& q, Vector3* impulse) const {
  impulse->setZero();
  if (q[0] >= 0) return true;
  for (int face = 0; face < kFaces; ++face) {
    const Matrix span = Span(face), opens = Opens(face), system = opens * w_ * span;
    *impulse = span * system.partialPivLu().solve(-opens * q);
    const Vector3 u = w_ * *impulse + q;
    if (Missed(q, *impulse, u + Slip(u, friction_, Cone::kOctagon) * Vector3::UnitX()) <= kRefined) return true;
  }
  return false;
}

// On a face j = span (y + multiplier z), where y holds without the multiplier and z is what one does.
bool OctagonContact::SolveKinetic(const Vector3& q, double target, Vector3* impulse, double* multiplier) const {
  impulse->setZero();
  *multiplier = 0;
  bool opens = q[0] >= target;
  for (int k = 0; k < 8; ++k) opens = opens && Edge(k).dot(q) >= 0;
  if (opens) return true;
  for (int face = 0; face < kFaces; ++face) {
    const Matrix span = Span(face);
    const auto system = Matrix(span.transpose() * w_ * span).partialPivLu();
    *multiplier = 0;
    *impulse = span * system.solve(-span.transpose() * q);
    const double gained = w_.row(0).dot(*impulse) + q[0];
    if (gained < target) {
      const Vector3 by_one = span * system.solve(span.transpose() * w_.col(0));
      *multiplier = (target - gained) / w_.row(0).dot(by_one);
      *impulse += *multiplier * by_one;
    }
    const Vector3 dual = w_ * (*impulse - *multiplier * Vector3::UnitX()) + q;
    if (*multiplier >= 0 && Missed(q, *impulse, dual) <= kRefined) return true;
  }
  return false;
}

}  // namespace islet::qp
