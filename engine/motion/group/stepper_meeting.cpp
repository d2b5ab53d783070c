// In: the ways of a piece. Out: the first blow on them, and who meets too slowly for one.
#include "engine/motion/group/stepper.h"

#include <algorithm>
#include <cmath>

#include "engine/geometry/edge_contact.h"
#include "engine/geometry/support.h"
#include "qp/smallness.h"

namespace islet::motion {
namespace {

// [m/s] of a contact at t, where the bodies are then.
double ApproachOnWay(const MeetingQuery& query, const Pose& at_a, const Pose& at_b, const Contact& c, double t) {
  const auto velocity = [&](const Path& path, const Pose& at) -> Vector3 {
    return path.VelocityAt(t) + path.RateAt(t).cross(c.point_W - at.position_W);
  };
  return -c.normal_W.dot(velocity(query.path_b, at_b) - velocity(query.path_a, at_a));
}

// Where a point of the body at t was as its way began.
Vector3 AtStart(const Path& path, const Shape& shape, double t, const Vector3& point_W) {
  const Pose now = path.At(t);
  if (TurnsInItself(shape)) return point_W + path.start.position_W - now.position_W;
  const Quaternion seen_WB = VisibleRotation(shape, path.start.rotation_WB, now.rotation_WB);
  return path.start.position_W + path.start.rotation_WB * (seen_WB.conjugate() * (point_W - now.position_W));
}

}  // namespace

// [s] of the first blow within the piece, h if there is none. What is found of a pair does not depend on who was looked at before it.
double Stepper::FindMeeting(double h) {
  double first = h;
  cut_pair_ = -1;
  returned_ = guarded_ = met_ = false;
  slow_.clear();
  FindPaths(h);
  for (size_t p = 0; p < group_->pairs.size(); ++p) {
    if (yields_[p] > 0) continue;
    const GroupPair& pair = group_->pairs[p];
    const bool stays = Touches(static_cast<int>(p)) && freed_[p] == kStays;
    // An overlap by what was not met gets no deeper, or bounces of fine steps sink. A deeper one is that of a pair that gave way.
    const double sunk_by = -GapBefore(static_cast<int>(p)) / Size(pair);
    const bool sunk = sunk_by > 0.5 * kTouching && sunk_by < kTouching;
    MeetingQuery query = WayOf(static_cast<int>(p), h, GapOfBlow(static_cast<int>(p)),
                               stays  ? kTouching
                               : sunk ? kExact
                                      : 0.5 * kTouching);
    if (query.Farthest() < std::max(0.5 * query.deep, Apart(pair, state_))) continue;
    double t = First(query, first), deep = t;
    if (t >= first) continue;
    bool hits = MetInABlow(query, static_cast<int>(p), &t);
    if (!hits) {
      slow_.push_back({static_cast<int>(p), t, query});
      if (!sunk) continue;
      query.deep = kTouching * Size(pair);  // past that hair something may come
      t = deep = First(query, first);
      hits = t < first && MetInABlow(query, static_cast<int>(p), &t);
    }
    if (!hits) continue;
    if (StaysLevel(query, pair, deep)) {
      met_ = true;
      continue;
    }
    first = t;
    cut_pair_ = static_cast<int>(p);
  }
  for (const SlowMeeting& slow : slow_) {  // too slow for a blow: it carries when it is there
    if (slow.time >= first) continue;
    met_ = true;
    if (freed_[slow.pair] == kLeaves) freed_[slow.pair] = kReturns, returned_ = true;
    Guard(slow);
  }
  return first;
}

// Whether a pair that is too deep at t stays as far apart as contacts may be along a flat side of one that faces a flat side of the other: what
// is level with the face that a body slides on is no obstacle.
bool Stepper::StaysLevel(const MeetingQuery& query, const GroupPair& pair, double t) {
  Probe(query, pair, t);
  const Pose at_a = query.path_a.At(t), at_b = query.path_b.At(t);
  const double least = query.gap - 2 * kTouching * Size(pair);  // gaps at both ends of a piece may miss as much
  sides_W_.clear();
  FacingSides(*query.a, at_a.placement(), *query.b, at_b.placement(), -least, &sides_W_);
  return std::any_of(sides_W_.begin(), sides_W_.end(), [&](const Vector3& n) {
    return std::all_of(probe_.begin(), probe_.end(), [&](Contact c) {
      c.normal_W = n;
      return ApproachOnWay(query, at_a, at_b, c, t) <= CutSpeed(c);
    });
  });
}

// Whether a contact that closes like this at t was closed as the piece began, and closes faster and faster since: by then half as fast on the
// mean. Its way bends as it turns, and the same place may have another feature by then.
bool Stepper::ClosesFromRest(const MeetingQuery& query, int number, const Contact& c, double approach, double t) const {
  const Vector3 with_a = AtStart(query.path_a, *query.a, t, c.point_W),
                with_b = AtStart(query.path_b, *query.b, t, c.point_W);
  const double far = kSamePlace * Size(group_->pairs[number]) + 0.5 * (with_a - with_b).norm();
  for (size_t k = 0; k < now_.size(); ++k) {
    if (now_pair_[k] != number || !closed_[k] || approach * t > 4 * (now_[k].gap - c.gap)) continue;
    if (now_[k].feature == c.feature || (now_[k].point_W - 0.5 * (with_a + with_b)).norm() < far) return true;
  }
  return false;
}

// Whether a pair that is too deep at t met in a blow. What its way bends by from there on, by weight or by a turn, is no speed of the
// blow: t goes back to where what is fast was as deep as the piece found it. A rebound that comes back before it is open was none. A point that is none where it would have met is new: the lowest one of a rim that tips about others.
bool Stepper::MetInABlow(const MeetingQuery& query, int number, double* t) {
  const GroupPair& pair = group_->pairs[number];
  const double closed = kExact * Size(pair);
  double later = *t;
  std::uint32_t feature = 0;  // of what is fastest then
  for (int round = 0; round < kHalvings; ++round) {
    ++work_;
    Probe(query, pair, *t);
    const Pose at_a = query.path_a.At(*t), at_b = query.path_b.At(*t);
    double fastest = 0, back = 0;
    bool found = false;
    std::uint32_t fast = 0;
    for (const Contact& c : probe_) {
      found = found || c.feature == feature;
      if (c.gap > kTogether * Size(pair)) continue;  // it is on its way
      if (Presses(number, c.feature)) continue;      // what its way bends by meanwhile is no blow
      const double approach = ApproachOnWay(query, at_a, at_b, c, *t);
      if (approach <= std::max(fastest, CutSpeed(c)) || ClosesFromRest(query, number, c, approach, *t)) continue;
      fastest = approach;
      back = std::max(0.0, query.gap - c.gap) / approach;
      fast = c.feature;
    }
    if (round > 0 && fastest == 0 && !found) {
      *t = later;
      return true;
    }
    if (fastest * back <= closed || *t == 0)
      return fastest > 0 && (freed_[number] == kHits || 0.25 * fastest * *t > closed);
    later = *t;
    feature = fast;
    *t = std::max(0.0, *t - back);
  }
  return true;
}

// What of the pair is near at that moment of its way.
void Stepper::Probe(const MeetingQuery& query, const GroupPair& pair, double t) {
  const auto state = [t](const Path& path) -> State { return {path.At(t), path.VelocityAt(t), path.RateAt(t)}; };
  ProbeAt(pair, state(query.path_a), state(query.path_b), 40 * kTouching * Size(pair));
}

void Stepper::ProbeAt(const GroupPair& pair, const State& a, const State& b, double reach) {
  probe_.clear();
  CollideShapes(*group_->shapes[pair.a], a.pose.placement(), *group_->shapes[pair.b], b.pose.placement(), reach,
                &probe_);
  for (Contact& c : probe_) Mix(pair, &c);
  Turn(pair, a, b, probe_);
}

double Stepper::First(const MeetingQuery& query, double until) {
  const std::int64_t before = meeting_.looks();
  const double first = meeting_.First(query, until);
  const size_t corners = query.a->polytope().vertices.size() + query.b->polytope().vertices.size();
  work_ += static_cast<int>(meeting_.looks() - before) * (1 + static_cast<int>(corners) / kSolveWork);
  return first;
}

void Stepper::FindPaths(double h) {
  paths_.resize(state_.size());
  for (size_t i = 0; i < paths_.size(); ++i) paths_[i] = PathOf(static_cast<int>(i), h);
}

// The query of a pair's way in the piece, by the paths that were found last.
MeetingQuery Stepper::WayOf(int number, double h, double gap, double deep) const {
  const GroupPair& pair = group_->pairs[number];
  MeetingQuery query{group_->shapes[pair.a], group_->shapes[pair.b], paths_[pair.a], paths_[pair.b], h, gap,
                     deep * Size(pair)};
  query.ReachOut();
  return query;
}

// Whether some pair is so deep in each other on its way that it may come out on another side. What hits slowly is stopped over the
// whole piece, and overlaps for a while by less.
bool Stepper::WayIsBarred(double h) {
  FindPaths(h);
  for (size_t p = 0; p < group_->pairs.size(); ++p) {
    if (yields_[p] > 0) continue;
    const int pair = static_cast<int>(p);
    const MeetingQuery way = WayOf(pair, h, GapBefore(pair), kInside);
    if (way.Farthest() > 0.5 * way.deep && First(way, h) < h) return true;
  }
  return false;
}

// A pair that meets within the piece carries at the plane in which it does, through what is nearest then. Its gap is that which
// these points have where the piece begins.
void Stepper::Guard(const SlowMeeting& slow) {
  for (const Guarded& guard : guard_of_)
    if (guard.pair == slow.pair) return;
  const Path &a = slow.query.path_a, &b = slow.query.path_b;
  const Pose at_a = a.At(slow.time), at_b = b.At(slow.time);
  const GroupPair& pair = group_->pairs[slow.pair];
  Probe(slow.query, pair, slow.time);
  for (Contact c : probe_) {
    const bool comes = c.gap > kTogether * Size(pair);
    if (comes && ApproachOnWay(slow.query, at_a, at_b, c, slow.time) > CutSpeed(c)) continue;  // as a blow of its own
    const Vector3 half = 0.5 * c.gap * c.normal_W;
    const double gap = c.normal_W.dot(AtStart(b, *slow.query.b, slow.time, c.point_W + half) -
                                      AtStart(a, *slow.query.a, slow.time, c.point_W - half));
    const Vector3 with_a = c.point_W - (at_a.position_W - a.start.position_W),
                  with_b = c.point_W - (at_b.position_W - b.start.position_W);
    c.body_a = pair.a;
    c.body_b = pair.b;
    guard_of_.push_back(
        {slow.pair, gap, FacesAxis(*group_->shapes[c.body_a], at_a, c), FacesAxis(*group_->shapes[c.body_b], at_b, c)});
    c.point_W = Shared(c, with_a, with_b);
    guards_.push_back(c);
    guarded_ = true;
  }
}

// The piece ends at the blow: secant steps from a moment towards the gap that the pair had at the start, 0 as a rule, as long as they get
// nearer. most: [s] no later than that.
double Stepper::EndAtBlow(double h, double moment, double most) {
  const GroupPair& pair = group_->pairs[cut_pair_];
  const double before = GapOfBlow(cut_pair_);
  double at = std::max(moment, 1e-9 * dt_), best = at, nearest = kFar;
  bool comes = false;  // what hits was not closed as the piece began; what was, and closes slowly, may be deeper then
  for (int k = 0; k < 6; ++k) {
    if (at != h) EndAt(at, &h);
    ProbeAt(pair, end_state_[pair.a], end_state_[pair.b], 1e-2 * Size(pair));
    double gap = kFar, approach = 0;
    for (const Contact& c : probe_) {  // of what hits; other corners of the pair may rest
      const double speed = ClosingAtEnd(c);
      if (speed <= CutSpeed(c)) continue;
      const bool is_new = !ClosedAtStart(cut_pair_, c);
      if (is_new && !comes && k == 0 && c.gap <= kTogether * Size(pair)) comes = true, gap = kFar;
      if (c.gap < gap && (is_new || !comes)) gap = c.gap, approach = speed;
    }
    gap -= before;
    if (std::abs(gap) >= nearest) break;
    nearest = std::abs(gap);
    best = at;
    if (nearest <= kExact * Size(pair)) break;
    at = std::clamp(at + gap / approach, 1e-9 * dt_, most);
  }
  if (h != best) EndAt(best, &h);
  return h;
}

// [m] <= 0: gap at which the pair meets. Where it bounces, an overlap too small to be met is none, or bounces would sink, one by one.
double Stepper::GapOfBlow(int pair) const {
  const double gap = GapBefore(pair);
  return freed_[pair] != kStays && gap > -0.5 * kTouching * Size(group_->pairs[pair]) ? 0 : gap;
}

}  // namespace islet::motion
