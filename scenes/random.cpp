#include "scenes/random.h"

#include "engine/rotation.h"

namespace islet {

std::uint64_t SplitMix64::Next() {
  state_ += 0x9e3779b97f4a7c15u;
  std::uint64_t z = state_;
  z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
  z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
  return z ^ (z >> 31);
}

double SplitMix64::Uniform(double lower, double upper) {
  const double unit = static_cast<double>(Next() >> 11) * 0x1p-53;
  return lower + (upper - lower) * unit;
}

Vector3 SplitMix64::Direction() {
  for (;;) {
    Vector3 point;
    for (int k = 0; k < 3; ++k) point[k] = Uniform(-1, 1);  // one by one: the order of the draws is part of the scene
    const double length = point.norm();
    if (length <= 1 && length > 1e-6) return point / length;
  }
}

Quaternion SplitMix64::Rotation(double largest_angle) {
  const Vector3 axis = Direction();
  const double angle = Uniform(-largest_angle, largest_angle);
  return Exp(angle * axis);
}

}  // namespace islet
