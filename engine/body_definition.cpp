#include "engine/body_definition.h"

#include <cmath>
#include <cstdio>
#include <stdexcept>

#include <Eigen/Eigenvalues>

namespace islet {
namespace {

// Squares and products of what a user gives must stay finite.
constexpr double kMost = 1e30;
constexpr double kMostInertia = 1e40;
constexpr double kLongest = 1e6;       // [s]
constexpr double kMostFriction = 1e6;  // the product of two must stay finite

std::string Text(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%g", value);
  return text;
}

}  // namespace

void Reject(const std::string& body, const std::string& field, const std::string& problem) {
  throw std::invalid_argument(body + ": " + field + " " + problem);
}

void RequireFinite(const std::string& body, const std::string& field, const Vector3& v) {
  if (v.allFinite() && v.cwiseAbs().maxCoeff() <= kMost) return;
  const std::string value = "= (" + Text(v.x()) + ", " + Text(v.y()) + ", " + Text(v.z()) + ")";
  Reject(body, field, value + (v.allFinite() ? " is beyond 1e30" : " is not finite"));
}

void RequireUnit(const std::string& body, const Quaternion& rotation) {
  const double length = rotation.norm();
  if (!(std::abs(length - 1) < 1e-6)) Reject(body, "rotation", "has length " + Text(length) + ", not 1");
}

void RequirePositive(const std::string& body, const std::string& field, double value) {
  if (!(value > 0) || !std::isfinite(value)) Reject(body, field, "= " + Text(value) + " must be positive and finite");
  if (value > kMost || value < 1 / kMost) Reject(body, field, "= " + Text(value) + " is beyond 1e-30 to 1e30");
}

// Also refuses moments that no mass distribution has: each at most the sum of the other two.
void RequireInertia(const std::string& body, const Matrix3& inertia) {
  const Eigen::SelfAdjointEigenSolver<Matrix3> solver(inertia);
  const Vector3 moments = solver.eigenvalues();
  if (!inertia.allFinite() || !inertia.isApprox(inertia.transpose(), 1e-9) || !(moments[0] > 0))
    Reject(body, "inertia", "is not symmetric positive definite (smallest moment " + Text(moments[0]) + ")");
  if (moments[0] < 1 / kMostInertia || moments[2] > kMostInertia)
    Reject(body, "inertia",
           "has moments of " + Text(moments[0]) + " to " + Text(moments[2]) + ", beyond 1e-40 to 1e40");
  if (moments[2] > (moments[0] + moments[1]) * (1 + 1e-9))
    Reject(body, "inertia", "breaks the triangle inequality: largest moment " + Text(moments[2]));
}

void RequireMaterial(const std::string& body, double friction, double restitution) {
  if (!(friction >= 0 && friction <= kMostFriction))
    Reject(body, "friction", "= " + Text(friction) + " must lie in [0, 1e6]");
  if (!(restitution >= 0 && restitution <= 1))
    Reject(body, "restitution", "= " + Text(restitution) + " must lie in [0, 1]");
}

void RequireStep(double dt) {
  if (!(dt > 0) || !std::isfinite(dt)) throw std::invalid_argument("dt = " + Text(dt) + " must be a positive time");
  if (dt > kLongest) throw std::invalid_argument("dt = " + Text(dt) + " s is beyond 1e6");
}

MassProperties MassOf(const BodyDefinition& d, const std::string& name) {
  if (d.shape.kind() == ShapeKind::kHalfSpace) return {};
  const auto weighs = [](double value) { return value > 0 && value <= kMost; };
  if (d.kind != BodyKind::kDynamic && !weighs(d.mass.value_or(d.density))) return d.shape.MassFromDensity(1);
  if (d.mass)
    RequirePositive(name, "mass", *d.mass);
  else
    RequirePositive(name, "density", d.density);
  if (!d.mass) RequirePositive(name, "mass of its density", d.density * d.shape.Volume());
  MassProperties filled = d.mass ? d.shape.MassFromMass(*d.mass) : d.shape.MassFromDensity(d.density);
  if (d.inertia_B) {
    RequireInertia(name, *d.inertia_B);
    filled.inertia_B = *d.inertia_B;
  }
  return filled;
}

void RequireKind(const std::string& body, BodyKind kind) {
  if (kind > BodyKind::kDynamic) Reject(body, "kind", "= " + std::to_string(static_cast<int>(kind)) + " is none");
}

Body MakeBody(const BodyDefinition& d, const std::string& name) {
  RequireKind(name, d.kind);
  RequireFinite(name, "position", d.position_W);
  RequireFinite(name, "linear velocity", d.linear_velocity_W);
  RequireFinite(name, "angular velocity", d.angular_velocity_W);
  RequireUnit(name, d.rotation_WB);
  RequireMaterial(name, d.friction, d.restitution);
  if (d.shape.kind() == ShapeKind::kHalfSpace && d.kind == BodyKind::kDynamic)
    Reject(name, "kind", "= dynamic: a half-space has no mass");
  Body body;
  body.kind = d.kind;
  body.radius = d.shape.radius();
  if (d.kind == BodyKind::kDynamic) {
    RequirePositive(name, "density", d.density);
    const MassProperties mass = MassOf(d, name);
    body.mass = mass.mass;
    body.inertia_B = mass.inertia_B;
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
  body.layers = d.layers;
  body.collides_with = d.collides_with;
  body.sensor = d.sensor;
  return body;
}

}  // namespace islet
