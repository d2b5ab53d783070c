// Reading what a user gives: every bad value is refused with the body, the field and the value in the message.
//   errors: std::invalid_argument
//   threads: pure functions
#pragma once

#include <string>

#include "engine/body.h"
#include "engine/world.h"

namespace islet {

inline constexpr double kLargest = 1e30;      // of what a user gives: squares stay finite
inline constexpr double kMostFriction = 1e4;  // where more is given rounding leaves the cones

[[noreturn]] void Reject(const std::string& body, const std::string& field, const std::string& problem);
void RequireFinite(const std::string& body, const std::string& field, const Vector3& value);
void RequirePositive(const std::string& body, const std::string& field, double value);
void RequireInertia(const std::string& body, const Matrix3& inertia_B);
void RequireMaterial(const std::string& body, double friction, double restitution);
void RequireKind(const std::string& body, BodyKind kind);
void RequireStep(double dt);  // [s] > 0
void RequireUnit(const std::string& body, const Quaternion& rotation);

// What the body of a definition weighs, or would were it dynamic; of a fixed body whose mass or density is no number to go by: that of density 1.
// `name` is what messages call it.
MassProperties MassOf(const BodyDefinition& definition, const std::string& name);
// The body, of that mass where it is dynamic.
Body MakeBody(const BodyDefinition& definition, const MassProperties& mass, const std::string& name);

}  // namespace islet
