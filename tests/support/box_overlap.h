// The judge of overlaps of boxes: written apart from box_box.cpp, by projecting corners, and slow on purpose.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>

#include "engine/geometry/narrow_phase.h"

namespace islet::testing {

// [m] extent of a box along a unit direction, as an interval over its eight corners relative to an origin.
inline void Project(const Vector3& half, const Placement& pose, const Vector3& origin, const Vector3& direction, double* lower,
             double* upper) {
  *lower = std::numeric_limits<double>::infinity();
  *upper = -*lower;
  for (int corner = 0; corner < 8; ++corner) {
    const Vector3 corner_B((corner & 1) ? half.x() : -half.x(), (corner & 2) ? half.y() : -half.y(),
                           (corner & 4) ? half.z() : -half.z());
    const double along = direction.dot(pose.position_W - origin + pose.rotation_WB * corner_B);
    *lower = std::min(*lower, along);
    *upper = std::max(*upper, along);
  }
}

// [m] depth of overlap of two boxes: least over the 15 separating-axis candidates, negative if they are apart.
inline double BoxOverlap(const Vector3& half_a, const Placement& pose_a, const Vector3& half_b, const Placement& pose_b) {
  double depth = std::numeric_limits<double>::infinity();
  auto test = [&](const Vector3& direction) {
    double lower_a, upper_a, lower_b, upper_b;
    Project(half_a, pose_a, pose_a.position_W, direction, &lower_a, &upper_a);
    Project(half_b, pose_b, pose_a.position_W, direction, &lower_b, &upper_b);
    depth = std::min({depth, upper_a - lower_b, upper_b - lower_a});
  };
  for (int i = 0; i < 3; ++i) {
    test(pose_a.rotation_WB.col(i));
    test(pose_b.rotation_WB.col(i));
    for (int j = 0; j < 3; ++j) {
      const Vector3 cross = pose_a.rotation_WB.col(i).cross(pose_b.rotation_WB.col(j));
      const double length = cross.norm();
      if (length > 1e-8) test(cross / length);
    }
  }
  return depth;
}

}  // namespace islet::testing
