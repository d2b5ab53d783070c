#include "engine/motion/meeting.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "engine/geometry/support.h"
#include "engine/motion/tuning.h"
#include "engine/rotation.h"
#include "qp/smallness.h"

namespace islet::motion {
namespace {

constexpr int kAdvances = 200;  // of one pair
constexpr int kTouches = 12;    // of them near it, and hardly nearer than the one before: they touch

// [m/s] fastest approach of the centres along the normal (from a to b) from t on: what changes linearly is fastest at an end.
double Approach(const MeetingQuery& query, double t, const Vector3& normal) {
  const auto approach = [&](double time) {
    return -normal.dot(query.path_b.VelocityAt(time) - query.path_a.VelocityAt(time));
  };
  return std::max(approach(t), approach(query.duration));
}

// [m/s] fastest closing of the gap from t on. Its normal turns with the pair, so the whole rate counts.
double ClosingSpeed(const MeetingQuery& query, double t, const Vector3& normal) {
  return Approach(query, t, normal) + query.path_a.TurnSpeed(t, query.duration) +
         query.path_b.TurnSpeed(t, query.duration);
}

// The same of the separation along a normal that stays as it is: a turn about it moves nothing along it.
double ClosingAlong(const MeetingQuery& query, double t, const Vector3& normal) {
  return Approach(query, t, normal) + query.path_a.TurnSpeedAlong(normal, t, query.duration) +
         query.path_b.TurnSpeedAlong(normal, t, query.duration);
}

// From t on, at least until the gap is half of what it was when seen last: the separation along any direction is no more than the gap. Those
// tried are the normal that was seen, as it was, as it would turn with the one body, and with the other.
double Glance(const MeetingQuery& query, double seen, double t, double gap, double floor, const Vector3& normal) {
  const Vector3 in_a = query.path_a.At(seen).rotation_WB.conjugate() * normal,
                in_b = query.path_b.At(seen).rotation_WB.conjugate() * normal;
  for (int k = 0; k < kAdvances && t < query.duration; ++k) {
    const Pose a = query.path_a.At(t), b = query.path_b.At(t);
    const Placement at_a = a.placement(), at_b = b.placement();
    double longest = 0;
    const auto look = [&](const Vector3& n, auto closing_of) {
      const double left = SeparationAlong(*query.a, at_a, *query.b, at_b, n) - floor;
      if (left < 0.5 * (gap - floor)) return;
      const double closing = closing_of(query, t, n);
      longest = std::max(longest, closing > 0 ? left / closing : query.duration);
    };
    look(normal, ClosingAlong);
    if (t + longest < query.duration) {
      look(at_a.rotation_WB * in_a, ClosingSpeed);
      look(at_b.rotation_WB * in_b, ClosingSpeed);
    }
    if (longest == 0) break;
    t += longest;
  }
  return t;
}

}  // namespace

double Meeting::GapAt(const MeetingQuery& query, double t, double reach, Vector3* normal) {
  ++looks_;
  contacts_.clear();
  CollideShapes(*query.a, query.path_a.At(t).placement(), *query.b, query.path_b.At(t).placement(), reach, &contacts_);
  double least = kFar;
  for (const Contact& c : contacts_) {
    if (!(c.gap < least)) continue;
    least = c.gap;
    *normal = c.normal_W;
  }
  return least;
}

double Meeting::First(const MeetingQuery& query, double until) {
  const double h = query.duration;
  double t = 0, reach = kFar, floor = query.gap - query.deep;
  Vector3 normal = Vector3::UnitZ();
  // Where bodies are round, or have many corners, looks are dear.
  const auto is_dear = [](const Shape& s) { return s.HasAxis() || s.kind() == ShapeKind::kConvexHull; };
  const bool glances = (is_dear(*query.a) || is_dear(*query.b)) && HasSupport(*query.a) && HasSupport(*query.b);
  double last = INFINITY;
  for (int k = 0, touches = 0; k < kAdvances && touches < kTouches; ++k) {
    const double gap = GapAt(query, t, reach, &normal);
    if (gap >= kFar) return h;
    // What overlaps as it begins may part, and has not met again before it is as deep once more, or comes back.
    if (gap >= query.gap) floor = query.gap - query.deep;
    if (t == 0 && gap < query.gap) floor = gap - query.deep;
    if (gap < floor + 0.5 * query.deep && t > 0) return t;
    const double closing = ClosingSpeed(query, t, normal);
    if (gap >= query.gap + query.deep) touches = 0;
    touches += gap < query.gap + query.deep && gap - floor > (1 - 1.0 / kAdvances) * (last - floor);
    last = gap;
    if (closing <= 0) return h;
    const double seen = std::exchange(t, t + std::max(gap - floor, 0.0) / closing);
    if (glances && gap >= query.gap + query.deep) t = Glance(query, seen, t, gap, floor, normal);
    if (t >= std::min(h, until)) return h;
    reach = closing * (h - t) + 2 * query.deep;
  }
  return AlongTouch(query, t, until, normal, floor);
}

double Meeting::GapAtStart(const MeetingQuery& query, double reach) {
  Vector3 normal;
  return GapAt(query, 0, reach, &normal);
}

void TurnToOpenSide(const Partner& a, const Partner& b, double near, double level,
                    const std::function<double(const Contact&)>& cut, std::span<Contact> contacts) {
  const auto is_there = [&](const Contact& c) { return c.gap <= near && c.gap >= -level; };
  const auto velocity = [&](const Contact& c) -> Vector3 {
    return b.at.VelocityAt(c.point_W) - a.at.VelocityAt(c.point_W);
  };
  const auto hit = std::find_if(contacts.begin(), contacts.end(),
                                [&](const Contact& c) { return is_there(c) && -c.normal_W.dot(velocity(c)) > cut(c); });
  if (hit == contacts.end()) return;
  const Vector3 velocity_W = velocity(*hit);
  const double least = cut(*hit), mass_a = a.body.Moves() ? a.body.mass : INFINITY,
               mass_b = b.body.Moves() ? b.body.mass : INFINITY;
  const Placement at_a = a.at.pose.placement(), at_b = b.at.pose.placement();
  Vector3 normal_W;
  if (!LeastClosingSide(a.shape, at_a, b.shape, at_b, level, velocity_W, mass_a > mass_b ? INFINITY : least,
                        mass_b > mass_a ? INFINITY : least, &normal_W))
    return;
  const bool round = a.shape.polytope().vertices.empty() || b.shape.polytope().vertices.empty();
  if (round && -normal_W.dot(velocity_W) <= least) return;  // no edge is where it looks, as far as it passes
  const double gap = SeparationAlong(a.shape, at_a, b.shape, at_b, normal_W);
  for (Contact& c : contacts)
    if (is_there(c) && (normal_W - c.normal_W).norm() > kAngle) c.normal_W = normal_W, c.gap = gap;
}

int CountOverlapping(std::span<const Contact> contacts, const std::function<double(const Contact&)>& size) {
  int pairs = 0;
  const Contact* last = nullptr;
  for (const Contact& c : contacts) {
    if (-c.gap <= kInside * size(c)) continue;
    pairs += !last || !SamePair(*last, c);
    last = &c;
  }
  return pairs;
}

bool ComeNear(const MeetingQuery& query, Meeting* meeting) {
  const double h = query.duration,
               bend = 0.25 * h * h * (query.path_b.half_acceleration_W - query.path_a.half_acceleration_W).norm();
  const auto apart = [&](double t) -> Vector3 {
    const auto centre = [t](const Path& p) -> Vector3 {
      return p.start.position_W + t * p.velocity_W + t * t * p.half_acceleration_W;
    };
    return centre(query.path_b) - centre(query.path_a);
  };
  const Vector3 from = apart(0), way = apart(h) - from;
  const double length = way.squaredNorm(), along = length > 0 ? std::clamp(-from.dot(way) / length, 0.0, 1.0) : 0;
  if ((from + along * way).norm() - bend > query.a->radius() + query.b->radius() + query.gap) return false;
  const double turn = h * std::max(query.path_a.FastestTurn(0, h), query.path_b.FastestTurn(0, h));
  return turn > kLargestTurn || meeting->GapAtStart(query, query.gap) < query.gap || meeting->First(query) < h;
}

// [s] at least until a contact of the last look, at t, is at the floor: as fast as it goes now, since what turns bends away.
double Meeting::Soonest(const MeetingQuery& query, double t, double floor) const {
  const Pose at_a = query.path_a.At(t), at_b = query.path_b.At(t);
  const auto velocity = [&](const Path& path, const Pose& at, const Vector3& point) -> Vector3 {
    return path.VelocityAt(t) + path.RateAt(t).cross(point - at.position_W);
  };
  double soonest = INFINITY;
  for (const Contact& c : contacts_) {
    const double closing =
        -c.normal_W.dot(velocity(query.path_b, at_b, c.point_W) - velocity(query.path_a, at_a, c.point_W));
    if (closing > 0) soonest = std::min(soonest, (c.gap - floor) / closing);
  }
  return soonest;
}

// What touches and turns is looked at each time that it may have moved by half a size, so nothing passes through in between, and where one of
// its corners may be at the floor.
double Meeting::AlongTouch(const MeetingQuery& query, double t, double until, Vector3 normal, double floor) {
  const double h = query.duration, size = std::min(query.a->size(), query.b->size());
  GapAt(query, t, kFar, &normal);
  for (int k = 0; t < std::min(h, until); ++k) {
    const double closing = ClosingSpeed(query, t, normal);
    double next = k < kMostLooks && closing * (h - t) > 0.5 * size ? t + 0.5 * size / closing : h;
    next = std::min(next, t + std::max(Soonest(query, t, floor), h / kTouches));
    if (GapAt(query, next, kFar, &normal) < floor) {
      double low = t, high = next;
      for (int i = 0; i < kHalvings; ++i) {
        const double middle = 0.5 * (low + high), gap = GapAt(query, middle, kFar, &normal);
        (gap < floor ? high : low) = middle;
        if (gap < floor && gap > floor - query.deep) break;
      }
      return high;
    }
    t = next;
  }
  return h;
}

}  // namespace islet::motion
