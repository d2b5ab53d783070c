#include "engine/sphere_contact.h"

#include <cmath>
#include <limits>

namespace islet {
namespace {

// The point midway between a surface at `surface_W` and one `gap` farther along the normal.
void Append(const Vector3& surface_W, const Vector3& normal_W, double gap, int feature,
            std::vector<Contact>* contacts) {
  Contact contact;
  contact.point_W = surface_W + 0.5 * gap * normal_W;
  contact.normal_W = normal_W;
  contact.gap = gap;
  contact.feature = static_cast<std::uint32_t>(feature);
  contacts->push_back(contact);
}

struct Nearest {
  Vector3 point_B;
  Vector3 normal_B;
  double distance = std::numeric_limits<double>::infinity();
};

Vector3 NearestOnSegment(const Vector3& from, const Vector3& to, const Vector3& query) {
  const Vector3 along = to - from;
  const double t = (query - from).dot(along) / along.squaredNorm();
  return t <= 0 ? from : (t >= 1 ? to : Vector3(from + t * along));
}

// The point of a face nearest to a query whose height over the face is known.
Vector3 NearestOnFace(const Polytope& polytope, int face, double height, const Vector3& query) {
  const std::vector<int>& loop = polytope.faces[face];
  const Vector3& normal = polytope.face_normals[face];
  bool inside = true;
  Vector3 best = Vector3::Zero();
  double best_square = std::numeric_limits<double>::infinity();
  for (size_t k = 0; k < loop.size(); ++k) {
    const Vector3& from = polytope.vertices[loop[k]];
    const Vector3& to = polytope.vertices[loop[(k + 1) % loop.size()]];
    if ((to - from).cross(normal).dot(query - from) <= 0) continue;  // on the inner side of this edge
    inside = false;
    const Vector3 candidate = NearestOnSegment(from, to, query);
    const double square = (query - candidate).squaredNorm();
    if (square < best_square) best_square = square, best = candidate;
  }
  return inside ? Vector3(query - height * normal) : best;
}

// Surface point nearest to a query, exact: inside the polytope the face of least depth, outside the nearest face.
Nearest NearestOnPolytope(const Polytope& polytope, double size, const Vector3& query_B) {
  const int num_faces = static_cast<int>(polytope.faces.size());
  Nearest nearest;
  int top = 0;
  double top_height = -std::numeric_limits<double>::infinity();
  for (int f = 0; f < num_faces; ++f) {
    const double height = polytope.face_normals[f].dot(query_B - polytope.vertices[polytope.faces[f][0]]);
    if (height > top_height) top_height = height, top = f;
    if (height <= 0) continue;
    const Vector3 point = NearestOnFace(polytope, f, height, query_B);
    const double distance = (query_B - point).norm();
    if (distance < nearest.distance) nearest = {point, (query_B - point) / distance, distance};
  }
  // On the surface the direction to the nearest point is round-off; the face's normal is not.
  if (top_height <= 0 || nearest.distance <= 1e-9 * size) {
    const Vector3& normal = polytope.face_normals[top];
    return {query_B - top_height * normal, normal, top_height};
  }
  return nearest;
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
  const Nearest nearest = NearestOnPolytope(shape.polytope(), shape.size(), centre_B);
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
