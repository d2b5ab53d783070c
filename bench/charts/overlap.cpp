#include "bench/charts/overlap.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>

namespace islet::charts {
namespace {

using peers::BodyPlan;
using peers::State;

constexpr double kWorthCounting = 1e-6;  // [m]

double BoxBox(const BodyPlan& a, const State& at_a, const BodyPlan& b, const State& at_b) {
  const Matrix3 axes_a = at_a.rotation_WB.toRotationMatrix(), axes_b = at_b.rotation_WB.toRotationMatrix();
  const Vector3 offset = at_b.position_W - at_a.position_W;
  double least = 1e300;
  const auto try_axis = [&](const Vector3& axis) {
    const double reach_a = (axes_a.transpose() * axis).cwiseAbs().dot(a.half_extents);
    const double reach_b = (axes_b.transpose() * axis).cwiseAbs().dot(b.half_extents);
    least = std::min(least, reach_a + reach_b - std::abs(offset.dot(axis)));
    return least > 0;
  };
  for (int k = 0; k < 3; ++k) {
    if (!try_axis(axes_a.col(k)) || !try_axis(axes_b.col(k))) return least;
  }
  for (int i = 0; i < 3; ++i) {
    for (int k = 0; k < 3; ++k) {
      const Vector3 cross = axes_a.col(i).cross(axes_b.col(k));
      const double length = cross.norm();
      if (length > 1e-6 && !try_axis(cross / length)) return least;  // parallel edges: the faces have said it
    }
  }
  return least;
}

double SphereBox(const BodyPlan& sphere, const State& at_sphere, const BodyPlan& box, const State& at_box) {
  const Vector3 centre = at_box.rotation_WB.conjugate() * (at_sphere.position_W - at_box.position_W);
  const Vector3 outside = (centre.cwiseAbs() - box.half_extents).cwiseMax(0);
  if (outside.squaredNorm() > 0) return sphere.radius - outside.norm();
  return sphere.radius + (box.half_extents - centre.cwiseAbs()).minCoeff();
}

double BoundingRadius(const BodyPlan& body) {
  return body.form == BodyPlan::Form::kBox ? body.half_extents.norm() : body.radius;
}

// Whether a ball around the moving body reaches the other one's bounding box in its own frame.
bool MayTouch(const BodyPlan& fixed, const State& at_fixed, const State& at, double radius) {
  if (fixed.form == BodyPlan::Form::kSphere)
    return (at.position_W - at_fixed.position_W).norm() < fixed.radius + radius;
  const Vector3 local = at_fixed.rotation_WB.conjugate() * (at.position_W - at_fixed.position_W);
  return ((local.cwiseAbs() - fixed.half_extents).array() < radius).all();
}

}  // namespace

double PairOverlap(const BodyPlan& a, const State& at_a, const BodyPlan& b, const State& at_b) {
  const bool box_a = a.form == BodyPlan::Form::kBox, box_b = b.form == BodyPlan::Form::kBox;
  if (box_a && box_b) return BoxBox(a, at_a, b, at_b);
  if (box_a) return SphereBox(b, at_b, a, at_a);
  if (box_b) return SphereBox(a, at_a, b, at_b);
  return a.radius + b.radius - (at_a.position_W - at_b.position_W).norm();
}

Overlap MeasureOverlap(const peers::WorldPlan& plan, std::span<const State> states) {
  Overlap result;
  const auto& bodies = plan.bodies;
  const auto include = [&](int i, int k) {
    const double depth = PairOverlap(bodies[i], states[i], bodies[k], states[k]);
    if (!(depth > 0)) return;
    result.deepest = std::max(result.deepest, depth);
    if (depth > kWorthCounting) {
      result.sum += depth;
      ++result.pairs;
    }
  };
  std::vector<int> moving, fixed;
  for (int i = 0; i < static_cast<int>(bodies.size()); ++i) {
    if (states[i].position_W.allFinite()) (bodies[i].Moves() ? moving : fixed).push_back(i);
  }
  // Moving pairs by sweep and prune along x.
  std::ranges::sort(moving, {}, [&](int i) { return states[i].position_W.x() - BoundingRadius(bodies[i]); });
  for (size_t m = 0; m < moving.size(); ++m) {
    const int i = moving[m];
    const double radius = BoundingRadius(bodies[i]), end = states[i].position_W.x() + radius;
    for (size_t n = m + 1; n < moving.size(); ++n) {
      const int k = moving[n];
      if (states[k].position_W.x() - BoundingRadius(bodies[k]) > end) break;
      const double reach = radius + BoundingRadius(bodies[k]);
      if ((states[i].position_W - states[k].position_W).squaredNorm() < reach * reach) include(i, k);
    }
    for (const int k : fixed) {
      if (MayTouch(bodies[k], states[k], states[i], radius)) include(i, k);
    }
  }
  return result;
}

}  // namespace islet::charts
