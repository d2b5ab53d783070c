// Splits a contact graph into islands: bodies joined by contacts, the graph being cut at the bodies marked as cut.
//
//     1 --- 2 --- [3] --- 4      [5]       cut: 3, 5
//            \            |
//             6           7 --- [5]        islands: {1, 2, 6} with contacts 1-2, 2-3, 2-6
//                                                   {4, 7}    with contacts 3-4, 4-7, 7-5
//
//   in:    a Graph (constant)
//   out:   a Partition; nothing else survives between calls
//   order: islands are numbered by their smallest body; bodies and contacts ascend inside each. Neither the order of
//          the contacts nor the number of threads changes which bodies form which island
//   size:  linear in bodies and contacts, up to the logarithm of union-find
//   threads: pure functions, safe from anywhere                                        [SM04 Sec. 5.2]
#pragma once

#include <span>
#include <vector>

#include "islands/graph.h"

namespace islet::islands {

struct Partition {
  std::vector<int> body_start;      // size num_islands() + 1; island i owns bodies[body_start[i] .. body_start[i + 1])
  std::vector<int> bodies;          // every uncut body exactly once; one without contacts is an island of its own
  std::vector<int> contact_start;   // size num_islands() + 1
  std::vector<int> contacts;        // every contact with at least one uncut body exactly once
  std::vector<int> body_to_island;  // one per body of the graph; -1 for a cut body

  int num_islands() const { return body_start.empty() ? 0 : static_cast<int>(body_start.size()) - 1; }
  std::span<const int> bodies_of(int island) const { return Row(body_start, bodies, island); }
  std::span<const int> contacts_of(int island) const { return Row(contact_start, contacts, island); }

  friend bool operator==(const Partition&, const Partition&) = default;

 private:
  static std::span<const int> Row(const std::vector<int>& start, const std::vector<int>& values, int row) {
    const auto i = static_cast<std::size_t>(row);
    return std::span<const int>(values).subspan(static_cast<std::size_t>(start[i]),
                                                static_cast<std::size_t>(start[i + 1] - start[i]));
  }
};

// Contacts between two cut bodies are dropped: nothing could move. Requires that contacts name bodies of the graph. Keeps the memory of an
// earlier partition: allocates only when this graph is larger than those before.
void BuildPartition(const Graph& graph, Partition* partition);

// Throws std::logic_error with a sentence if `partition` is not the partition of `graph`. Runs after every build when
// ISLET_VALIDATE is on; costs about as much as the build.
void CheckPartition(const Graph& graph, const Partition& partition);

}  // namespace islet::islands
