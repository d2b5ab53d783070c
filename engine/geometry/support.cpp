#include "engine/geometry/support.h"

#include <algorithm>
#include <cmath>

#include "engine/geometry/edge_contact.h"

namespace islet {
namespace {

// [m] from the centre, along a unit vector.
double Reach(const Shape& shape, const Matrix3& rotation_WB, const Vector3& direction_W) {
  const Vector3 axis_W = rotation_WB.col(2);
  const double axial = std::abs(axis_W.dot(direction_W));
  switch (shape.kind()) {
    case ShapeKind::kSphere:
      return shape.girth();
    case ShapeKind::kCapsule:
      return shape.half_length() * axial + shape.girth();
    case ShapeKind::kCylinder:
      return shape.half_length() * axial + shape.girth() * axis_W.cross(direction_W).norm();
    default: {
      const Vector3 direction_B = rotation_WB.transpose() * direction_W;
      double farthest = -INFINITY;
      for (const Vector3& v : shape.polytope().vertices) farthest = std::max(farthest, direction_B.dot(v));
      return farthest;
    }
  }
}

}  // namespace

std::span<const Vector3> FlatSides(const Shape& shape) {
  static const Vector3 of_cylinder[] = {Vector3::UnitZ(), -Vector3::UnitZ()};
  if (shape.kind() == ShapeKind::kCylinder) return of_cylinder;
  return shape.polytope().face_normals;
}

bool HasSupport(const Shape& shape) {
  return shape.kind() != ShapeKind::kHalfSpace && shape.kind() != ShapeKind::kCustom;
}

double SeparationAlong(const Shape& a, const Placement& pose_a, const Shape& b, const Placement& pose_b,
                       const Vector3& direction_W) {
  return direction_W.dot(pose_b.position_W - pose_a.position_W) - Reach(a, pose_a.rotation_WB, direction_W) -
         Reach(b, pose_b.rotation_WB, -direction_W);
}

void FacingSides(const Shape& a, const Placement& pose_a, const Shape& b, const Placement& pose_b, double deep,
                 std::vector<Vector3>* normals_W) {
  for (const Vector3& side_a : FlatSides(a))
    for (const Vector3& side_b : FlatSides(b)) {
      const Vector3 of_a = pose_a.rotation_WB * side_a, against_b = -(pose_b.rotation_WB * side_b);
      if ((of_a - against_b).norm() >= kAngle) continue;
      const double by_a = SeparationAlong(a, pose_a, b, pose_b, of_a),
                   by_b = SeparationAlong(a, pose_a, b, pose_b, against_b);
      if (std::max(by_a, by_b) >= -deep) normals_W->push_back(by_a >= by_b ? of_a : against_b);
    }
}

bool TouchByLevelEdges(std::span<const Contact> contacts, const Shape& a, const Placement& pose_a, const Shape& b,
                       const Placement& pose_b, double level, std::vector<Vector3>* normals_W) {
  normals_W->clear();
  const auto apart = [&](const Contact& c) { return std::abs(c.gap) > level; };
  if (contacts.empty() || contacts.size() > 2 || std::any_of(contacts.begin(), contacts.end(), apart)) return false;
  FacingSides(a, pose_a, b, pose_b, level, normals_W);
  return normals_W->size() > 1;
}

}  // namespace islet
