#include "engine/geometry/sphere_contact.h"

#include "engine/geometry/polytope_distance.h"

namespace islet {
namespace {

// The point midway between a surface at `surface_W` and one `gap` farther along the normal.
void Append(const Vector3& surface_W, const Vector3& normal_W, double gap, int feature,
            std::vector<Contact>* contacts) {
  contacts->push_back(
      MakeContact(surface_W + 0.5 * gap * normal_W, normal_W, gap, static_cast<std::uint32_t>(feature)));
}

}  // namespace

void CollideSphereSphere(double radius_a, const Vector3& centre_a, double radius_b, const Vector3& centre_b,
                         double reach, std::vector<Contact>* contacts) {
  const Vector3 between = centre_b - centre_a;
  const double distance = between.norm();
  const double gap = distance - radius_a - radius_b;
  if (gap > reach) return;
  // Concentric spheres have no direction of their own: any fixed one separates them.
  const Vector3 normal = distance > 0 ? Vector3(between / distance) : Vector3::UnitZ();
  Append(centre_a + radius_a * normal, normal, gap, 0, contacts);
}

void CollideBoxSphere(const Vector3& half_extents, const Placement& pose, double radius, const Vector3& centre_W,
                      double reach, std::vector<Contact>* contacts) {
  const Vector3 centre_B = pose.rotation_WB.transpose() * (centre_W - pose.position_W);
  const Vector3 nearest_B = centre_B.cwiseMin(half_extents).cwiseMax(-half_extents);
  const Vector3 outward_B = centre_B - nearest_B;
  const double distance = outward_B.norm();
  if (distance - radius > reach) return;
  if (distance > 1e-9 * half_extents.minCoeff()) {
    const Vector3 normal = pose.rotation_WB * (outward_B / distance);
    Append(pose.position_W + pose.rotation_WB * nearest_B, normal, distance - radius, 0, contacts);
    return;
  }
  // The centre lies inside or on the surface: leave by the nearest face.
  Eigen::Index axis = 0;
  const Vector3 heights = centre_B.cwiseAbs() - half_extents;
  const double height = heights.maxCoeff(&axis);
  const double sign = centre_B[axis] < 0 ? -1 : 1;
  const Vector3 normal = sign * pose.rotation_WB.col(axis);
  Append(centre_W - height * normal, normal, height - radius, 0, contacts);
}

void CollidePolytopeSphere(const Shape& shape, const Placement& pose, double radius, const Vector3& centre_W,
                           double reach, std::vector<Contact>* contacts) {
  const Vector3 centre_B = pose.rotation_WB.transpose() * (centre_W - pose.position_W);
  const NearestPoint nearest = NearestOnPolytope(shape.polytope(), shape.size(), centre_B);
  if (nearest.distance - radius > reach) return;
  Append(pose.position_W + pose.rotation_WB * nearest.point_B, pose.rotation_WB * nearest.normal_B,
         nearest.distance - radius, 0, contacts);
}

void CollideHalfSpaceSphere(const Placement& pose, double radius, const Vector3& centre_W, double reach,
                            std::vector<Contact>* contacts) {
  const Vector3 normal = pose.rotation_WB.col(2);
  const double height = normal.dot(centre_W - pose.position_W);
  if (height - radius <= reach) Append(centre_W - height * normal, normal, height - radius, 0, contacts);
}

void CollideHalfSpacePolytope(const Placement& half_space, const Shape& shape, const Placement& pose, double reach,
                              std::vector<Contact>* contacts) {
  const Vector3 normal = half_space.rotation_WB.col(2);
  const Vector3 normal_B = pose.rotation_WB.transpose() * normal;
  const double centre_height = normal.dot(pose.position_W - half_space.position_W);
  const std::vector<Vector3>& vertices = shape.polytope().vertices;
  for (size_t v = 0; v < vertices.size(); ++v) {
    const double gap = centre_height + normal_B.dot(vertices[v]);
    if (gap > reach) continue;
    const Vector3 vertex_W = pose.position_W + pose.rotation_WB * vertices[v];
    Append(vertex_W - gap * normal, normal, gap, static_cast<int>(v), contacts);
  }
}

}  // namespace islet
