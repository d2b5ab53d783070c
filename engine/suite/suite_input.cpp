#include "engine/suite/suite_input.h"

#include <cmath>
#include <stdexcept>
#include <string>

#include "engine/body_definition.h"
#include "engine/number_text.h"
#include "qp/smallness.h"

namespace islet {
namespace {

[[noreturn]] void Reject(const char* what, size_t number, const char* field, const std::string& value,
                         const char* must) {
  throw std::invalid_argument(std::string(what) + " " + std::to_string(number) + ": " + field + " = " + value + must);
}

void Require(bool holds, const char* what, size_t number, const char* field, double value, const char* must = "") {
  if (!holds) Reject(what, number, field, Text(value), must);
}

void RequireFinite(const char* what, size_t number, const char* field, const Vector3& v) {
  if (!v.allFinite()) Reject(what, number, field, Text(v), " is not finite");
}

void RequireWithin(const char* what, size_t number, const char* field, const Vector3& v) {
  if (!(v.array().abs() <= kLargest).all()) Reject(what, number, field, Text(v), " is not finite, or beyond 1e30");
}

// Symmetric, with positive leading minors.
bool IsInertia(const Matrix3& m) {
  return m.allFinite() && (m - m.transpose()).cwiseAbs().maxCoeff() <= kNegligible * m.cwiseAbs().maxCoeff() &&
         m(0, 0) > 0 && m(0, 0) * m(1, 1) - m(0, 1) * m(1, 0) > 0 && m.determinant() > 0;
}

}  // namespace

void CheckSuiteBodies(std::span<const Body> bodies) {
  for (size_t i = 0; i < bodies.size(); ++i) {
    const Body& b = bodies[i];
    if (b.removed) continue;
    RequireFinite("body", i, "position", b.position_W);
    Require(std::abs(b.rotation_WB.norm() - 1) < kSamePoint, "body", i, "length of rotation", b.rotation_WB.norm());
    RequireWithin("body", i, "linear velocity", b.linear_velocity_W);
    RequireWithin("body", i, "angular velocity", b.angular_velocity_W);
    if (b.kind == BodyKind::kFixed)
      Require(b.linear_velocity_W.isZero(0) && b.angular_velocity_W.isZero(0), "body", i, "speed",
              b.linear_velocity_W.norm() + b.angular_velocity_W.norm(),
              " of a fixed body must be zero; make it kinematic");
    if (b.kind != BodyKind::kDynamic) continue;
    Require(b.mass > 0 && std::isfinite(b.mass), "body", i, "mass", b.mass, " must be positive and finite");
    Require(IsInertia(b.inertia_B), "body", i, "inertia: determinant", b.inertia_B.determinant(),
            ", must be symmetric positive definite");
    Require(b.radius >= 0 && std::isfinite(b.radius), "body", i, "radius", b.radius);
    RequireFinite("body", i, "force", b.force_W);
    RequireFinite("body", i, "torque", b.torque_W);
  }
}

void CheckSuiteContacts(std::span<const Contact> contacts, std::span<const Body> bodies) {
  const int num_bodies = static_cast<int>(bodies.size());
  for (size_t c = 0; c < contacts.size(); ++c) {
    const Contact& contact = contacts[c];
    Require(contact.body_a >= 0 && contact.body_a < num_bodies, "contact", c, "body_a", contact.body_a);
    Require(contact.body_b > contact.body_a && contact.body_b < num_bodies, "contact", c, "body_b", contact.body_b);
    for (const int i : {contact.body_a, contact.body_b})
      Require(!bodies[i].removed, "contact", c, "body", i, " is removed");
    RequireFinite("contact", c, "point", contact.point_W);
    const double length = contact.normal_W.norm();
    Require(std::abs(length - 1) < kSamePoint, "contact", c, "length of normal", length);
    Require(std::isfinite(contact.gap), "contact", c, "gap", contact.gap);
    Require(contact.friction >= 0 && contact.friction <= kMostFriction, "contact", c, "friction", contact.friction);
    RequireFinite("contact", c, "surface velocity", contact.surface_W);
    Require(contact.restitution >= 0 && contact.restitution <= 1, "contact", c, "restitution", contact.restitution);
    if (c > 0 && Earlier(contact, contacts[c - 1]))
      throw std::invalid_argument(
          "contact " + std::to_string(c) + ": order: bodies " + std::to_string(contact.body_a) + " and " +
          std::to_string(contact.body_b) + ", feature " + std::to_string(contact.feature) + " come after " +
          std::to_string(contacts[c - 1].body_a) + " and " + std::to_string(contacts[c - 1].body_b) + ", feature " +
          std::to_string(contacts[c - 1].feature) + "; sort by body_a, body_b, feature");
  }
}

}  // namespace islet
