#include "engine/query/ray.h"

#include <algorithm>
#include <cmath>

#include "qp/smallness.h"

namespace islet {
namespace {

// Along the line of the ray the shape is where every face has it inside: from the last face entered to the first one left. A ray that begins
// on a face and does not go in is outside.
struct Interval {
  double touch;  // [m] within which a ray is on a face: of a size, and of where it is
  double enter = 0, leave = 1;
  Vector3 normal = Vector3::Zero();  // of the face that was entered last; zero: the ray begins inside

  void Cut(const Vector3& face, double height, double slope) {  // height: [m] of the origin above the face
    const bool outside = height >= -touch;
    if (slope >= 0) {
      leave = outside ? -1 : slope > 0 ? std::min(leave, -height / slope) : leave;
    } else if (-height / slope > enter || (outside && normal.isZero(0) && enter == 0)) {
      enter = std::max(0.0, -height / slope), normal = face;
    }
  }
};

// The part of a ball that the ray is in.
void CutBall(const Vector3& centre, double radius, const Vector3& origin, const Vector3& way, Interval* inside) {
  const Vector3 from = origin - centre;
  const double a = way.squaredNorm(), b = from.dot(way), c = (from.norm() - radius) * (from.norm() + radius);
  const bool outside = c >= -2 * radius * inside->touch;
  const double passes =
      a > 0 ? (from - b / a * way).norm() : from.norm();          // [m] of the centre; exact from far away, too
  if (passes >= radius - inside->touch || (outside && b >= 0)) {  // what grazes it does not go in
    inside->leave = -1;
    return;
  }
  if (a == 0) return;
  const double root = std::sqrt(a * (radius - passes) * (radius + passes));
  const double near = b < 0 ? c / (-b + root) : (-b - root) / a, far = b < 0 ? (-b + root) / a : -c / (b + root);
  if (near > inside->enter || (outside && inside->normal.isZero(0) && inside->enter == 0)) {
    inside->enter = std::max(0.0, near);
    inside->normal = (from + inside->enter * way).normalized();
  }
  inside->leave = std::min(inside->leave, far);
}

// The shape is its middle, a cylinder between two flat ends, and of a capsule two balls at them: the ray is in where it is in one of them.
void EnterRound(const Shape& shape, const Vector3& origin, const Vector3& way, Interval* inside) {
  const Vector3 across(1, 1, 0), end = shape.half_length() * Vector3::UnitZ();
  Interval middle{inside->touch};
  CutBall(Vector3::Zero(), shape.girth(), origin.cwiseProduct(across), way.cwiseProduct(across), &middle);
  middle.Cut(Vector3::UnitZ(), origin.z() - end.z(), way.z());
  middle.Cut(-Vector3::UnitZ(), -origin.z() - end.z(), -way.z());
  Interval first = middle;
  if (shape.kind() == ShapeKind::kCapsule) {
    for (const Vector3& centre : {Vector3(-end), end}) {
      Interval ball{inside->touch};
      CutBall(centre, shape.girth(), origin, way, &ball);
      if (ball.enter > ball.leave || ball.leave < 0) continue;
      if (first.enter > first.leave || ball.enter < first.enter) first = ball;
    }
    if (!first.normal.isZero(0)) {  // the flat ends are inside
      Vector3 place = origin + first.enter * way;
      place.z() -= std::clamp(place.z(), -end.z(), end.z());
      first.normal = place.normalized();
    }
  }
  *inside = first;
}

}  // namespace

Vector3 Against(const Vector3& way) { return way.isZero(0) ? Vector3::UnitZ() : Vector3(-way.normalized()); }

std::optional<RayEntry> EnterShape(const Shape& shape, const Placement& pose, const Vector3& origin_W,
                                   const Vector3& way_W) {
  const Matrix3& rotation = pose.rotation_WB;
  const Vector3 origin = rotation.transpose() * (origin_W - pose.position_W), way = rotation.transpose() * way_W;
  if (shape.kind() == ShapeKind::kCustom) return {};
  const double size = std::isfinite(shape.size()) ? shape.size() : 0;
  Interval inside{kExact * size + kUlp * (origin_W.norm() + pose.position_W.norm())};
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
  return RayEntry{inside.enter, rotation * (inside.normal.isZero(0) ? Against(way) : inside.normal)};
}

}  // namespace islet
