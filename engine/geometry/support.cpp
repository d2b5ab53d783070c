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

// [m] from the centre to a flat side.
double OffsetOf(const Shape& shape, size_t side) {
  const Polytope& polytope = shape.polytope();
  if (shape.kind() == ShapeKind::kCylinder) return shape.half_length();
  return polytope.face_normals[side].dot(polytope.vertices[polytope.faces[side][0]]);
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

void SidesApart(const Shape& a, const Placement& pose_a, const Shape& b, const Placement& pose_b, double deep,
                std::vector<int>* sides) {
  sides->clear();
  const Vector3 between = pose_b.position_W - pose_a.position_W;
  const std::vector<Vector3>& corners = b.polytope().vertices;
  const Vector3 *likely = nullptr, towards_a = -(pose_b.rotation_WB.transpose() * between);
  for (const Vector3& v : corners)
    if (!likely || towards_a.dot(v) > towards_a.dot(*likely)) likely = &v;
  const std::span<const Vector3> normals = FlatSides(a);
  for (size_t i = 0; i < normals.size(); ++i) {
    const Vector3 outward_W = pose_a.rotation_WB * normals[i];
    if (likely) {  // asked first, so most sides cost one look
      const Vector3 outward_B = pose_b.rotation_WB.transpose() * outward_W;
      const double least = OffsetOf(a, i) - outward_W.dot(between) - deep;
      const auto is_deep = [&](const Vector3& v) { return outward_B.dot(v) < least; };
      if (is_deep(*likely) || std::any_of(corners.begin(), corners.end(), is_deep)) continue;
    } else if (SeparationAlong(a, pose_a, b, pose_b, outward_W) < -deep) {
      continue;
    }
    sides->push_back(static_cast<int>(i));
  }
}

void FacingSides(const Shape& a, const Placement& pose_a, const Shape& b, const Placement& pose_b, double deep,
                 std::vector<Vector3>* normals_W) {
  static thread_local std::vector<int> apart_a, apart_b;
  SidesApart(a, pose_a, b, pose_b, deep, &apart_a);
  SidesApart(b, pose_b, a, pose_a, deep, &apart_b);
  const auto look = [&](const Vector3& of_a, size_t side_b) {
    const Vector3 against_b = -(pose_b.rotation_WB * FlatSides(b)[side_b]);
    if ((of_a - against_b).norm() >= kAngle) return;
    const double by_a = SeparationAlong(a, pose_a, b, pose_b, of_a),
                 by_b = SeparationAlong(a, pose_a, b, pose_b, against_b);
    if (std::max(by_a, by_b) >= -deep) normals_W->push_back(by_a >= by_b ? of_a : against_b);
  };
  const size_t num_a = FlatSides(a).size(), num_b = FlatSides(b).size();
  for (size_t i = 0; i < num_a; ++i) {
    const bool apart = std::binary_search(apart_a.begin(), apart_a.end(), static_cast<int>(i));
    const Vector3 of_a = pose_a.rotation_WB * FlatSides(a)[i];
    for (size_t k = 0; apart && k < num_b; ++k) look(of_a, k);
    for (size_t k = 0; !apart && k < apart_b.size(); ++k) look(of_a, apart_b[k]);
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

bool LeastClosingSide(const Shape& a, const Placement& pose_a, const Shape& b, const Placement& pose_b, double deep,
                      const Vector3& velocity_W, double most_a, double most_b, Vector3* normal_W) {
  if (!HasSupport(a) || !HasSupport(b)) return false;
  static thread_local std::vector<int> apart;
  double least = INFINITY, next = INFINITY;
  const auto look = [&](const Vector3& n, double most) {
    const double closing = -n.dot(velocity_W);
    if (closing > most) return;
    const bool other = least == INFINITY || (n - *normal_W).norm() >= kAngle;
    if (closing >= least) {
      if (other) next = std::min(next, closing);
      return;
    }
    if (other) next = least;
    least = closing;
    *normal_W = n;
  };
  SidesApart(a, pose_a, b, pose_b, deep, &apart);
  for (const int side : apart) look(pose_a.rotation_WB * FlatSides(a)[side], most_a);
  SidesApart(b, pose_b, a, pose_a, deep, &apart);
  for (const int side : apart) look(-(pose_b.rotation_WB * FlatSides(b)[side]), most_b);
  return least < INFINITY && next - least > kAngle * velocity_W.norm();
}

}  // namespace islet
