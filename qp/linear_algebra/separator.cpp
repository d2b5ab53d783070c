#include "qp/linear_algebra/separator.h"

#include <algorithm>

namespace islet::qp {
namespace {

constexpr double kLargerHalf = 0.56;  // of a piece that is separated
constexpr int kMovesBeyond = 15;      // without a better separator, before a pass ends

}  // namespace

void SeparatorSearch::Reset(int nodes) {
  place_.resize(nodes);
  gain_.resize(nodes);
  moved_.assign(nodes, 0);
  pass_ = 0;
}

void SeparatorSearch::Halve(int total, int root, WeightedGraph* graph) {
  std::fill(graph->side.begin(), graph->side.end(), kSecond);
  queue_.assign(1, root);
  graph->side[root] = kFirst;
  int weight = graph->weight[root];
  for (size_t i = 0; i < queue_.size(); ++i) {
    for (int e = graph->start[queue_[i]]; e < graph->start[queue_[i] + 1]; ++e) {
      const int next = graph->adjacency[e];
      if (graph->side[next] != kSecond) continue;
      if (2 * weight < total) {
        graph->side[next] = kFirst;
        weight += graph->weight[next];
        queue_.push_back(next);
      } else {
        graph->side[next] = kSeparator;
      }
    }
  }
}

void SeparatorSearch::ComputeGains(const WeightedGraph& graph, int node) {
  int near[3] = {0, 0, 0};
  for (int e = graph.start[node]; e < graph.start[node + 1]; ++e)
    near[graph.side[graph.adjacency[e]]] += graph.weight[graph.adjacency[e]];
  gain_[node] = {graph.weight[node] - near[kSecond], graph.weight[node] - near[kFirst]};
}

void SeparatorSearch::Enter(WeightedGraph* graph, int node) {
  size_[graph->side[node]] -= graph->weight[node];
  size_[kSeparator] += graph->weight[node];
  graph->side[node] = kSeparator;
  place_[node] = static_cast<int>(separator_.size());
  separator_.push_back(node);
}

void SeparatorSearch::Leave(WeightedGraph* graph, int node, Side to) {
  separator_[place_[node]] = separator_.back();
  place_[separator_.back()] = place_[node];
  separator_.pop_back();
  size_[kSeparator] -= graph->weight[node];
  size_[to] += graph->weight[node];
  graph->side[node] = to;
}

// A node of the separator joins a side; its neighbours on the other side come into the separator.
void SeparatorSearch::Move(WeightedGraph* graph, int node, Side to) {
  const Side other = to == kFirst ? kSecond : kFirst;
  Leave(graph, node, to);
  moved_[node] = pass_;
  undo_.push_back(node), undo_.push_back(kSeparator);
  for (int e = graph->start[node]; e < graph->start[node + 1]; ++e) {
    const int next = graph->adjacency[e];
    if (graph->side[next] == kSeparator) {
      gain_[next][other] -= graph->weight[node];
    } else if (graph->side[next] == other) {
      undo_.push_back(next), undo_.push_back(other);
      Enter(graph, next);
      for (int f = graph->start[next]; f < graph->start[next + 1]; ++f) {
        const int beyond = graph->adjacency[f];
        if (graph->side[beyond] == kSeparator) gain_[beyond][to] += graph->weight[next];
      }
      ComputeGains(*graph, next);
    }
  }
}

// Takes moves back until `length` entries of undo_ are left.
void SeparatorSearch::Return(WeightedGraph* graph, size_t length) {
  while (undo_.size() > length) {
    const int node = undo_[undo_.size() - 2];
    const Side from = static_cast<Side>(undo_.back());
    undo_.resize(undo_.size() - 2);
    if (from == kSeparator) {
      Enter(graph, node);
    } else {
      Leave(graph, node, from);
    }
  }
}

void SeparatorSearch::CountSides(const WeightedGraph& graph) {
  size_ = {0, 0, 0};
  separator_.clear();
  for (int i = 0; i < graph.n; ++i) {
    size_[graph.side[i]] += graph.weight[i];
    if (graph.side[i] != kSeparator) continue;
    place_[i] = static_cast<int>(separator_.size());
    separator_.push_back(i);
  }
}

// The move of best gain among nodes that this pass has not moved, -1 if there is none.
int SeparatorSearch::Choose(int limit, const WeightedGraph& graph, Side* to) const {
  int chosen = -1, chosen_gain = 0;
  const Side lighter = size_[kFirst] <= size_[kSecond] ? kFirst : kSecond;
  for (int node : separator_) {
    if (moved_[node] == pass_) continue;
    for (Side side : {kFirst, kSecond}) {
      if (size_[side] + graph.weight[node] > limit && side != lighter) continue;
      const int gain = 2 * gain_[node][side] + (side == lighter);
      if (chosen < 0 || gain > chosen_gain) chosen = node, chosen_gain = gain, *to = side;
    }
  }
  return chosen;
}

// Each node is moved at most once; goes on through worse separators and returns to the best one that it saw. True if that
// is better than the one before.
bool SeparatorSearch::Pass(int limit, WeightedGraph* graph) {
  ++pass_;
  undo_.clear();
  for (int node : separator_) ComputeGains(*graph, node);
  const auto larger = [&] { return std::max(size_[kFirst], size_[kSecond]); };
  size_t best_length = 0;
  int best = size_[kSeparator], best_larger = larger();
  const int before = best, larger_before = best_larger;
  for (int since = 0; since < kMovesBeyond; ++since) {
    Side to = kFirst;
    const int chosen = Choose(limit, *graph, &to);
    if (chosen < 0) break;
    Move(graph, chosen, to);
    if (larger() > limit && larger() >= best_larger) continue;
    const bool balances = best_larger > limit && larger() < best_larger;
    if (balances || size_[kSeparator] < best || (size_[kSeparator] == best && larger() < best_larger)) {
      best = size_[kSeparator], best_larger = larger(), best_length = undo_.size();
      since = -1;
    }
  }
  Return(graph, best_length);
  return best != before || best_larger != larger_before;
}

// Ends: a pass that counts makes the larger side smaller while that is too large, else the separator, else the larger side.
void SeparatorSearch::Improve(int total, WeightedGraph* graph) {
  const int limit = static_cast<int>(kLargerHalf * total);
  CountSides(*graph);
  while (Pass(limit, graph)) {
  }
}

}  // namespace islet::qp
