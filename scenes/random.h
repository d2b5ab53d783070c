// Random numbers for the scenes: the same seed gives the same scene with every compiler and library.
//
// splitmix64 (Steele, Lea, Flood 2014): 64 bits of state, one addition and three mixing steps per number. The standard
// library's distributions are not used because their results differ between implementations.
//   threads: one generator per thread
#pragma once

#include <cstdint>

#include "engine/linear_algebra.h"

namespace islet {

class SplitMix64 {
 public:
  explicit SplitMix64(std::uint64_t seed) : state_(seed) {}

  std::uint64_t Next();
  double Uniform(double lower, double upper);  // [lower, upper), 53 random bits
  Vector3 Direction();                         // unit; of a point drawn evenly from the unit ball
  Quaternion Rotation(double largest_angle);   // about a Direction(), by an angle even in (-largest, largest) [rad]

 private:
  std::uint64_t state_;
};

}  // namespace islet
