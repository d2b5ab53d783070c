// Where the bodies of an entry stand: one, a grid, a stack, or a cloud drawn at random.
//
//   frames: W      units: SI
//   errors: std::invalid_argument: a cloud that does not fit into its region; bodies piled on the same place
//   threads: pure; the same seed gives the same cloud everywhere
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "scenes/file/scene_description.h"

namespace islet {

struct Pose {
  Vector3 position_W;
  Quaternion rotation_WB;
};

// seed: of a cloud that has none of its own.
std::vector<Pose> PosesOf(const BodyEntry& entry, std::uint64_t seed);

// Whether two such bodies may not overlap.
bool Collide(const BodyDefinition& a, const BodyDefinition& b);

// Refuses what is sure to overlap because two centres are too close, and more than a thousand bodies in one place: quick, where
// the contacts of all of them would take for ever. entry_of: per body the entry that made it.
void RequireRoom(std::span<const BodyDefinition> bodies, std::span<const int> entry_of,
                 std::span<const BodyEntry> entries);

}  // namespace islet
