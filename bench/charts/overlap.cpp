#include "bench/charts/overlap.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "bench/charts/contact_points.h"
#include "bench/charts/polytope.h"

namespace islet::charts {
namespace {

using peers::BodyPlan;
using peers::State;

constexpr double kWorthCounting = 1e-6;  // [m]

// What FindLeastOverlap does, for two boxes: many of them, so without their corners.
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

}  // namespace

double PairOverlap(const BodyPlan& a, const State& at_a, const BodyPlan& b, const State& at_b) {
  using Form = BodyPlan::Form;
  if (a.form == Form::kBox && b.form == Form::kBox) return BoxBox(a, at_a, b, at_b);
  if (a.form == Form::kSphere && b.form == Form::kSphere)
    return a.radius + b.radius - (at_a.position_W - at_b.position_W).norm();
  if (a.form != Form::kSphere && b.form != Form::kSphere)
    return FindLeastOverlap(PolytopeOf(a, at_a), PolytopeOf(b, at_b)).depth;
  if (a.form == Form::kHull || b.form == Form::kHull) throw std::logic_error("a sphere and a hull in one plan");
  return a.form == Form::kBox ? SphereBox(b, at_b, a, at_a) : SphereBox(a, at_a, b, at_b);
}

Overlap MeasureOverlap(const peers::WorldPlan& plan, std::span<const State> states) {
  Overlap result;
  ForEachNearPair(plan, states, 0, [&](int i, int k) {
    const double depth = PairOverlap(plan.bodies[i], states[i], plan.bodies[k], states[k]);
    if (!(depth > 0)) return;
    result.deepest = std::max(result.deepest, depth);
    if (depth > kWorthCounting) {
      result.sum += depth;
      ++result.pairs;
    }
  });
  return result;
}

}  // namespace islet::charts
