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

// The part of a ball that the ray is in.
void CutBall(const Vector3& centre, double radius, const Vector3& origin, const Vector3& way, Interval* inside) {
  const Vector3 from = origin - centre;
  const double a = way.squaredNorm(), b = from.dot(way), c = (from.norm() - radius) * (from.norm() + radius);
  const double discriminant = b * b - a * c;
  if (discriminant < 0 || (a == 0 && c > 0)) {
    inside->leave = -1;
    return;
  }
  if (a == 0) return;
  const double root = std::sqrt(discriminant), near = b < 0 ? c / (-b + root) : (-b - root) / a;
  const double far = b < 0 ? (-b + root) / a : -c / (b + root);
  if (near > inside->enter) inside->enter = near, inside->normal = (from + near * way).normalized();
  inside->leave = std::min(inside->leave, far);
}

// The shape is its middle, a cylinder between two flat ends, and of a capsule two balls at them: the ray is in where it is in one of them.
void EnterRound(const Shape& shape, const Vector3& origin, const Vector3& way, Interval* inside) {
  const Vector3 across(1, 1, 0), end = shape.half_length() * Vector3::UnitZ();
  Interval middle;
  CutBall(Vector3::Zero(), shape.girth(), origin.cwiseProduct(across), way.cwiseProduct(across), &middle);
  middle.Cut(Vector3::UnitZ(), origin.z() - end.z(), way.z());
  middle.Cut(-Vector3::UnitZ(), -origin.z() - end.z(), -way.z());
  Interval first = middle;
  if (shape.kind() == ShapeKind::kCapsule) {
    for (const Vector3& centre : {Vector3(-end), end}) {
      Interval ball;
      CutBall(centre, shape.girth(), origin, way, &ball);
      if (ball.enter > ball.leave || ball.leave < 0) continue;
      if (first.enter > first.leave || ball.enter < first.enter) first = ball;
    }
  }
  *inside = first;
}

}  // namespace

std::optional<RayEntry> EnterShape(const Shape& shape, const Placement& pose, const Vector3& origin_W,
                                   const Vector3& way_W) {
  const Matrix3& rotation = pose.rotation_WB;
  const Vector3 origin = rotation.transpose() * (origin_W - pose.position_W), way = rotation.transpose() * way_W;
  const Vector3 against = way.isZero(0) ? Vector3::UnitZ() : Vector3(-way.normalized());
  if (shape.kind() == ShapeKind::kCustom) return {};
  Interval inside;
  if (shape.kind() == ShapeKind::kSphere) {
    CutBall(Vector3::Zero(), shape.radius(), origin, way, &inside);
  } else if (shape.kind() == ShapeKind::kHalfSpace) {
    inside.Cut(Vector3::UnitZ(), origin.z(), way.z());
  } else if (shape.HasAxis()) {
    EnterRound(shape, origin, way, &inside);
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
