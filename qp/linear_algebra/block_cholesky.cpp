#include "qp/linear_algebra/block_cholesky.h"

#include <algorithm>
#include <atomic>
#include <bit>
#include <cassert>
#include <cstdint>
#include <cstring>

namespace islet::qp {
namespace {

void CopyBlock(double* to, const double* from, int block) {
  for (int i = 0; i < block; i += 6) std::memcpy(to + i, from + i, 6 * sizeof(double));  // a fixed size is no call
}

// Of a solve with it: it has more lines than two pieces.
bool IsWorthForks(const Front& front) { return front.EndLine() > 2 * kPanelBlock; }

// Claims the lowest bit that is not set. Which one it is depends on timing, and nothing may depend on it but addresses.
int TakeLowest(std::atomic<std::uint64_t>* taken) {
  std::uint64_t now = taken->load();
  while (!taken->compare_exchange_weak(now, now | (now + 1))) {
  }
  return std::countr_one(now);
}

// piece(begin, end) over ranges of `step` lines, the last ones first: they are the longest.
template <typename Piece>
void ForkLines(int begin, int end, int step, const Piece& piece) {
  const int count = (end - begin + step - 1) / step;
  parallel::Fork(count, [&](int i) {
    const int from = begin + (count - 1 - i) * step;
    piece(from, std::min(from + step, end));
  });
}

}  // namespace

void AlignedNumbers::Resize(size_t size) {
  if (numbers_.size() >= size + kVector) return;
  numbers_.assign(size + kVector, 0.0);
  const auto address = reinterpret_cast<std::uintptr_t>(numbers_.data()) / sizeof(double);
  offset_ = (kVector - address % kVector) % kVector;
}

size_t BlockCholesky::SpacePlan::Take(size_t size) {
  size_t at = 0;
  auto place = taken_.begin();
  for (; place != taken_.end() && place->at < at + size; ++place) at = place->at + place->size;
  taken_.insert(place, {at, size});
  total_ = std::max(total_, at + size);
  return at;
}

void BlockCholesky::SpacePlan::Free(size_t at) {
  taken_.erase(std::find_if(taken_.begin(), taken_.end(), [at](const Interval& i) { return i.at == at; }));
}

bool BlockCholesky::Analyse(int num_nodes, int block, std::span<const std::array<int, 2>> pairs) {
  if (num_nodes == num_nodes_ && block == block_ &&
      std::equal(pairs.begin(), pairs.end(), pairs_.begin(), pairs_.end()))
    return false;
  num_nodes_ = num_nodes;
  block_ = block;
  pairs_.assign(pairs.begin(), pairs.end());
  analysis_.Analyse(num_nodes, pairs, &elimination_);
  PlaceFronts();
  return true;
}

void BlockCholesky::PlaceFronts() {
  const Elimination& e = elimination_;
  const int count = e.num_supernodes();
  fronts_.clear();
  update_at_.assign(count, 0);
  size_t panels = 0, updates = 0;
  int widest = 0;
  lines_size_ = 0;
  for (int s = 0; s < count; ++s) {
    const Front front((e.columns(s) + e.below(s)) * block_, e.columns(s) * block_, block_);
    panels += front.PanelSize();
    widest = std::max(widest, front.k);
    lines_size_ = std::max(lines_size_, static_cast<size_t>(front.EndLine()));
    fronts_.push_back(front);
  }
  // What a task leaves for the top, and the top itself, have places of their own. All else of a task lies in a region
  // that the next task uses again, while it is still in the cache.
  region_size_ = scratch_size_ = 0;
  for (int t = 0; t <= e.num_tasks(); ++t) {
    const bool top = t == e.num_tasks();
    const int begin = e.task_start[t], end = top ? count : e.task_start[t + 1];
    plan_.Clear();
    for (int s = begin; s < end; ++s) {
      const size_t size = fronts_[s].UpdateSize();
      scratch_size_ = std::max(scratch_size_, fronts_[s].ScratchSize());
      if (LeavesTask(s)) {
        update_at_[s] = updates;
        updates += size;
      } else if (size > 0) {
        update_at_[s] = plan_.Take(size);
      }
      for (int c = e.child_start[s]; c < e.child_start[s + 1]; ++c)
        if (e.children[c] >= begin) plan_.Free(update_at_[e.children[c]]);
    }
    if (top) {
      for (int s = begin; s < end; ++s) update_at_[s] += updates;
      updates += plan_.total();
    } else {
      region_size_ = std::max(region_size_, plan_.total());
    }
  }
  panels_.Resize(panels);
  updates_.Resize(updates);
  regions_.Resize(region_size_ * e.num_tasks());
  scratch_.Resize(scratch_size_ * (e.num_tasks() + 1));
  top_nodes_ = num_nodes_ - e.first[e.top()];
  carry_size_ = static_cast<size_t>(RoundUp(top_nodes_ * block_));
  lines_.Resize(lines_size_ * (e.num_tasks() + 1));
  carries_.Resize(carry_size_ * e.num_tasks());
  signs_.resize(std::max(widest, static_cast<int>(signs_.size())));
  replaced_.resize(e.num_tasks());
  permuted_.resize(static_cast<size_t>(num_nodes_) * block_);
  double* panel = panels_.data();
  for (int s = 0; s < count; ++s) {
    Front& front = fronts_[s];
    front.fresh = e.child_start[s] == e.child_start[s + 1];
    front.signs = signs_.data();
    front.scratch = scratch_.data() + scratch_size_ * e.num_tasks();  // of the top; tasks choose their own
    front.update = updates_.data() + update_at_[s];
    front.panel = panel;
    panel += front.PanelSize();
  }
}

int BlockCholesky::SupernodeOf(int a, int b) const {
  return elimination_.supernode_of[std::min(elimination_.position[a], elimination_.position[b])];
}

BlockPlace BlockCholesky::BlockAt(int a, int b) {
  const Elimination& e = elimination_;
  const int pa = e.position[a], pb = e.position[b];
  const int column = std::min(pa, pb), row = std::max(pa, pb);
  const int s = e.supernode_of[column];
  const Front& front = fronts_[s];
  const int line = front.lead + FrontRow(e, s, row) * block_, at_column = (column - e.first[s]) * block_;
  return {front.panel + line + at_column * front.panel_stride, static_cast<int>(front.panel_stride), pb > pa};
}

// Columns of the nodes from .. end-1 of the front: zeroes, then what its children left. A node at a time, so that they are
// still in the nearest cache.
void BlockCholesky::AddChildren(int s, int from, int end) {
  const Elimination& e = elimination_;
  const Front& front = fronts_[s];
  for (int node = from; node < end; ++node) {
    const bool in_panel = node < e.columns(s);
    if (!in_panel && front.fresh) break;  // it has no children
    const ptrdiff_t stride = in_panel ? front.panel_stride : front.update_stride;
    const int column = node * block_ - (in_panel ? 0 : front.k);
    const int line = RoundDown(column + (in_panel ? front.lead : 0));  // from the diagonal on, whole vectors
    double* at = (in_panel ? front.panel : front.update) + static_cast<ptrdiff_t>(column) * stride + line;
    for (int q = 0; q < block_; ++q) std::memset(at + q * stride, 0, sizeof(double) * (stride - line));
    for (int c = e.child_start[s]; c < e.child_start[s + 1]; ++c) {
      const int child = e.children[c];
      const int* to = e.row_in_parent.data() + e.row_start[child];
      const int m = e.below(child);
      const int k = static_cast<int>(std::lower_bound(to, to + m, node) - to);
      if (k < m && to[k] == node) kernels_->extend_add(front, m, to, fronts_[child].update, k, k + 1);
    }
  }
}

int BlockCholesky::FactoriseFront(int s, parallel::PieceRef fill) {
  AddChildren(s, 0, elimination_.columns(s) + elimination_.below(s));
  fill(s);
  return kernels_->factorise(fronts_[s]);
}

// The same by several threads. The lines and columns of a piece do not depend on their number.
int BlockCholesky::FactoriseShared(int s, parallel::PieceRef fill) {
  const Front& front = fronts_[s];
  const int nodes = elimination_.columns(s) + elimination_.below(s);
  const int pieces = 1 + nodes * block_ / kPanelBlock;
  parallel::Fork(pieces, [&](int piece) { AddChildren(s, nodes * piece / pieces, nodes * (piece + 1) / pieces); });
  fill(s);
  int replaced = 0;
  for (int j = 0; j < front.k; j += kPanelBlock) {
    replaced += kernels_->eliminate(front, j);
    ForkLines(front.SolveBegin(j), front.EndLine(), kPanelBlock,
              [&](int from, int to) { kernels_->solve_lines(front, j, from, to); });
    if (j + front.BlockColumns(j) == front.n) break;
    ForkLines(front.UpdateBegin(j), front.EndLine(), kPanelBlock,
              [&](int from, int to) { kernels_->update_lines(front, j, from, to); });
  }
  return replaced;
}

int BlockCholesky::Factorise(std::span<const double> signs, parallel::PieceRef fill) {
  assert(static_cast<int>(signs.size()) == block_);
  const Elimination& e = elimination_;
  for (size_t i = 0; i < signs_.size(); ++i) signs_[i] = signs[i % block_];
  std::atomic<std::uint64_t> taken{0};
  static_assert(kMostTasks <= 64);
  parallel::Fork(e.num_tasks(), [&](int task) {
    const int region = TakeLowest(&taken);
    int replaced = 0;
    for (int s = e.task_start[task]; s < e.task_start[task + 1]; ++s) {
      fronts_[s].scratch = scratch_.data() + scratch_size_ * region;
      if (!LeavesTask(s)) fronts_[s].update = regions_.data() + region_size_ * region + update_at_[s];
      replaced += FactoriseFront(s, fill);
    }
    replaced_[task] = replaced;
    taken.fetch_and(~(std::uint64_t{1} << region));
  });
  int replaced = 0;
  for (int task = 0; task < e.num_tasks(); ++task) replaced += replaced_[task];
  for (int s = e.top(); s < e.num_supernodes(); ++s) {
    const bool shared = FrontTime(e.columns(s), e.below(s)) > kTaskTime;
    replaced += shared ? FactoriseShared(s, fill) : FactoriseFront(s, fill);
  }
  return replaced;
}

// Where the numbers of a node in elimination order are: those of the top in `carry` while a task runs.
inline double* BlockCholesky::RowsAt(int node, double* carry) {
  const int top = num_nodes_ - top_nodes_;
  return carry != nullptr && node >= top ? carry + static_cast<size_t>(node - top) * block_
                                         : permuted_.data() + static_cast<size_t>(node) * block_;
}

void BlockCholesky::Gather(int s, double* lines, double* carry) {
  const Elimination& e = elimination_;
  const Front& front = fronts_[s];
  std::memcpy(lines + front.lead, RowsAt(e.first[s], nullptr), sizeof(double) * front.k);
  double* line = lines + front.lead + front.k;
  for (int r = e.row_start[s]; r < e.row_start[s + 1]; ++r, line += block_)
    CopyBlock(line, RowsAt(e.rows[r], carry), block_);
}

void BlockCholesky::Forward(int begin, int end, double* lines, double* carry) {
  const Elimination& e = elimination_;
  for (int s = begin; s < end; ++s) {
    const Front& front = fronts_[s];
    Gather(s, lines, carry);
    if (carry == nullptr && IsWorthForks(front)) {
      for (int j = 0; j < front.k; j += kPanelBlock) {
        kernels_->forward_block(front, j, lines);
        ForkLines(front.SolveBegin(j), front.EndLine(), kPanelBlock,
                  [&](int from, int to) { kernels_->forward_lines(front, j, from, to, lines); });
      }
    } else {
      kernels_->forward(front, lines);
    }
    // The signs scale x1 after it was used for x2, as L S L^T x = b asks.
    double* own = RowsAt(e.first[s], nullptr);
    const double* line = lines + front.lead;
    for (int i = 0; i < front.k; ++i) own[i] = signs_[i] * line[i];
    line += front.k;
    for (int r = e.row_start[s]; r < e.row_start[s + 1]; ++r, line += block_)
      CopyBlock(RowsAt(e.rows[r], carry), line, block_);
  }
}

void BlockCholesky::Backward(int begin, int end, double* lines, bool shared) {
  const Elimination& e = elimination_;
  for (int s = end - 1; s >= begin; --s) {
    const Front& front = fronts_[s];
    Gather(s, lines, nullptr);
    if (shared && IsWorthForks(front)) {
      for (int j = (front.k - 1) / kPanelBlock * kPanelBlock; j >= 0; j -= kPanelBlock) {
        ForkLines(j, j + front.BlockColumns(j), kPanelBlock / 4,
                  [&](int from, int to) { kernels_->backward_columns(front, j, from, to, lines); });
        kernels_->backward_block(front, j, lines);
      }
    } else {
      kernels_->backward(front, lines);
    }
    std::memcpy(RowsAt(e.first[s], nullptr), lines + front.lead, sizeof(double) * front.k);
  }
}

void BlockCholesky::Solve(double* x) {
  const Elimination& e = elimination_;
  const int tasks = e.num_tasks(), count = e.num_supernodes();
  double* lines = lines_.data() + lines_size_ * tasks;  // of the top
  for (int k = 0; k < num_nodes_; ++k)
    CopyBlock(RowsAt(k, nullptr), x + static_cast<size_t>(e.order[k]) * block_, block_);
  const auto carry_of = [&](int task) { return top_nodes_ > 0 ? carries_.data() + carry_size_ * task : nullptr; };
  parallel::Fork(tasks, [&](int task) {
    double* carry = carry_of(task);
    if (carry != nullptr) std::memset(carry, 0, sizeof(double) * carry_size_);
    Forward(e.task_start[task], e.task_start[task + 1], lines_.data() + lines_size_ * task, carry);
  });
  double* top = RowsAt(num_nodes_ - top_nodes_, nullptr);
  for (int task = 0; top_nodes_ > 0 && task < tasks; ++task) {
    const double* carry = carry_of(task);
    for (int i = 0; i < top_nodes_ * block_; ++i) top[i] += carry[i];
  }
  Forward(e.top(), count, lines, nullptr);
  Backward(e.top(), count, lines, true);
  parallel::Fork(tasks, [&](int task) {
    Backward(e.task_start[task], e.task_start[task + 1], lines_.data() + lines_size_ * task, false);
  });
  for (int k = 0; k < num_nodes_; ++k)
    CopyBlock(x + static_cast<size_t>(e.order[k]) * block_, RowsAt(k, nullptr), block_);
}

}  // namespace islet::qp
