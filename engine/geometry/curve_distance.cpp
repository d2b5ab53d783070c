#include "engine/geometry/curve_distance.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include "qp/elementary.h"
#include "qp/smallness.h"

namespace islet {
namespace {

constexpr int kSamples = 32;  // of a circle: the distance from a line or circle has at most two minima on it

struct Direction {
  double cosine, sine;
};

Direction DirectionAt(double angle) { return {Cosine(angle), Sine(angle)}; }

// Cosines and sines, apart, since slopes are found of many at once.
struct Samples {
  std::array<double, kSamples + 1> cosines, sines;
};

const Samples& AllSamples() {
  static const Samples samples = [] {
    Samples all;
    for (int k = 0; k <= kSamples; ++k) {
      const Direction d = DirectionAt(2 * std::numbers::pi * (k % kSamples) / kSamples);
      all.cosines[k] = d.cosine, all.sines[k] = d.sine;
    }
    return all;
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

// Minima over the circle of the distance to another curve: half the derivative of its square by the angle, over the radius, is
// (at - nearest) . tangent, and rises through zero at each. `slope` gives that for a direction, `nearest` the point and the tangent of the
// other curve for a point of the circle.
template <typename Slope, typename Nearest>
CurvePlaces Minima(const Circle& circle, const Matrix3& axes, const Slope& slope, const Nearest& nearest) {
  const Samples& samples = AllSamples();
  std::array<double, kSamples + 1> slopes;
  for (int k = 0; k <= kSamples; ++k) slopes[k] = slope({samples.cosines[k], samples.sines[k]});
  CurvePlaces places;
  for (int k = 1; k <= kSamples && places.count < static_cast<int>(places.place.size()); ++k) {
    if (!(slopes[k - 1] < 0 && slopes[k] >= 0)) continue;
    const Direction from = {samples.cosines[k - 1], samples.sines[k - 1]}, to = {samples.cosines[k], samples.sines[k]};
    // A share of the chord stands for the angle: no series to sum.
    const auto direction_at = [&](double share) -> Direction {
      const double c = from.cosine + share * (to.cosine - from.cosine), s = from.sine + share * (to.sine - from.sine);
      const double norm = std::sqrt(c * c + s * s);
      return {c / norm, s / norm};
    };
    double low = 0, high = 1, at_low = slopes[k - 1], at_high = slopes[k], share = high;
    // Secants, of which the end that stays counts half [Illinois]; the middle where they take too little off.
    int stays = 0;
    for (int b = 0; b < kHalvings && high - low > 4e-16 * high; ++b) {
      share = b % 8 == 7 ? 0.5 * (low + high) : low - at_low * (high - low) / (at_high - at_low);
      const double here = slope(direction_at(share));
      if (here == 0) break;
      if (here < 0) {
        low = share, at_low = here;
        if (stays > 0) at_high /= 2;
        stays = 1;
      } else {
        high = share, at_high = here;
        if (stays < 0) at_low /= 2;
        stays = -1;
      }
    }
    const Direction d = direction_at(share);
    const Vector3 radial = d.cosine * axes.col(0) + d.sine * axes.col(1), at = circle.centre + circle.radius * radial;
    const auto [on_q, tangent_q] = nearest(at);
    places.place[places.count++] = {at, on_q, circle.axis.cross(radial), tangent_q};
  }
  return places;
}

}  // namespace

CurvePlaces NearestOfLines(const Line& p, const Line& q) {
  const Vector3 cross = p.way.cross(q.way), between = q.from - p.from;
  const double square = cross.squaredNorm();
  if (square <= kNegligible * kNegligible * p.way.squaredNorm() * q.way.squaredNorm()) return {};
  const double s = between.cross(q.way).dot(cross) / square, t = between.cross(p.way).dot(cross) / square;
  CurvePlaces places;
  places.count = 1;
  places.place[0] = {p.from + s * p.way, q.from + t * q.way, p.way.normalized(), q.way.normalized()};
  return places;
}

// Only what lies across the line counts: P v = v - (v . way) way. With the circle's axes x, y and c, s of the angle the slope is
//   P (between + r (c x + s y)) . (c y - s x) = c between.Py - s between.Px + r c s (y.Py - x.Px) + r (c^2 - s^2) x.Py
CurvePlaces NearestOfCircleAndLine(const Circle& p, const Line& q) {
  const Matrix3 axes = AxesOf(p);
  const Vector3 way = q.way.normalized(), between = p.centre - q.from;
  const double along_x = way.dot(axes.col(0)), along_y = way.dot(axes.col(1)), along = way.dot(between);
  const double w_x = axes.col(0).dot(between) - along * along_x, w_y = axes.col(1).dot(between) - along * along_y;
  const double both = p.radius * (along_x - along_y) * (along_x + along_y), mixed = -p.radius * along_x * along_y;
  return Minima(
      p, axes,
      [=](const Direction& d) {
        return d.cosine * w_y - d.sine * w_x + d.cosine * d.sine * both +
               (d.cosine - d.sine) * (d.cosine + d.sine) * mixed;
      },
      [&](const Vector3& point) { return std::pair(Vector3(q.from + way.dot(point - q.from) * way), way); });
}

// In the axes of q a point at (a, b, h) is away from it by (a, b) (1 - R / |(a, b)|) and h. On the axis itself any way out will do.
CurvePlaces NearestOfCircles(const Circle& p, const Circle& q) {
  if (p.radius > q.radius) {  // samples of a large rim are too far apart to tell the places on a small one
    CurvePlaces places = NearestOfCircles(q, p);
    for (int k = 0; k < places.count; ++k) {
      std::swap(places.place[k].on_p, places.place[k].on_q);
      std::swap(places.place[k].tangent_p, places.place[k].tangent_q);
    }
    return places;
  }
  const Matrix3 axes = AxesOf(p), of_q = AxesOf(q);
  const Vector3 centre = of_q.transpose() * (p.centre - q.centre), x = of_q.transpose() * axes.col(0),
                y = of_q.transpose() * axes.col(1);
  const double r = p.radius, rim = q.radius, least = kNegligible * (p.radius + centre.norm());
  return Minima(
      p, axes,
      [=](const Direction& d) {
        const double c = d.cosine, s = d.sine;
        const double at_x = centre[0] + r * (c * x[0] + s * y[0]), at_y = centre[1] + r * (c * x[1] + s * y[1]),
                     at_z = centre[2] + r * (c * x[2] + s * y[2]);
        const double share = 1 - rim / std::max(least, std::sqrt(at_x * at_x + at_y * at_y));
        return share * (at_x * (c * y[0] - s * x[0]) + at_y * (c * y[1] - s * x[1])) + at_z * (c * y[2] - s * x[2]);
      },
      [&](const Vector3& point) {
        const Vector3 on_q = FarthestOnCircle(q, point - q.centre, of_q.col(0));
        return std::pair(on_q, Vector3(q.axis.cross(on_q - q.centre) / q.radius));
      });
}

Vector3 FarthestOnCircle(const Circle& circle, const Vector3& direction, const Vector3& fallback) {
  // Twice, or what rounding leaves along the axis would lift the point out of its plane where little is across.
  Vector3 across = direction - circle.axis.dot(direction) * circle.axis;
  across -= circle.axis.dot(across) * circle.axis;
  const double norm = across.norm();
  if (norm <= kUlp * direction.norm()) return circle.centre + circle.radius * fallback;
  return circle.centre + circle.radius / norm * across;
}

}  // namespace islet
