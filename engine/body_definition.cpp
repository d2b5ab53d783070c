#include "engine/body_definition.h"

#include <cmath>
#include <stdexcept>

#include <Eigen/Eigenvalues>

namespace islet {

void Reject(const std::string& body, const std::string& field, const std::string& problem) {
  throw std::invalid_argument(body + ": " + field + " " + problem);
}

void RequireFinite(const std::string& body, const std::string& field, const Vector3& v) {
  if (v.allFinite()) return;
  Reject(
      body, field,
      "= (" + std::to_string(v.x()) + ", " + std::to_string(v.y()) + ", " + std::to_string(v.z()) + ") is not finite");
}

void RequireUnit(const std::string& body, const Quaternion& rotation) {
  const double length = rotation.norm();
  if (!(std::abs(length - 1) < 1e-6)) Reject(body, "rotation", "has length " + std::to_string(length) + ", not 1");
}

namespace {

constexpr double kMostFriction = 1e6;  // the product of two must stay finite

void RequirePositive(const std::string& body, const std::string& field, double value) {
  if (!(value > 0) || !std::isfinite(value))
    Reject(body, field, "= " + std::to_string(value) + " must be positive and finite");
}

// Also refuses moments that no mass distribution has: each at most the sum of the other two.
void RequireInertia(const std::string& body, const Matrix3& inertia) {
  const Eigen::SelfAdjointEigenSolver<Matrix3> solver(inertia);
  const Vector3 moments = solver.eigenvalues();
  if (!inertia.allFinite() || !inertia.isApprox(inertia.transpose(), 1e-9) || !(moments[0] > 0))
    Reject(body, "inertia", "is not symmetric positive definite (smallest moment " + std::to_string(moments[0]) + ")");
  if (moments[2] > (moments[0] + moments[1]) * (1 + 1e-9))
    Reject(body, "inertia", "breaks the triangle inequality: largest moment " + std::to_string(moments[2]));
}

}  // namespace

Body MakeBody(const BodyDefinition& d, const std::string& name) {
  RequireFinite(name, "position", d.position_W);
  RequireFinite(name, "linear velocity", d.linear_velocity_W);
  RequireFinite(name, "angular velocity", d.angular_velocity_W);
  RequireUnit(name, d.rotation_WB);
  if (!(d.friction >= 0 && d.friction <= kMostFriction))
    Reject(name, "friction", "= " + std::to_string(d.friction) + " must lie in [0, 1e6]");
  if (!(d.restitution >= 0 && d.restitution <= 1))
    Reject(name, "restitution", "= " + std::to_string(d.restitution) + " must lie in [0, 1]");
  if (d.shape.kind() == ShapeKind::kHalfSpace && d.kind == BodyKind::kDynamic)
    Reject(name, "kind", "= dynamic: a half-space has no mass");
  Body body;
  body.kind = d.kind;
  body.radius = d.shape.radius();
  if (d.kind == BodyKind::kDynamic) {
    if (d.mass) RequirePositive(name, "mass", *d.mass);
    RequirePositive(name, "density", d.density);
    const MassProperties filled = d.mass ? d.shape.MassFromMass(*d.mass) : d.shape.MassFromDensity(d.density);
    body.mass = filled.mass;
    body.inertia_B = d.inertia_B.value_or(filled.inertia_B);
    RequireInertia(name, body.inertia_B);
  }
  body.position_W = d.position_W;
  body.rotation_WB = d.rotation_WB.normalized();
  body.linear_velocity_W = d.linear_velocity_W;
  body.angular_velocity_W = d.angular_velocity_W;
  if (d.kind == BodyKind::kFixed && !(d.linear_velocity_W.isZero(0) && d.angular_velocity_W.isZero(0)))
    Reject(name, "velocity", "of a fixed body must be zero; make it kinematic");
  body.friction = d.friction;
  body.restitution = d.restitution;
  return body;
}

}  // namespace islet
