// A world at one moment, kept: World::Save() makes it, World::Restore() goes back to it.
//
//   holds     bodies, shapes, gravity, time, contacts, the impulses that contacts remember, the watch on what stands still
//   lacks     settings other than gravity, callbacks: those of the world that restores stay, so a run can be continued on
//             another number of threads, or with another tolerance
//   promise   with equal settings and callbacks the continued run is the uninterrupted one, bit for bit. A world that was given callbacks
//             after it was saved, or another one that has some, is woken; of bytes nobody knows whose they were
//   threads: immutable; copies share their data, and any number of worlds may restore from one at a time
#pragma once

#include <cstddef>
#include <memory>
#include <span>
#include <utility>
#include <vector>

namespace islet {

class WorldSnapshot {
 public:
  // To files and other machines (little-endian, as all that islet runs on).
  std::vector<std::byte> ToBytes() const;
  // What is cut off, damaged, or of another version is refused: std::invalid_argument says which.
  static WorldSnapshot FromBytes(std::span<const std::byte> bytes);

 private:
  friend class World;
  struct Data;
  explicit WorldSnapshot(std::shared_ptr<const Data> data) : data_(std::move(data)) {}
  std::shared_ptr<const Data> data_;
};

}  // namespace islet
