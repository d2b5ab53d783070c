// Which bodies may meet within a step. A body's room is the box that it sweeps, with margin for turning and falling; bodies
// whose rooms meet belong to one group, and whoever moves within its room meets nobody outside of its group.
//
// Rooms are boxes along the world's axes, so groups are parted once more: by those who do meet as far as is known. Who parts them finds out
// afterwards whether anybody else did.
//
//   cut:     at what contacts cannot move: fixed and kinematic bodies; frozen ones join, since what hits them may wake them
//   order:   groups by their smallest body, bodies and pairs ascending
//   threads: one caller at a time    allocation: none after warm-up
#pragma once

#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "engine/body.h"
#include "engine/contact_filter.h"
#include "engine/detection/body_watch.h"
#include "engine/motion/meeting.h"
#include "engine/shape.h"
#include "islands/partition.h"
#include "parallel/worker_pool.h"

namespace islet::motion {

class Groups {
 public:
  explicit Groups(parallel::WorkerPool* pool) : pool_(pool) {}

  // rooms: [m] per body, beside what the body sweeps by its own velocity.
  void Find(double dt, const Vector3& gravity_W, std::span<const Body> bodies, std::span<const Shape> shapes,
            std::span<const double> rooms, const ContactFilter& filter);

  // Parts the groups by the pairs that come near on their free ways and by those `joined` (ascending). One of which a part has more than
  // `most` bodies stays whole.
  void Part(size_t most, double dt, std::span<const Body> bodies, std::span<const Shape> shapes,
            std::span<const std::pair<int, int>> joined);
  // Whether a group of more than `most` would part in half the step. One with a body that `stays` (per body) is not asked.
  bool PartsInHalf(size_t most, double dt, std::span<const Body> bodies, std::span<const Shape> shapes,
                   std::span<const std::uint8_t> stays);
  // The pairs that may meet and are of two groups.
  std::span<const std::pair<int, int>> parted() const { return parted_; }

  int size() const { return partition_.num_islands(); }
  std::span<const int> bodies_of(int group) const { return partition_.bodies_of(group); }
  // The k-th pair of a group: two bodies, ascending.
  int num_pairs(int group) const { return partition_.contact_start[group + 1] - partition_.contact_start[group]; }
  std::pair<int, int> pair(int group, int k) const {
    return pairs_[partition_.contacts[partition_.contact_start[group] + k]];
  }

  // Whether a body that goes this path for that long [s] is within its room all the time.
  bool StaysInRoom(const Path& path, double duration, const Shape& shape, int number) const;

 private:
  bool IsCut(const std::pair<int, int>& pair) const { return cut_[pair.first] || cut_[pair.second]; }
  int GroupOf(const std::pair<int, int>& pair) const {
    return partition_.body_to_island[cut_[pair.first] ? pair.second : pair.first];
  }
  void JoinNear(size_t alone, size_t most, double dt, std::span<const Body> bodies, std::span<const Shape> shapes,
                std::span<const std::pair<int, int>> joined, std::span<const std::uint8_t> stays);
  bool AnyParted() const;
  void SortPairs(size_t num_bodies);
  bool ComeNear(double dt, int i, int k, std::span<const Body> bodies, std::span<const Shape> shapes);

  parallel::WorkerPool* pool_;
  std::vector<Box> rooms_;   // per body; of half-spaces and removed bodies unused
  std::vector<Box> sorted_;  // in order of the sweep
  std::vector<int> order_, planes_, starts_;
  struct Sweep {  // of some places in order_
    std::vector<int> met;
    std::vector<std::pair<int, int>> pairs;
  };
  std::vector<Sweep> sweeps_;
  std::vector<std::pair<int, int>> pairs_, unsorted_;
  std::vector<std::uint8_t> cut_;
  std::vector<std::pair<int, int>> parted_;
  std::vector<std::uint8_t> whole_;     // per group
  std::vector<int> parents_, members_;  // per body: of its part; how many it has, at its root
  islands::Partition partition_;
  Meeting meeting_;
};

// The smallest box around a shape that is no half-space.
Box BoxAround(const Shape& shape, const Vector3& position_W, const Quaternion& rotation_WB);

}  // namespace islet::motion
