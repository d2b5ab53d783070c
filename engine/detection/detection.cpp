#include "engine/detection/detection.h"

#include <algorithm>
#include <cstdint>
#include <stdexcept>
#include <string>

#include <fcl/broadphase/detail/hierarchy_tree.h>
#include <fcl/config.h>
#include <fcl/math/bv/AABB.h>

#include "engine/detection/body_watch.h"
#include "engine/fcl_version.h"
#include "parallel/worker_pool.h"

namespace islet {
namespace {

using BoundingBox = fcl::AABB<double>;
using Tree = fcl::detail::HierarchyTree<BoundingBox>;
using Node = Tree::NodeType;

// Measured on 1,000 cubes: a refit takes 0.012 ms, a rebuild 0.4 ms. Refits alone let the tree grow bad as bodies mix; FCL's
// incremental balancing instead of rebuilds allocates nothing, but all detection took 4 % longer.
constexpr int kRefitsPerRebuild = 32;
// The room that a body has in the tree is its swept box, longer by another travel and wider by this share of its diameter.
// While it stays inside, its candidates stay. Measured on cubeglass (1,000 cubes, 5 calls a frame): candidates and contacts
// that are kept save a quarter of all detection, most of it in the tree.
constexpr double kRoom = 0.03;

// fcl::AABB::overlap, but inlined.
bool Overlap(const BoundingBox& p, const BoundingBox& q) {
  return p.min_[0] <= q.max_[0] && q.min_[0] <= p.max_[0] && p.min_[1] <= q.max_[1] && q.min_[1] <= p.max_[1] &&
         p.min_[2] <= q.max_[2] && q.min_[2] <= p.max_[2];
}

Box RoomOf(const WatchedBody& body) {
  const double wider = kRoom * body.radius;
  Box room = body.box;
  room.lower.array() += body.travel.array().min(0.0) - wider;
  room.upper.array() += body.travel.array().max(0.0) + wider;
  return room;
}

BoundingBox ToFcl(const Box& box) {
  BoundingBox result;
  result.min_ = box.lower;
  result.max_ = box.upper;
  return result;
}

}  // namespace

const char* FclVersion() { return FCL_VERSION; }

struct Detector::Impl {
  Impl(parallel::WorkerPool* pool_, bool keep_) : pool(pool_), keep(keep_), contacts_of_pairs(pool_) {}

  parallel::WorkerPool* pool;
  bool keep;
  BodyWatch bodies;
  PairContacts contacts_of_pairs;

  Tree tree;
  bool other_bodies = false;  // than those of the tree
  int refits_since_rebuild = 0;
  std::vector<Node*> leaves;      // per body; null for half-spaces and removed bodies
  std::vector<Box> rooms;         // per body that has a leaf
  std::vector<char> leaves_room;  // per body: its candidates must be found again
  std::vector<int> searching;     // those bodies
  std::vector<CandidatePair> pairs, kept, sorted;
  std::vector<std::vector<CandidatePair>> found_by_range;
  std::vector<int> start;  // per body a

