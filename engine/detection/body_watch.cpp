#include "engine/detection/body_watch.h"

#include <algorithm>

#include "parallel/worker_pool.h"

namespace islet {
namespace {

// [m] half extents in W of a shape's box about its centre of mass.
Vector3 HalfExtentsW(const Shape& shape, const Matrix3& rotation) {
  if (shape.kind() == ShapeKind::kSphere) return shape.half_extents();
  if (shape.kind() != ShapeKind::kConvexHull) return rotation.cwiseAbs() * shape.half_extents();
  Vector3 half = Vector3::Zero();  // symmetric about the centre although a hull is not: a little wide, but simple
  for (const Vector3& vertex : shape.polytope().vertices) half = half.cwiseMax((rotation * vertex).cwiseAbs());
  return half;
}

bool IsMovingKinematic(const Body& body) {
  return body.kind == BodyKind::kKinematic && !body.removed &&
         (!body.linear_velocity_W.isZero(0) || !body.angular_velocity_W.isZero(0));
}

bool SameShape(const Shape& p, const Shape& q) { return &p.half_extents() == &q.half_extents(); }

}  // namespace

void BodyWatch::Update(std::span<const Body> bodies, std::span<const Shape> shapes, std::span<const Vector3> travel_W,
                       std::span<const double> margins, parallel::WorkerPool* pool) {
  const int n = static_cast<int>(bodies.size());
  const int known = std::min(n, size());
  bodies_.resize(n);
  rotations_.resize(n);
  other_shape_.assign(n, 1);
  for (int i = 0; i < known; ++i) {
    other_shape_[i] = !SameShape(shapes_[i], shapes[i]);
    if (other_shape_[i]) shapes_[i] = shapes[i];
  }
  shapes_.erase(shapes_.begin() + known, shapes_.end());
  shapes_.insert(shapes_.end(), shapes.begin() + known, shapes.end());
  half_spaces_.swap(before_);
  half_spaces_.clear();
  for (int i = 0; i < n; ++i) {
    if (shapes[i].kind() == ShapeKind::kHalfSpace && !bodies[i].removed) half_spaces_.push_back(i);
  }
  half_spaces_changed_ = half_spaces_ != before_ || std::any_of(half_spaces_.begin(), half_spaces_.end(),
                                                                [&](int i) { return other_shape_[i] != 0; });
  pool->ForEachOf(bodies.size(), [&](size_t i) { UpdateOne(static_cast<int>(i), bodies[i], travel_W[i], margins[i]); });
}

void BodyWatch::UpdateOne(int number, const Body& body, const Vector3& travel, double margin) {
  WatchedBody& w = bodies_[number];
  w.moves = body.Moves();
  w.moving_kinematic = IsMovingKinematic(body);
  const bool dynamic = body.kind == BodyKind::kDynamic;
  w.rebuilt = other_shape_[number] || w.removed != body.removed || w.dynamic != dynamic;
  w.changed = w.rebuilt || w.pose.position_W != body.position_W ||
              rotations_[number].coeffs() != body.rotation_WB.coeffs() || w.travel != travel || w.margin != margin;
  if (!w.changed) return;
  const Shape& shape = shapes_[number];
  w.removed = body.removed;
  w.dynamic = dynamic;
  w.half_space = shape.kind() == ShapeKind::kHalfSpace;
  w.radius = shape.radius();
  w.margin = margin;
  w.travel = travel;
  w.pose = {body.position_W, body.rotation_WB.toRotationMatrix()};
  rotations_[number] = body.rotation_WB;
  if (w.half_space || w.removed) return;
  const Vector3 half = HalfExtentsW(shape, w.pose.rotation_WB).array() + margin;
  const Vector3& start = w.pose.position_W;
  const Vector3 end = start + travel;
  w.box.lower = start.cwiseMin(end) - half;
  w.box.upper = start.cwiseMax(end) + half;
}

}  // namespace islet
