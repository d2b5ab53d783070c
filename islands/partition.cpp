#include "islands/partition.h"

#include <cassert>
#include <stdexcept>
#include <string>

#include "islands/disjoint_sets.h"

namespace islet::islands {
namespace {

template <typename Container>
auto& At(Container& values, int index) {
  assert(0 <= index && index < static_cast<int>(values.size()));
  return values[static_cast<std::size_t>(index)];
}

// The island that owns a contact: that of an uncut body of it, -1 if both are cut. Two uncut bodies share an island.
int Owner(const std::vector<int>& body_to_island, const std::pair<int, int>& contact) {
  const int island = At(body_to_island, contact.first);
  return island >= 0 ? island : At(body_to_island, contact.second);
}

// Islands of the bodies, written over the parents of the union-find. Returns how many there are.
int NumberIslands(const Graph& graph, std::vector<int>* body_to_island) {
  body_to_island->resize(graph.cut.size());
  DisjointSets sets(*body_to_island);
  for (const auto& [a, b] : graph.contacts) {
    if (!At(graph.cut, a) && !At(graph.cut, b)) sets.Union(a, b);
  }
  int num_islands = 0;
  for (int body = 0; body < graph.num_bodies(); ++body) {
    int& entry = At(*body_to_island, body);
    if (At(graph.cut, body)) {
      entry = -1;
    } else if (entry == body) {
      entry = num_islands++;  // the smallest body of a new island
    } else {
      entry = At(*body_to_island, entry);  // the parent is smaller, so it has its number already
    }
  }
  return num_islands;
}

// Counting sort of the items 0 .. num_items-1 by row; items with row -1 are left out. Stable, so each row ascends.
template <typename RowOf>
void FillRows(int num_rows, int num_items, RowOf row_of, std::vector<int>* start, std::vector<int>* items) {
  start->assign(static_cast<std::size_t>(num_rows) + 1, 0);
  int num_kept = 0;
  for (int item = 0; item < num_items; ++item) {
    const int row = row_of(item);
    if (row < 0) continue;
    ++At(*start, row);
    ++num_kept;
  }
  int sum = 0;
  for (int& entry : *start) entry = sum += entry;  // now the end of each row
  items->resize(static_cast<std::size_t>(num_kept));
  for (int item = num_items - 1; item >= 0; --item) {
    const int row = row_of(item);
    if (row >= 0) At(*items, --At(*start, row)) = item;  // ends walk back to the starts
  }
}

void Require(bool condition, const char* what, int index) {
  if (!condition) throw std::logic_error("islands::Partition: " + std::string(what) + ", at " + std::to_string(index));
}

// start and items form rows, each ascending, which together hold exactly the items with row_of(item) >= 0.
template <typename RowOf>
void CheckRows(int num_items, RowOf row_of, const std::vector<int>& start, const std::vector<int>& items) {
  Require(start.front() == 0 && start.back() == static_cast<int>(items.size()), "row starts do not span the items", 0);
  int num_expected = 0;
  for (int item = 0; item < num_items; ++item) num_expected += row_of(item) >= 0;
  Require(num_expected == static_cast<int>(items.size()), "wrong number of items", num_expected);
  for (int row = 0; row + 1 < static_cast<int>(start.size()); ++row) {
    Require(At(start, row) <= At(start, row + 1), "row starts descend", row);
    for (int k = At(start, row); k < At(start, row + 1); ++k) {
      const int item = At(items, k);
      Require(0 <= item && item < num_items && row_of(item) == row, "item in a wrong island", item);
      Require(k == At(start, row) || At(items, k - 1) < item, "items do not ascend in an island", item);
    }
  }
}

}  // namespace

void BuildPartition(const Graph& graph, Partition* partition) {
  const std::vector<int>& body_to_island = partition->body_to_island;
  const int num_islands = NumberIslands(graph, &partition->body_to_island);
  FillRows(
      num_islands, graph.num_bodies(), [&](int body) { return At(body_to_island, body); }, &partition->body_start,
      &partition->bodies);
  FillRows(
      num_islands, graph.num_contacts(),
      [&](int contact) { return Owner(body_to_island, At(graph.contacts, contact)); }, &partition->contact_start,
      &partition->contacts);
#ifdef ISLET_VALIDATE
  CheckPartition(graph, *partition);
#endif
}

void CheckPartition(const Graph& graph, const Partition& partition) {
  const std::vector<int>& body_to_island = partition.body_to_island;
  Require(static_cast<int>(body_to_island.size()) == graph.num_bodies(), "body_to_island has a wrong size", 0);
  Require(!partition.body_start.empty() && partition.body_start.size() == partition.contact_start.size(),
          "row starts of bodies and contacts differ in size", 0);
  for (int body = 0; body < graph.num_bodies(); ++body) {
    const int island = At(body_to_island, body);
    const bool has_island = 0 <= island && island < partition.num_islands();
    Require(At(graph.cut, body) ? island == -1 : has_island, "island number of a body out of range", body);
  }
  for (int contact = 0; contact < graph.num_contacts(); ++contact) {
    const auto& [a, b] = At(graph.contacts, contact);
    const int island_a = At(body_to_island, a);
    const int island_b = At(body_to_island, b);
    Require(island_a == island_b || island_a < 0 || island_b < 0, "a contact joins two islands", contact);
  }
  CheckRows(
      graph.num_bodies(), [&](int body) { return At(body_to_island, body); }, partition.body_start, partition.bodies);
  CheckRows(
      graph.num_contacts(), [&](int contact) { return Owner(body_to_island, At(graph.contacts, contact)); },
      partition.contact_start, partition.contacts);

  // Connected: a spanning tree of an island of n bodies merges n - 1 times. Numbered by smallest body.
  std::vector<int> parents(graph.cut.size());
  DisjointSets sets(parents);
  int previous_smallest = -1;
  for (int island = 0; island < partition.num_islands(); ++island) {
    const std::span<const int> bodies = partition.bodies_of(island);
    Require(!bodies.empty(), "an island has no bodies", island);
    Require(previous_smallest < bodies.front(), "islands are not numbered by smallest body", island);
    previous_smallest = bodies.front();
    std::size_t num_merges = 0;
    for (const int contact : partition.contacts_of(island)) {
      const auto& [a, b] = At(graph.contacts, contact);
      if (!At(graph.cut, a) && !At(graph.cut, b)) num_merges += sets.Union(a, b);
    }
    Require(num_merges + 1 == bodies.size(), "an island is not connected", island);
  }
}

}  // namespace islet::islands
