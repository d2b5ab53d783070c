// The vector types that cross the public interface. None of them needs more than the alignment of a double, whatever
// vector extensions the library or its user is compiled for: layouts agree between the two (Eigen's alignment rules
// change with -mavx, and a Quaterniond would then move).
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>

namespace islet {

using Vector3 = Eigen::Vector3d;                                 // 24 bytes, never over-aligned
using Matrix3 = Eigen::Matrix3d;                                 // 72 bytes, never over-aligned
using Quaternion = Eigen::Quaternion<double, Eigen::DontAlign>;  // w + xi + yj + zk, unit length

}  // namespace islet
