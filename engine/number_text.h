// Numbers as messages show them: short, and never rounded to zero.
#pragma once

#include <cstdio>
#include <string>

#include "engine/linear_algebra.h"

namespace islet {

inline std::string Text(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%g", value);
  return text;
}
inline std::string Text(const Vector3& v) {
  char text[80];
  std::snprintf(text, sizeof text, "(%g, %g, %g)", v.x(), v.y(), v.z());
  return text;
}

}  // namespace islet
