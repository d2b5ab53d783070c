#include "engine/geometry/curve_distance.h"

#include <cmath>
#include <numbers>
#include <utility>

namespace islet {
namespace {

constexpr int kSamples = 32;        // of a circle: the distance from a line or circle has at most two minima on it
constexpr int kRounds = 60;         // each takes at least an eighth of a halving off
constexpr double kParallel = 1e-9;  // sine: directions closer than this have no common normal

struct Point {
  Vector3 at, tangent;  // tangent: derivative by the angle over the radius, unit
};

struct Direction {
  double cosine, sine;
};

Point OnCircle(const Circle& circle, const Matrix3& axes, const Direction& d) {
  const Vector3 radial = d.cosine * axes.col(0) + d.sine * axes.col(1);
  return {circle.centre + circle.radius * radial, circle.axis.cross(radial)};
}

const std::array<Direction, kSamples + 1>& Samples() {
  static const auto samples = [] {
    std::array<Direction, kSamples + 1> directions;
    for (int k = 0; k <= kSamples; ++k) {
      const double angle = 2 * std::numbers::pi * (k % kSamples) / kSamples;
      directions[k] = {std::cos(angle), std::sin(angle)};
    }
    return directions;
  }();
  return samples;
}

// Two unit vectors across the axis of a circle, right-handed with it: a function of the axis alone.
Matrix3 AxesOf(const Circle& circle) {
  const Vector3& a = circle.axis;
  Eigen::Index least = 0;
  a.cwiseAbs().minCoeff(&least);
  const Vector3 x = (Vector3::Unit(least) - a[least] * a).normalized();
  Matrix3 axes;
  axes << x, a.cross(x), a;
  return axes;
}

// Minima over the circle of the distance to what `nearest` gives for a point: half the derivative of the squared distance by the angle,
// over the radius, is (at - nearest) . tangent, and rises through zero at each.
template <typename Nearest>
CurvePlaces Minima(const Circle& circle, const Nearest& nearest) {
  const Matrix3 axes = AxesOf(circle);
  const auto slope = [&](const Direction& d) {
    const Point p = OnCircle(circle, axes, d);
    return (p.at - nearest(p.at).first).dot(p.tangent);
  };
  CurvePlaces places;
  const double step = 2 * std::numbers::pi / kSamples;
  const auto& samples = Samples();
  double before = slope(samples[0]);
  for (int k = 1; k <= kSamples && places.count < static_cast<int>(places.place.size()); ++k) {
    const double after = slope(samples[k]);
    if (before < 0 && after >= 0) {
      double low = (k - 1) * step, high = k * step, at_low = before, at_high = after, angle = high;
      // Secants, of which the end that stays counts half [Illinois]; the middle where they take too little off.
      int stays = 0;
      for (int b = 0; b < kRounds && high - low > 4e-16 * high; ++b) {
        angle = b % 8 == 7 ? 0.5 * (low + high) : low - at_low * (high - low) / (at_high - at_low);
        const double here = slope({std::cos(angle), std::sin(angle)});
        if (here == 0) break;
        if (here < 0) {
          low = angle, at_low = here;
          if (stays > 0) at_high /= 2;
          stays = 1;
        } else {
          high = angle, at_high = here;
          if (stays < 0) at_low /= 2;
          stays = -1;
        }
      }
      const Point p = OnCircle(circle, axes, {std::cos(angle), std::sin(angle)});
      const auto [on_q, tangent_q] = nearest(p.at);
      places.place[places.count++] = {p.at, on_q, p.tangent, tangent_q};
    }
    before = after;
  }
  return places;
}

}  // namespace

CurvePlaces NearestOfLines(const Line& p, const Line& q) {
  const Vector3 cross = p.way.cross(q.way), between = q.from - p.from;
  const double square = cross.squaredNorm();
  if (square <= kParallel * kParallel * p.way.squaredNorm() * q.way.squaredNorm()) return {};
  const double s = between.cross(q.way).dot(cross) / square, t = between.cross(p.way).dot(cross) / square;
  CurvePlaces places;
  places.count = 1;
  places.place[0] = {p.from + s * p.way, q.from + t * q.way, p.way.normalized(), q.way.normalized()};
  return places;
}

CurvePlaces NearestOfCircleAndLine(const Circle& p, const Line& q) {
  const Vector3 way = q.way.normalized();
  return Minima(p,
                [&](const Vector3& point) { return std::pair(Vector3(q.from + way.dot(point - q.from) * way), way); });
}

CurvePlaces NearestOfCircles(const Circle& p, const Circle& q) {
  const Vector3 across = AxesOf(q).col(0);
  return Minima(p, [&](const Vector3& point) {
    const Vector3 on_q = FarthestOnCircle(q, point - q.centre, across);
    return std::pair(on_q, Vector3(q.axis.cross(on_q - q.centre) / q.radius));
  });
}

Vector3 FarthestOnCircle(const Circle& circle, const Vector3& direction, const Vector3& fallback) {
  const Vector3 across = direction - circle.axis.dot(direction) * circle.axis;
  const double norm = across.norm();
  if (norm <= kParallel * direction.norm()) return circle.centre + circle.radius * fallback;
  return circle.centre + circle.radius / norm * across;
}

}  // namespace islet
