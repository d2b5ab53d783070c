// The eye of picture.h: a perspective view from the front, the right and above, fitted to what is to be seen.
#pragma once

#include "engine/linear_algebra.h"
#include "engine/settings.h"

namespace islet {

struct Camera {
  Vector3 eye;                   // [m]
  Vector3 right, up, back;       // unit vectors; back points from the scene to the eye
  double scale = 1;              // [px] per unit of tangent
  Eigen::Vector2d origin{0, 0};  // [px] where the line of sight meets the picture
  Eigen::Vector2d size{0, 0};    // [px] of the picture

  Eigen::Vector2d Project(const Vector3& point_W) const;                       // [px] x to the right, y down
  double Nearness(const Vector3& point_W) const { return point_W.dot(back); }  // [m] larger is nearer
};

// Sees the whole region; the larger side of the picture has this height, margins apart.
Camera AimAt(const Region& region, double height, double margin);

}  // namespace islet