  bool LeavesRoom(int body) const;
  void FindLeavers();
  void UpdateTree();
  void BuildTree();
  void FindCandidates();
  void Query(int body, std::vector<const Node*>* stack, std::vector<CandidatePair>* found) const;
  void SortFound();
  void MergeFound();
};

bool Detector::Impl::LeavesRoom(int number) const {
  const WatchedBody& body = bodies[number];
  if (body.removed || body.half_space) return false;
  return !rooms[number].Contains(body.box);
}

// A body whose box has left its room searches anew; so do all if a half-space came or went, and where the tree is built anew, since some
// have far too much room by then.
void Detector::Impl::FindLeavers() {
  const int n = bodies.size();
  const bool fewer = static_cast<int>(leaves.size()) > n;  // another world: its bodies leave
  other_bodies = other_bodies || fewer;
  if (fewer || !keep) pairs.clear();
  const bool all = fewer || !keep || bodies.half_spaces_changed() || refits_since_rebuild >= kRefitsPerRebuild;
  leaves.resize(n, nullptr);
  rooms.resize(n);
  leaves_room.assign(n, 0);
  searching.clear();
  for (int i = 0; i < n; ++i) {
    const WatchedBody& body = bodies[i];
    leaves_room[i] = all || body.rebuilt || (body.changed && LeavesRoom(i));
    if (leaves_room[i]) searching.push_back(i);
  }
}

// Refits the boxes of the tree while its bodies stay the same. What is near is decided box by box, so neither the
// tree's shape nor its history changes the contacts.
void Detector::Impl::UpdateTree() {
  for (int i : searching) {
    const bool in_tree = !bodies[i].half_space && !bodies[i].removed;
    if (in_tree) rooms[i] = keep ? RoomOf(bodies[i]) : bodies[i].box;
    if (in_tree != (leaves[i] != nullptr)) {
      other_bodies = true;
    } else if (in_tree) {
      leaves[i]->bv = ToFcl(rooms[i]);
    }
  }
  if (other_bodies) {
    BuildTree();
  } else if (refits_since_rebuild >= kRefitsPerRebuild) {
    tree.balanceTopdown();
    refits_since_rebuild = 0;
  } else if (!tree.empty()) {
    tree.refit();
    ++refits_since_rebuild;
  }
}

// From all bodies at once: of FCL's insertion a row of bodies makes a list.
void Detector::Impl::BuildTree() {
  std::vector<Node*> nodes;
  for (int i = 0; i < bodies.size(); ++i) {
    leaves[i] = nullptr;
    if (bodies[i].half_space || bodies[i].removed) continue;
    auto* leaf = new Node;  // NOLINT(cppcoreguidelines-owning-memory): the tree deletes it
    leaf->bv = ToFcl(rooms[i]);
    // NOLINTNEXTLINE(performance-no-int-to-ptr): FCL's trees hold a pointer, here a number
    leaf->data = reinterpret_cast<void*>(static_cast<std::intptr_t>(i));
    nodes.push_back(leaves[i] = leaf);
  }
  tree.clear();
  if (!nodes.empty()) tree.init(nodes);
  other_bodies = false;
  refits_since_rebuild = 0;
}

void Detector::Impl::Query(int body, std::vector<const Node*>* stack, std::vector<CandidatePair>* found) const {
  auto append = [&](int other) {
    if (!bodies[body].dynamic && !bodies[other].dynamic) return;
    CandidatePair pair;
    pair.a = std::min(body, other);
    pair.b = std::max(body, other);
    found->push_back(pair);
  };
  auto consider = [&](int other) {
    if (other != body && !(leaves_room[other] && other < body))
      append(other);  // of two that search the smaller reports
  };
  const BoundingBox box = ToFcl(rooms[body]);
  stack->clear();
  if (const Node* root = const_cast<Tree&>(tree).getRoot(); root && Overlap(root->bv, box)) stack->push_back(root);
  while (!stack->empty()) {
    const Node* node = stack->back();
    stack->pop_back();
    if (node->isLeaf()) {
      consider(static_cast<int>(reinterpret_cast<std::intptr_t>(node->data)));
      continue;
    }
    for (const Node* child : node->children) {
      if (Overlap(child->bv, box)) stack->push_back(child);
    }
  }
  for (int half_space : bodies.half_spaces()) append(half_space);
}

void Detector::Impl::FindCandidates() {
  if (searching.empty()) return;
  UpdateTree();
  const size_t ranges = parallel::NumRanges(searching.size());
  if (found_by_range.size() < ranges) found_by_range.resize(ranges);
  pool->ForRanges(searching.size(), [&](const parallel::Range& range, int) {
    static thread_local std::vector<const Node*> stack;
    found_by_range[range.number].clear();
    for (size_t k = range.first; k < range.last; ++k)
      if (leaves[searching[k]]) Query(searching[k], &stack, &found_by_range[range.number]);
  });
  SortFound();
  MergeFound();
}

// By a with one counting pass, then by b inside each short run.
void Detector::Impl::SortFound() {
  const int n = bodies.size();
  const auto parts = std::span(found_by_range).first(parallel::NumRanges(searching.size()));
  start.assign(n + 1, 0);
  for (const auto& part : parts) {
    for (const CandidatePair& pair : part) ++start[pair.a + 1];
  }
  for (int i = 0; i < n; ++i) start[i + 1] += start[i];
  sorted.resize(start[n]);
  for (const auto& part : parts) {
    for (const CandidatePair& pair : part) sorted[start[pair.a]++] = pair;
  }
  int begin = 0;
  for (int i = 0; i < n; ++i) {
    std::sort(sorted.begin() + begin, sorted.begin() + start[i],
              [](const CandidatePair& p, const CandidatePair& q) { return p.b < q.b; });
    begin = start[i];
  }
}

// Old pairs of bodies that searched give way to the found ones. A pair that is found again keeps its contacts.
void Detector::Impl::MergeFound() {
  const auto before = [](const CandidatePair& p, const CandidatePair& q) { return p.a != q.a ? p.a < q.a : p.b < q.b; };
  kept.clear();
  auto next = sorted.begin();
  for (const CandidatePair& old : pairs) {
    while (next != sorted.end() && before(*next, old)) kept.push_back(*next++);
    if (next != sorted.end() && !before(old, *next)) {
      const bool same_bodies = !bodies[old.a].rebuilt && !bodies[old.b].rebuilt;
      kept.push_back(same_bodies ? old : *next);
      ++next;
    } else if (!leaves_room[old.a] && !leaves_room[old.b]) {
      kept.push_back(old);
    }
  }
  kept.insert(kept.end(), next, sorted.end());
  std::swap(pairs, kept);
}

Detector::Detector(parallel::WorkerPool* pool, bool keep) : impl_(std::make_unique<Impl>(pool, keep)) {}
Detector::~Detector() = default;

KeptContacts Detector::kept() const { return impl_->contacts_of_pairs.kept(); }

void Detector::Detect(std::span<const Body> bodies, std::span<const Shape> shapes, std::span<const Vector3> travel_W,
                      std::span<const double> margins, std::vector<Contact>* contacts, bool include_frozen,
                      const PairRule* rule) {
  auto require_size = [&](const char* field, size_t size) {
    if (size == bodies.size()) return;
    throw std::invalid_argument(std::string("Detect: ") + field + " has " + std::to_string(size) + " entries for " +
                                std::to_string(bodies.size()) + " bodies");
  };
  require_size("shapes", shapes.size());
  require_size("travel_W", travel_W.size());
  require_size("margins", margins.size());
  impl_->bodies.Update(bodies, shapes, travel_W, margins, impl_->pool);
  impl_->FindLeavers();
  impl_->FindCandidates();
  impl_->contacts_of_pairs.Collide(impl_->bodies, include_frozen, rule, &impl_->pairs, contacts);
}

}  // namespace islet
