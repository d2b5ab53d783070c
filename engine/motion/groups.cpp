#include "engine/motion/groups.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "engine/motion/lever.h"
#include "engine/motion/visible_turn.h"
#include "engine/response/suite_frame.h"
#include "islands/disjoint_sets.h"

namespace islet::motion {
namespace {

constexpr double kMargin = 5e-3;  // of a size: what rests, and what touches it, is near

}  // namespace

Box BoxAround(const Shape& shape, const Vector3& position_W, const Quaternion& rotation_WB) {
  if (shape.kind() == ShapeKind::kSphere) {
    const Vector3 half = Vector3::Constant(shape.radius());
    return {position_W - half, position_W + half};
  }
  const Matrix3 rotation = rotation_WB.toRotationMatrix();
  if (shape.kind() != ShapeKind::kConvexHull) {
    const Vector3 half = rotation.cwiseAbs() * shape.half_extents();
    return {position_W - half, position_W + half};
  }
  Box box{position_W, position_W};
  for (const Vector3& vertex : shape.polytope().vertices) {
    const Vector3 point = position_W + rotation * vertex;
    box.lower = box.lower.cwiseMin(point);
    box.upper = box.upper.cwiseMax(point);
  }
  return box;
}

void Groups::Find(double dt, const Vector3& gravity_W, std::span<const Body> bodies, std::span<const Shape> shapes,
                  std::span<const double> rooms, const ContactFilter& filter) {
  const size_t n = bodies.size();
  rooms_.resize(n);
  cut_.resize(n);
  order_.clear();
  planes_.clear();
  pairs_.clear();
  Vector3 sum = Vector3::Zero(), squares = Vector3::Zero();
  bool asks = !filter.AllowsPlain();
  for (size_t i = 0; i < n; ++i) {
    const Body& body = bodies[i];
    cut_[i] = !CanMove(body);
    if (body.removed) continue;
    asks = asks || !IsPlain(body);
    if (shapes[i].kind() == ShapeKind::kHalfSpace) {
      planes_.push_back(static_cast<int>(i));
      continue;
    }
    const Box now = BoxAround(shapes[i], body.position_W, body.rotation_WB);
    double room = kMargin * shapes[i].size() + (CanMove(body) ? rooms[i] : 0);
    Vector3 way = Vector3::Zero();
    if (CanMove(body)) room += dt * dt * body.force_W.norm() / body.mass;  // of what is frozen, too: it may wake
    if (!StandsStill(body)) {
      way = dt * body.linear_velocity_W;
      room += (gravity_W.norm() + 0.125 * body.arc_W.norm()) * dt * dt;
      if (!TurnsInItself(shapes[i])) {
        double spin = VisibleSpin(shapes[i], body.rotation_WB, body.angular_velocity_W).norm();
        if (!body.torque_W.isZero(0)) spin += dt * SpinOf(body, body.rotation_WB, body.torque_W).norm();
        room += std::min(1.0, 1.2 * dt * spin) * shapes[i].radius();
      }
    }
    const Vector3 margin = Vector3::Constant(room);
    rooms_[i] = {now.lower.cwiseMin(now.lower + way) - margin, now.upper.cwiseMax(now.upper + way) + margin};
    order_.push_back(static_cast<int>(i));
    const Vector3 middle = 0.5 * (rooms_[i].lower + rooms_[i].upper);
    sum += middle;
    squares += middle.cwiseAbs2();
  }
  const auto add = [&](int i, int k, std::vector<std::pair<int, int>>* pairs) {
    if ((CanMove(bodies[i]) || CanMove(bodies[k])) && (!asks || filter.Allows(bodies, i, k)))
      pairs->emplace_back(std::min(i, k), std::max(i, k));
  };
  for (const int p : planes_) {
    const Vector3 up = bodies[p].rotation_WB * Vector3::UnitZ();
    const double moves = dt * bodies[p].linear_velocity_W.norm() + 0.125 * dt * dt * bodies[p].arc_W.norm();
    for (const int i : order_) {
      const Vector3 middle = 0.5 * (rooms_[i].lower + rooms_[i].upper), half = rooms_[i].upper - middle;
      const double turns =
          dt * bodies[p].angular_velocity_W.norm() * ((middle - bodies[p].position_W).norm() + half.norm());
      if (up.dot(middle - bodies[p].position_W) - up.cwiseAbs().dot(half) <= moves + turns) add(p, i, &pairs_);
    }
  }
  // Sweep along the axis on which the bodies are spread most.
  int axis = 0;
  const double count = std::max<double>(1, static_cast<double>(order_.size()));
  (squares / count - (sum / count).cwiseAbs2()).maxCoeff(&axis);
  std::sort(order_.begin(), order_.end(), [&](int i, int k) {
    const double x = rooms_[i].lower[axis], y = rooms_[k].lower[axis];
    return x < y || (x == y && i < k);
  });
  sorted_.clear();
  for (const int i : order_) sorted_.push_back(rooms_[i]);
  const size_t ranges = asks ? 1 : parallel::NumRanges(sorted_.size());
  if (sweeps_.size() < ranges) sweeps_.resize(ranges);
  const auto sweep = [&](const parallel::Range& range, int) {
    auto& [meets, pairs] = sweeps_[range.number];
    meets.resize(sorted_.size());
    pairs.clear();
    for (size_t i = range.first; i < range.last; ++i) {
      size_t met = 0;
      for (size_t k = i + 1; k < sorted_.size() && sorted_[k].lower[axis] <= sorted_[i].upper[axis]; ++k) {
        meets[met] = static_cast<int>(k);
        met += static_cast<size_t>(sorted_[i].Meets(sorted_[k]));
      }
      for (size_t k = 0; k < met; ++k) add(order_[i], order_[meets[k]], &pairs);
    }
  };
  if (asks)  // a callback is asked by one thread
    sweep({0, 0, sorted_.size()}, 0);
  else
    pool_->ForRanges(sorted_.size(), sweep);
  for (const Sweep& part : std::span(sweeps_).first(ranges))
    pairs_.insert(pairs_.end(), part.pairs.begin(), part.pairs.end());
  SortPairs(n);
  parted_.clear();
  islands::BuildPartition({cut_, pairs_}, &partition_);
}

// Joins what comes near in groups of more than `alone`. Marks the others, and those that have a part of more than `most`: such a group needs
// no more looks, nor does a pair that is joined by others.
void Groups::JoinNear(size_t alone, size_t most, double dt, std::span<const Body> bodies, std::span<const Shape> shapes,
                      std::span<const std::pair<int, int>> joined, std::span<const std::uint8_t> stays) {
  whole_.assign(partition_.num_islands(), 1);
  for (int g = 0; g < size(); ++g)
    whole_[g] = bodies_of(g).size() <= alone || std::any_of(bodies_of(g).begin(), bodies_of(g).end(),
                                                            [&](int i) { return !stays.empty() && stays[i] != 0; });
  if (!AnyParted()) return;
  parents_.resize(bodies.size());
  members_.assign(bodies.size(), 1);
  islands::DisjointSets parts(parents_);
  for (const auto& pair : pairs_) {
    const int group = GroupOf(pair), first = parts.Find(pair.first), second = parts.Find(pair.second);
    if (whole_[group] || IsCut(pair) || first == second) continue;
    if (!std::binary_search(joined.begin(), joined.end(), pair) &&
        !ComeNear(dt, pair.first, pair.second, bodies, shapes))
      continue;
    parts.Union(first, second);
    const size_t count = members_[std::min(first, second)] += members_[std::max(first, second)];
    whole_[group] = count > most;
  }
  for (int& parent : parents_) parent = parts.Find(parent);
}

bool Groups::AnyParted() const {
  return std::any_of(whole_.begin(), whole_.end(), [](std::uint8_t whole) { return whole == 0; });
}

void Groups::Part(size_t most, double dt, std::span<const Body> bodies, std::span<const Shape> shapes,
                  std::span<const std::pair<int, int>> joined) {
  JoinNear(1, most, dt, bodies, shapes, joined, {});
  if (!AnyParted()) return;
  unsorted_.clear();
  for (const auto& pair : pairs_) {
    const bool stays = whole_[GroupOf(pair)] || IsCut(pair) || parents_[pair.first] == parents_[pair.second];
    (stays ? unsorted_ : parted_).push_back(pair);
  }
  pairs_.swap(unsorted_);
  islands::BuildPartition({cut_, pairs_}, &partition_);
}

bool Groups::PartsInHalf(size_t most, double dt, std::span<const Body> bodies, std::span<const Shape> shapes,
                         std::span<const std::uint8_t> stays) {
  JoinNear(most, most, 0.5 * dt, bodies, shapes, {}, stays);
  return AnyParted();
}

// Whether two bodies come within the margin of each other on their free ways, under the user's forces. Both fall alike.
bool Groups::ComeNear(double dt, int i, int k, std::span<const Body> bodies, std::span<const Shape> shapes) {
  const auto path = [&](int n) -> Path {
    const Body& b = bodies[n];
    Path way = FreePath(b, shapes[n], StateOf(b), Vector3::Zero());
    if (!b.force_W.isZero(0)) way.half_acceleration_W = 0.5 / b.mass * b.force_W;
    if (!b.torque_W.isZero(0)) {
      way.rate_W = VisibleSpin(shapes[n], b.rotation_WB, b.angular_velocity_W), way.shown = 1;
      way.half_change_W = 0.5 * SpinOf(b, b.rotation_WB, b.torque_W);
    }
    return way;
  };
  const double margin = kMargin * (shapes[i].size() + shapes[k].size());
  return motion::ComeNear({&shapes[i], &shapes[k], path(i), path(k), dt, margin, 0.5 * margin}, &meeting_);
}

// By their first bodies, and those few that share it by their second.
void Groups::SortPairs(size_t num_bodies) {
  starts_.assign(num_bodies + 1, 0);
  for (const auto& [i, k] : pairs_) ++starts_[i + 1];
  std::partial_sum(starts_.begin(), starts_.end(), starts_.begin());
  unsorted_.swap(pairs_);
  pairs_.resize(unsorted_.size());
  for (const auto& pair : unsorted_) pairs_[starts_[pair.first]++] = pair;
  int begin = 0;
  for (const int end : starts_) {  // each has moved on to where the next one starts
    std::sort(pairs_.begin() + begin, pairs_.begin() + end);
    begin = end;
  }
}

bool Groups::StaysInRoom(const Path& path, double duration, const Shape& shape, int number) const {
  const Pose begin = path.start, end = path.At(duration);
  const Box first = BoxAround(shape, begin.position_W, begin.rotation_WB),
            last = BoxAround(shape, end.position_W, end.rotation_WB);
  const Vector3 low = begin.position_W.cwiseMin(end.position_W), high = begin.position_W.cwiseMax(end.position_W),
                reach = Vector3::Constant(shape.radius());
  const double turn = duration * path.FastestTurn(0, duration),
               off_chord = turn == 0 ? 0 : 0.5 * turn * std::min(1.0, 0.25 * turn / path.shown),
               bends = 0.25 * duration * duration * path.half_acceleration_W.norm();
  const Vector3 bow = Vector3::Constant(shape.radius() * std::min(1.0, off_chord)), bend = Vector3::Constant(bends);
  return rooms_[number].Contains({(first.lower.cwiseMin(last.lower) - bow).cwiseMax(low - reach) - bend,
                                  (first.upper.cwiseMax(last.upper) + bow).cwiseMin(high + reach) + bend});
}

}  // namespace islet::motion
