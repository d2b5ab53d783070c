// Reading what a user gives: every bad value is refused with the body, the field and the value in the message.
//   errors: std::invalid_argument
//   threads: pure functions
#pragma once

#include <string>

#include "engine/body.h"
#include "engine/world.h"

namespace islet {

[[noreturn]] void Reject(const std::string& body, const std::string& field, const std::string& problem);
void RequireFinite(const std::string& body, const std::string& field, const Vector3& value);
void RequireUnit(const std::string& body, const Quaternion& rotation);

// The body of a definition; `name` is what messages call it.
Body MakeBody(const BodyDefinition& definition, const std::string& name);

}  // namespace islet
