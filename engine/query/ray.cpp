#include "engine/query/ray.h"

#include <cmath>

namespace islet {
namespace {

// Along the line of the ray the shape is where every face has it inside: from the last face entered to the first one left.
struct Interval {
  double enter = 0, leave = 1;
  Vector3 normal = Vector3::Zero();  // of the face that was entered last; zero: the ray begins inside

  void Cut(const Vector3& face, double height, double slope) {  // height: [m] of the origin above the face
    if (slope == 0) {
      if (height > 0) leave = -1;
    } else if (slope < 0) {
      if (-height / slope > enter) enter = -height / slope, normal = face;
    } else {
      leave = std::min(leave, -height / slope);
    }
  }
};

}  // namespace

std::optional<RayEntry> EnterShape(const Shape& shape, const Placement& pose, const Vector3& origin_W,
                                   const Vector3& way_W) {
  const Matrix3& rotation = pose.rotation_WB;
  const Vector3 origin = rotation.transpose() * (origin_W - pose.position_W), way = rotation.transpose() * way_W;
  const Vector3 against = way.isZero(0) ? Vector3::UnitZ() : Vector3(-way.normalized());
  Interval inside;
  if (shape.kind() == ShapeKind::kSphere) {
    const double radius = shape.radius(), a = way.squaredNorm(), b = origin.dot(way);
    const double c = (origin.norm() - radius) * (origin.norm() + radius);
    if (c > 0) {
      const double discriminant = b * b - a * c;
      if (discriminant < 0 || b >= 0) return {};
      inside.enter = c / (-b + std::sqrt(discriminant));  // the smaller root, without cancellation
      if (inside.enter > 1) return {};
      inside.normal = (origin + inside.enter * way).normalized();
    }
  } else if (shape.kind() == ShapeKind::kHalfSpace) {
    inside.Cut(Vector3::UnitZ(), origin.z(), way.z());
  } else {
    const Polytope& polytope = shape.polytope();
    for (size_t f = 0; f < polytope.faces.size(); ++f) {
      const Vector3& normal = polytope.face_normals[f];
      inside.Cut(normal, normal.dot(origin - polytope.vertices[polytope.faces[f][0]]), normal.dot(way));
    }
  }
  if (inside.enter > inside.leave) return {};
  return RayEntry{inside.enter, rotation * (inside.normal.isZero(0) ? against : inside.normal)};
}

}  // namespace islet
