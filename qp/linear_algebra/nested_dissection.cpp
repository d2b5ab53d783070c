#include "qp/linear_algebra/nested_dissection.h"

#include <algorithm>
#include <bit>
#include <numeric>

namespace islet::qp {
namespace {

constexpr int kPiece = 80;  // nodes: larger pieces are dissected, larger graphs are coarsened
constexpr int kStarts = 4;  // separators tried on the coarsest graph

}  // namespace

void NestedDissection::Order(GraphView graph, std::vector<int>* order) {
  const int n = graph.size();
  graph_ = graph;
  nodes_.resize(n);
  std::iota(nodes_.begin(), nodes_.end(), 0);
  local_.assign(n, -1);
  mark_.resize(n);
  search_.Reset(n);
  if (levels_.empty()) levels_.resize(24);
  Dissect(0, n);
  order->assign(nodes_.begin(), nodes_.end());
}

// First half, second half, separator.
void NestedDissection::Dissect(int begin, int end) {
  while (end - begin > kPiece && Separate(begin, end)) {
    const std::vector<Side>& side = levels_[0].side;
    const int first = size_[kFirst], second = size_[kSecond];
    before_.assign(nodes_.begin() + begin, nodes_.begin() + end);
    int to[3] = {begin, begin + first, begin + first + second};
    for (int i = 0; i < end - begin; ++i) nodes_[to[side[i]]++] = before_[i];
    Dissect(begin, begin + first);
    begin += first;
    end = begin + second;
  }
  OrderPiece(begin, end);
}

void NestedDissection::TakePiece(int begin, int end) {
  WeightedGraph& level = levels_[0];
  level.n = total_ = end - begin;
  for (int i = begin; i < end; ++i) local_[nodes_[i]] = i - begin;
  level.start.assign(1, 0);
  level.adjacency.clear();
  for (int i = begin; i < end; ++i) {
    for (int next : graph_.neighbours(nodes_[i]))
      if (local_[next] >= 0) level.adjacency.push_back(local_[next]);
    level.start.push_back(static_cast<int>(level.adjacency.size()));
  }
  for (int i = begin; i < end; ++i) local_[nodes_[i]] = -1;
  level.weight.assign(level.n, 1);
  level.edge.assign(level.adjacency.size(), 1);
  level.side.resize(level.n);
}

// If not, what hangs together with node 0 becomes the first half.
bool NestedDissection::IsConnected() {
  WeightedGraph& level = levels_[0];
  level.side.assign(level.n, kSecond);
  queue_.assign(1, 0);
  level.side[0] = kFirst;
  for (size_t i = 0; i < queue_.size(); ++i) {
    for (int e = level.start[queue_[i]]; e < level.start[queue_[i] + 1]; ++e) {
      const int next = level.adjacency[e];
      if (level.side[next] == kSecond) level.side[next] = kFirst, queue_.push_back(next);
    }
  }
  const int found = static_cast<int>(queue_.size());
  size_ = {found, level.n - found, 0};
  return found == level.n;
}

// Joins neighbours in pairs, first those with most edges between them.
bool NestedDissection::Coarsen(int at, bool backwards) {
  WeightedGraph& fine = levels_[at];
  WeightedGraph& coarse = levels_[at + 1];
  const int heaviest = std::max(2, 3 * total_ / (2 * kPiece));
  fine.coarse.assign(fine.n, -1);
  queue_.clear();  // per coarse node: its one or two fine ones
  for (int k = 0; k < fine.n; ++k) {
    const int i = backwards ? fine.n - 1 - k : k;
    if (fine.coarse[i] >= 0) continue;
    int mate = i;
    int most = 0;
    for (int e = fine.start[i]; e < fine.start[i + 1]; ++e) {
      const int next = fine.adjacency[e];
      if (fine.coarse[next] >= 0 || fine.weight[i] + fine.weight[next] > heaviest) continue;
      if (fine.edge[e] > most || (fine.edge[e] == most && fine.weight[next] < fine.weight[mate]))
        most = fine.edge[e], mate = next;
    }
    fine.coarse[i] = fine.coarse[mate] = static_cast<int>(queue_.size()) / 2;
    queue_.push_back(i), queue_.push_back(mate);
  }
  coarse.n = static_cast<int>(queue_.size()) / 2;
  if (coarse.n > fine.n * 9 / 10) return false;
  coarse.start.assign(1, 0);
  coarse.adjacency.clear(), coarse.edge.clear();
  coarse.weight.resize(coarse.n), coarse.side.resize(coarse.n);
  std::fill_n(mark_.begin(), coarse.n, -1);
  for (int c = 0; c < coarse.n; ++c) {
    const int pair[2] = {queue_[2 * c], queue_[2 * c + 1]};
    const int members = pair[0] == pair[1] ? 1 : 2, begin = coarse.start.back();
    coarse.weight[c] = 0;
    for (int m = 0; m < members; ++m) {
      coarse.weight[c] += fine.weight[pair[m]];
      for (int e = fine.start[pair[m]]; e < fine.start[pair[m] + 1]; ++e) {
        const int next = fine.coarse[fine.adjacency[e]];
        if (next == c) continue;
        if (mark_[next] < begin) {
          mark_[next] = static_cast<int>(coarse.adjacency.size());
          coarse.adjacency.push_back(next), coarse.edge.push_back(0);
        }
        coarse.edge[mark_[next]] += fine.edge[e];
      }
    }
    coarse.start.push_back(static_cast<int>(coarse.adjacency.size()));
  }
  return true;
}

bool NestedDissection::Separate(int begin, int end) {
  TakePiece(begin, end);
  if (!IsConnected()) return true;  // nothing to separate
  int least = total_;
  std::array<int, 3> best_size{};
  for (int way = 0; way < 2; ++way) {
    int last = 0;
    while (levels_[last].n > kPiece && last + 2 < static_cast<int>(levels_.size()) && Coarsen(last, way == 1)) ++last;
    WeightedGraph& coarsest = levels_[last];
    int best = total_ + 1;
    for (int s = 0; s < kStarts; ++s) {
      search_.Halve(total_, coarsest.n * s / kStarts, &coarsest);
      search_.Improve(total_, &coarsest);
      if (search_.size()[kSeparator] >= best) continue;
      best = search_.size()[kSeparator];
      best_coarse_ = coarsest.side;
    }
    coarsest.side = best_coarse_;
    for (int l = last; l >= 0; --l) {
      if (l < last) {
        for (int i = 0; i < levels_[l].n; ++i) levels_[l].side[i] = levels_[l + 1].side[levels_[l].coarse[i]];
      }
      search_.Improve(total_, &levels_[l]);
    }
    if (search_.size()[kSeparator] >= least) continue;
    least = search_.size()[kSeparator];
    best_size = search_.size();
    best_side_ = levels_[0].side;
  }
  size_ = best_size;
  if (least >= total_ || size_[kFirst] == 0 || size_[kSecond] == 0) return false;
  levels_[0].side = best_side_;
  return true;
}

// Exact minimum degree over rows of bits: the nodes of the piece and, as columns only, what lies around it.
void NestedDissection::OrderPiece(int begin, int end) {
  const int n = end - begin;
  if (n <= 1) return;
  queue_.assign(nodes_.begin() + begin, nodes_.begin() + end);
  std::sort(queue_.begin(), queue_.end());
  for (int i = 0; i < n; ++i) local_[queue_[i]] = i;
  for (int i = 0; i < n; ++i) {
    for (int next : graph_.neighbours(queue_[i])) {
      if (local_[next] >= 0) continue;
      local_[next] = static_cast<int>(queue_.size());
      queue_.push_back(next);
    }
  }
  const int words = (static_cast<int>(queue_.size()) + 63) / 64;
  rows_.assign(static_cast<size_t>(n) * words, 0);
  const auto row = [&](int i) { return rows_.data() + static_cast<size_t>(i) * words; };
  const auto degree = [&](int i) {
    int count = 0;
    for (int w = 0; w < words; ++w) count += std::popcount(row(i)[w]);
    return count;
  };
  degree_.resize(n);  // degrees; -1: eliminated
  for (int i = 0; i < n; ++i) {
    for (int next : graph_.neighbours(queue_[i])) row(i)[local_[next] / 64] |= std::uint64_t{1} << local_[next] % 64;
    degree_[i] = degree(i);
  }
  for (int k = 0; k < n; ++k) {
    int least = -1;
    for (int i = 0; i < n; ++i)
      if (degree_[i] >= 0 && (least < 0 || degree_[i] < degree_[least])) least = i;
    nodes_[begin + k] = queue_[least];
    degree_[least] = -1;
    for (int w = 0; w < (n + 63) / 64; ++w) {
      for (std::uint64_t bits = row(least)[w]; bits != 0; bits &= bits - 1) {
        const int i = 64 * w + std::countr_zero(bits);
        if (i >= n) break;
        for (int v = 0; v < words; ++v) row(i)[v] |= row(least)[v];
        row(i)[least / 64] &= ~(std::uint64_t{1} << least % 64);
        row(i)[i / 64] &= ~(std::uint64_t{1} << i % 64);
        degree_[i] = degree(i);
      }
    }
  }
  for (int node : queue_) local_[node] = -1;
}

}  // namespace islet::qp
