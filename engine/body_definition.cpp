#include "engine/body_definition.h"

#include <cmath>
#include <stdexcept>

#include <Eigen/Eigenvalues>

#include "engine/number_text.h"

namespace islet {
namespace {

// Squares and products of what a user gives must stay finite.
constexpr double kMostInertia = 1e40;
constexpr double kLongest = 1e6;       // [s]

}  // namespace

void Reject(const std::string& body, const std::string& field, const std::string& problem) {
  throw std::invalid_argument(body + ": " + field + " " + problem);
}

void RequireFinite(const std::string& body, const std::string& field, const Vector3& v) {
  if (v.allFinite() && v.cwiseAbs().maxCoeff() <= kLargest) return;
  Reject(body, field, "= " + Text(v) + (v.allFinite() ? " is beyond 1e30" : " is not finite"));
}

void RequireUnit(const std::string& body, const Quaternion& rotation) {
  const double length = rotation.norm();
  if (!(std::abs(length - 1) < 1e-6)) Reject(body, "rotation", "has length " + Text(length) + ", not 1");
}

void RequirePositive(const std::string& body, const std::string& field, double value) {
  if (!(value > 0) || !std::isfinite(value)) Reject(body, field, "= " + Text(value) + " must be positive and finite");
  if (value > kLargest || value < 1 / kLargest) Reject(body, field, "= " + Text(value) + " is beyond 1e-30 to 1e30");
}

// Also refuses moments that no mass distribution has: each at most the sum of the other two.
void RequireInertia(const std::string& body, const Matrix3& inertia) {
  const Eigen::SelfAdjointEigenSolver<Matrix3> solver(inertia);
  const Vector3& moments = solver.eigenvalues();
  if (!inertia.allFinite() || !inertia.isApprox(inertia.transpose(), 1e-9))
    Reject(body, "inertia", "is not symmetric and finite");
  if (!(moments[0] > 0)) Reject(body, "inertia", "is not positive definite (smallest moment " + Text(moments[0]) + ")");
  if (moments[0] < 1 / kMostInertia || moments[2] > kMostInertia)
    Reject(body, "inertia",
           "has moments of " + Text(moments[0]) + " to " + Text(moments[2]) + ", beyond 1e-40 to 1e40");
  if (moments[2] > (moments[0] + moments[1]) * (1 + 1e-9))
    Reject(body, "inertia", "breaks the triangle inequality: largest moment " + Text(moments[2]));
}

void RequireMaterial(const std::string& body, double friction, double restitution) {
  if (!(friction >= 0 && friction <= kMostFriction))
    Reject(body, "friction", "= " + Text(friction) + " must lie in [0, 1e4]");
  if (!(restitution >= 0 && restitution <= 1))
    Reject(body, "restitution", "= " + Text(restitution) + " must lie in [0, 1]");
}

void RequireStep(double dt) {
  if (!(dt > 0) || !std::isfinite(dt)) throw std::invalid_argument("dt = " + Text(dt) + " must be a positive time");
  if (dt > kLongest) throw std::invalid_argument("dt = " + Text(dt) + " s is beyond 1e6");
}

void RequireKind(const std::string& body, BodyKind kind) {
  if (kind > BodyKind::kDynamic) Reject(body, "kind", "= " + std::to_string(static_cast<int>(kind)) + " is none");
}

MassProperties MassOf(const BodyDefinition& d, const std::string& name) {
  RequireKind(name, d.kind);
  const bool dynamic = d.kind == BodyKind::kDynamic;
  if (d.shape.kind() == ShapeKind::kHalfSpace) {
    if (dynamic) Reject(name, "kind", "= dynamic: a half-space has no mass");
    return {};
  }
  const double given = d.mass.value_or(d.density);
  if (!(given >= 0)) RequirePositive(name, d.mass ? "mass" : "density", given);  // 0 and infinity are a wall's
  if (!dynamic && !(given > 0 && given <= kLargest)) return d.shape.MassFromDensity(1);
  if (d.mass) RequirePositive(name, "mass", *d.mass);
  if (dynamic || !d.mass) RequirePositive(name, "density", d.density);
  if (!d.mass) RequirePositive(name, "mass of its density", d.density * d.shape.Volume());
  MassProperties mass = d.mass ? d.shape.MassFromMass(*d.mass) : d.shape.MassFromDensity(d.density);
  mass.inertia_B = d.inertia_B.value_or(mass.inertia_B);
  if (dynamic || d.inertia_B) RequireInertia(name, mass.inertia_B);
  return mass;
}

Body MakeBody(const BodyDefinition& d, const MassProperties& mass, const std::string& name) {
  RequireFinite(name, "position", d.position_W);
  RequireFinite(name, "linear velocity", d.linear_velocity_W);
  RequireFinite(name, "angular velocity", d.angular_velocity_W);
  RequireUnit(name, d.rotation_WB);
  RequireMaterial(name, d.friction, d.restitution);
  Body body;
  body.kind = d.kind;
  body.radius = d.shape.radius();
  if (d.kind == BodyKind::kDynamic) {
    body.mass = mass.mass;
    body.inertia_B = mass.inertia_B;
  }
  body.position_W = d.position_W;
  body.rotation_WB = d.rotation_WB.normalized();
  body.linear_velocity_W = body.linear_before_W = d.linear_velocity_W;
  body.angular_velocity_W = body.angular_before_W = d.angular_velocity_W;
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
