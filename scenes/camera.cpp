#include "scenes/camera.h"

#include <cmath>
#include <limits>

namespace islet {

Eigen::Vector2d Camera::Project(const Vector3& point_W) const {
  const Vector3 ray = point_W - eye;
  const double distance = -ray.dot(back);
  return origin + scale * Eigen::Vector2d(ray.dot(right) / distance, -ray.dot(up) / distance);
}

Camera AimAt(const Region& region, double height, double margin) {
  constexpr double kAzimuth = -1.08, kElevation = 0.30;  // [rad]
  constexpr double kDistance = 1.9;                      // of the eye, in diagonals of the region
  Camera camera;
  camera.back = Vector3(std::cos(kElevation) * std::cos(kAzimuth), std::cos(kElevation) * std::sin(kAzimuth),
                        std::sin(kElevation));
  camera.right = Vector3::UnitZ().cross(camera.back).normalized();
  camera.up = camera.back.cross(camera.right);
  const Vector3 middle = 0.5 * (region.lower + region.upper);
  camera.eye = middle + kDistance * (region.upper - region.lower).norm() * camera.back;

  Eigen::Vector2d low = Eigen::Vector2d::Constant(std::numeric_limits<double>::infinity());
  Eigen::Vector2d high = -low;
  for (int corner = 0; corner < 8; ++corner) {
    Vector3 point;
    for (int k = 0; k < 3; ++k) point[k] = corner >> k & 1 ? region.upper[k] : region.lower[k];
    const Eigen::Vector2d p = camera.Project(point);
    low = low.cwiseMin(p);
    high = high.cwiseMax(p);
  }
  const Eigen::Vector2d border = Eigen::Vector2d::Constant(margin);
  camera.scale = height / (high - low).maxCoeff();
  camera.origin = border - camera.scale * low;
  camera.size = camera.scale * (high - low) + 2 * border;
  return camera;
}

}  // namespace islet
