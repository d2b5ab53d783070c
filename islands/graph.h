// The contact graph as the partition sees it: bodies are numbers, contacts are pairs of them.
//
// A node is a body; it may be marked as cut. An edge is a contact; several contacts may join the same two bodies. The
// graph owns nothing: it looks at arrays of the caller, which must outlive it. No mass, no pose and no impulse is seen
// here, so the same code serves both cuts of a frame (at fixed bodies, then at fixed and still-frozen ones).
//   threads: a view of constant data, to be read from anywhere
#pragma once

#include <cstdint>
#include <span>
#include <utility>

namespace islet::islands {

struct Graph {
  std::span<const std::uint8_t> cut;  // one per body; non-zero: the body joins nothing and is owned by no island
  std::span<const std::pair<int, int>> contacts;  // the two bodies of each contact, both in [0, num_bodies())

  int num_bodies() const { return static_cast<int>(cut.size()); }
  int num_contacts() const { return static_cast<int>(contacts.size()); }
};

}  // namespace islet::islands
