// What a page asks of a live run, one JSON object a message:
//
//   {"do": "run"}  {"do": "pause"}  {"do": "step"}
//   {"do": "throw", "from": [x, y, z], "velocity": [x, y, z], "radius": r, "density": d}    a ball; [m], [m/s], [m], [kg/m^3]
//   {"do": "drag", "body": b, "at": [x, y, z], "to": [x, y, z]}    a point of the body, in B [m], is pulled to a place [m]
//   {"do": "release"}
//   {"do": "gravity", "value": [x, y, z]}  [m/s^2]        {"do": "friction", "value": mu}  of all bodies
//
//   errors: std::invalid_argument that names the field and the value; a message is read whole before any of it is done
//   limits: kLongestCommand characters, numbers within what a scene can hold; what a ball may be is told to the page, which keeps to it
#pragma once

#include <cstddef>
#include <string_view>

#include "engine/linear_algebra.h"

namespace islet {

inline constexpr size_t kLongestCommand = 4096;

// Of a ball that is thrown. The densest matter has 2.3e4 kg/m^3; a small ball that weighs as much as some bodies of it has more.
inline constexpr double kSmallestBall = 1e-3, kLargestBall = 1e3;   // [m] radius
inline constexpr double kLightestBall = 1e-3, kHeaviestBall = 1e6;  // [kg/m^3]

struct LiveCommand {
  enum class Kind { kRun, kPause, kStep, kThrow, kDrag, kRelease, kGravity, kFriction };
  Kind kind = Kind::kPause;
  int body = -1;                                // drag
  Vector3 from = Vector3::Zero();               // throw: W; drag: at, in B
  Vector3 vector = Vector3::Zero();             // throw: velocity; drag: to; gravity: value
  double radius = 0.5, density = 1, value = 0;  // throw; friction
};

LiveCommand ParseCommand(std::string_view text);

}  // namespace islet
