#include "engine/passing.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "engine/narrow_phase.h"
#include "engine/rotation.h"

namespace islet {
namespace {

constexpr double kSmallestApproach = 1e-9;  // [sphere radii] in the step
constexpr double kTurnedShare = 0.1;        // of the plane's approach: less is a hit as the plane has it
constexpr double kDepth = 1e-6;             // [sphere radii] of overlap that is no hit
constexpr double kSameNormal = 1 - 1e-6;    // cosine
constexpr int kSearchSteps = 24;            // of the least gap on the way: to 1e-5 of it

bool IsSphere(const Traveller& t) { return t.shape.kind() == ShapeKind::kSphere; }

Placement At(const Traveller& t, double share) {
  const Vector3 position_W = t.body.position_W + share * t.linear;
  if (IsSphere(t)) return {position_W, Matrix3::Identity()};  // its turn does not show
  return {position_W, Quaternion(Exp(share * t.angular) * t.body.rotation_WB).toRotationMatrix()};
}

// A sphere has one contact with anything.
Contact ContactAt(const Traveller& a, const Traveller& b, double share) {
  thread_local std::vector<Contact> found;
  found.clear();
  CollideShapes(a.shape, At(a, share), b.shape, At(b, share), std::numeric_limits<double>::infinity(), &found);
  return found.front();
}

double LeastGapOfSpheres(const Traveller& a, const Traveller& b) {
  const Vector3 apart = b.body.position_W - a.body.position_W, way = b.linear - a.linear;
  const double length = way.squaredNorm();
  const double share = length > 0 ? std::clamp(-apart.dot(way) / length, 0.0, 1.0) : 0;
  return (apart + share * way).norm() - a.shape.radius() - b.shape.radius();
}

// The distance of two convex bodies along straight ways has no minimum but the least one.
double LeastGap(const Traveller& a, const Traveller& b) {
  if (IsSphere(a) && IsSphere(b)) return LeastGapOfSpheres(a, b);
  constexpr double kGolden = 0.6180339887498949;
  double low = 0, high = 1, left = 1 - kGolden, right = kGolden;
  double at_left = ContactAt(a, b, left).gap, at_right = ContactAt(a, b, right).gap;
  for (int i = 0; i < kSearchSteps; ++i) {
    if (at_left < at_right) {
      high = right, right = left, at_right = at_left;
      left = high - kGolden * (high - low);
      at_left = ContactAt(a, b, left).gap;
    } else {
      low = left, left = right, at_left = at_right;
      right = low + kGolden * (high - low);
      at_right = ContactAt(a, b, right).gap;
    }
  }
  return std::min(at_left, at_right);
}

}  // namespace

bool PassesBy(const Traveller& a, const Traveller& b, std::span<const Contact> beds, Contact* contact) {
  if (!IsSphere(a) && !IsSphere(b)) return false;
  if (a.shape.kind() == ShapeKind::kHalfSpace || b.shape.kind() == ShapeKind::kHalfSpace) return false;
  const Traveller& sphere = IsSphere(b) ? b : a;
  const auto travel = [&](const Traveller& t, const Vector3& point) -> Vector3 {
    return t.linear + t.angular.cross(point - t.body.position_W);
  };
  const double approach = -contact->normal_W.dot(travel(b, contact->point_W) - travel(a, contact->point_W));
  if (approach <= kSmallestApproach * sphere.shape.radius()) return false;
  // Slow ones are judged by the way that the plane would let them go: a step alone shows hardly any turning.
  const double horizon = std::max(1.0, contact->gap / approach);
  const double turned = ContactAt(a, b, horizon).gap - (contact->gap - horizon * approach);
  if (turned < kTurnedShare * horizon * approach) return false;
  const Contact end = ContactAt(a, b, 1);
  double depth = kDepth * sphere.shape.radius();
  for (const Contact& bed : beds)
    if (std::abs(bed.normal_W.dot(end.normal_W)) > kSameNormal) depth = std::max(depth, 1.01 * -bed.gap);
  if (std::min(end.gap, LeastGap(a, b)) < -depth) return false;
  const Traveller& other = IsSphere(b) ? a : b;
  if (other.body.kind != BodyKind::kDynamic) {
    contact->normal_W = end.normal_W;
    contact->point_W = end.point_W - sphere.linear;
    contact->gap = end.gap - end.normal_W.dot(travel(b, contact->point_W) - travel(a, contact->point_W));
  } else {
    contact->gap = end.gap + approach;  // the line of the new normal would miss the other's centre and spin it
  }
  return true;
}

}  // namespace islet
