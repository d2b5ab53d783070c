#include "engine/motion/meeting.h"

#include <algorithm>
#include <cmath>

namespace islet::motion {
namespace {

constexpr int kAdvances = 100;   // of one pair; one that grazes meets after so many, while still apart
constexpr int kHalvings = 24;    // for pairs that touch when the piece begins
constexpr double kRounding = 1e-6;  // of `near`
constexpr double kFar = 1e300;   // [m] gap of what is out of reach

// [m/s] fastest closing of the gap along the normal (from a to b) from t on: a relative velocity that changes linearly is
// fastest at an end; a turn moves no point along the normal faster than |rate x normal| radius.
double ClosingSpeed(const MeetingQuery& query, double t, const Vector3& normal) {
  const auto approach = [&](double time) {
    return -normal.dot(query.path_b.VelocityAt(time) - query.path_a.VelocityAt(time));
  };
  // The normal of a pair turns with the pair, so the whole rate counts.
  return std::max(approach(t), approach(query.duration)) + query.path_a.TurnSpeed(t, query.duration) +
         query.path_b.TurnSpeed(t, query.duration);
}

}  // namespace

double Meeting::GapAt(const MeetingQuery& query, double t, double reach, Vector3* normal) {
  contacts_.clear();
  CollideShapes(*query.a, query.path_a.At(t).placement(), *query.b, query.path_b.At(t).placement(), reach, &contacts_);
  double least = kFar;
  for (const Contact& c : contacts_) {
    least = std::min(least, c.gap);
    *normal = c.normal_W;
  }
  return least;
}

double Meeting::First(const MeetingQuery& query) {
  Vector3 normal = Vector3::UnitZ();
  const Vector3 relative = query.path_b.velocity_W - query.path_a.velocity_W;
  const Vector3 bend = query.path_b.half_acceleration_W - query.path_a.half_acceleration_W;
  const double h = query.duration;
  const double reach = h * (relative.norm() + 2 * h * bend.norm() + query.path_a.TurnSpeed(0, h) + query.path_b.TurnSpeed(0, h)) +
                       4 * query.near;
  const double gap = GapAt(query, 0, reach, &normal);
  if (gap >= kFar) return h;
  return gap <= 2 * query.near ? FirstOfNear(query) : Advance(query, 0, gap, normal);
}

double Meeting::Advance(const MeetingQuery& query, double t, double gap, Vector3 normal) {
  for (int k = 0; k < kAdvances; ++k) {
    const double closing = ClosingSpeed(query, t, normal);
    if (closing <= 0) return query.duration;
    t += (gap - 0.5 * query.near) / closing;
    if (t >= query.duration) return query.duration;
    gap = GapAt(query, t, closing * (query.duration - t) + 2 * query.near, &normal);
    if (gap >= kFar) return query.duration;
    if (gap < query.near) return t;
  }
  return t;
}

// A gap that opens is left alone until it is open; one that stays closed meets only where another feature comes down.
double Meeting::FirstOfNear(const MeetingQuery& query) {
  Vector3 normal = Vector3::UnitZ(), unused;
  const double h = query.duration, reach = 8 * query.near;
  GapAt(query, 0, reach, &normal);
  const double opening = normal.dot(query.path_b.velocity_W - query.path_a.velocity_W);
  for (double parted = opening > 0 ? 4 * query.near / opening : h; parted < h; parted *= 2) {
    const double gap = GapAt(query, parted, kFar, &normal);
    if (gap > 2 * query.near) return Advance(query, parted, gap, normal);
    if (gap < -query.near) break;
  }
  const double deep = query.gap - (query.leaves ? kRounding : 1) * query.near;
  if (GapAt(query, h, reach, &unused) >= 2 * deep - query.gap) return h;
  double low = 0, high = h;
  for (int k = 0; k < kHalvings; ++k) {
    const double t = 0.5 * (low + high), gap = GapAt(query, t, reach, &unused);
    (gap < deep ? high : low) = t;
    if (gap < deep && gap > 2 * deep - query.gap) break;
  }
  return high;
}

}  // namespace islet::motion
