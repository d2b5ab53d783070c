#include "qp/block_cholesky.h"

#include <algorithm>
#include <cassert>
#include <cstring>

namespace islet::qp {
namespace {

// Address space for the update matrices: a front's own is needed while its children's are still read, and each is free
// after its parent has been factorised. First fit, decided once.
class SpacePlan {
 public:
  size_t Take(size_t size) {
    size_t at = 0;
    auto place = taken_.begin();
    for (; place != taken_.end() && place->at < at + size; ++place) at = place->at + place->size;
    taken_.insert(place, {at, size});
    total_ = std::max(total_, at + size);
    return at;
  }
  void Free(size_t at) {
    taken_.erase(std::find_if(taken_.begin(), taken_.end(), [at](const Interval& i) { return i.at == at; }));
  }
  size_t total() const { return total_; }

 private:
  struct Interval {
    size_t at, size;
  };
  std::vector<Interval> taken_;  // ascending
  size_t total_ = 0;
};

}  // namespace

void BlockCholesky::Analyse(int num_nodes, int block, std::span<const std::array<int, 2>> pairs) {
  if (num_nodes == num_nodes_ && block == block_ &&
      std::equal(pairs.begin(), pairs.end(), pairs_.begin(), pairs_.end()))
    return;
  num_nodes_ = num_nodes;
  block_ = block;
  pairs_.assign(pairs.begin(), pairs.end());
  elimination_ = AnalyseElimination(num_nodes, pairs);
  PlaceFronts();
}

void BlockCholesky::PlaceFronts() {
  const Elimination& e = elimination_;
  const int count = e.num_supernodes();
  panel_at_.assign(count, 0);
  update_at_.assign(count, 0);
  SpacePlan plan;
  size_t panels = 0;
  int widest = 0, longest = 0;
  for (int s = 0; s < count; ++s) {
    const int n = FrontSize(s), k = e.columns(s) * block_, m = e.below(s) * block_;
    panel_at_[s] = panels;
    panels += static_cast<size_t>(PaddedRows(n)) * k + kRowPadding;
    widest = std::max(widest, k);
    longest = std::max(longest, n);
    if (m > 0) update_at_[s] = plan.Take(static_cast<size_t>(PaddedRows(m)) * m + kRowPadding);
    for (int c = e.child_start[s]; c < e.child_start[s + 1]; ++c) plan.Free(update_at_[e.children[c]]);
  }
  panels_.assign(panels, 0.0);
  updates_.assign(plan.total(), 0.0);
  signs_.assign(widest, 1.0);
  permuted_.assign(static_cast<size_t>(num_nodes_) * block_, 0.0);
  local_.assign(longest + kRowPadding, 0.0);
}

void BlockCholesky::SetZero() { std::fill(panels_.begin(), panels_.end(), 0.0); }

BlockPlace BlockCholesky::BlockAt(int a, int b) {
  const Elimination& e = elimination_;
  const int pa = e.position[a], pb = e.position[b];
  const int column = std::min(pa, pb), row = std::max(pa, pb);
  const int s = e.supernode_of[column];
  const int stride = PaddedRows(FrontSize(s));
  const int at_row = FrontRow(e, s, row) * block_, at_column = (column - e.first[s]) * block_;
  return {panels_.data() + panel_at_[s] + at_row + static_cast<size_t>(at_column) * stride, stride, pb > pa};
}

void BlockCholesky::AddChildren(int s) {
  const Elimination& e = elimination_;
  const int columns = e.columns(s);
  const int panel_stride = PaddedRows(FrontSize(s)), update_stride = PaddedRows(e.below(s) * block_);
  double* panel = panels_.data() + panel_at_[s];
  double* update = updates_.data() + update_at_[s];
  for (int c = e.child_start[s]; c < e.child_start[s + 1]; ++c) {
    const int child = e.children[c];
    const int m = e.below(child), child_stride = PaddedRows(m * block_);
    const int* to = e.row_in_parent.data() + e.row_start[child];
    const double* from = updates_.data() + update_at_[child];
    for (int j = 0; j < m; ++j) {
      const bool in_panel = to[j] < columns;
      const int stride = in_panel ? panel_stride : update_stride;
      const int shift = in_panel ? 0 : columns;
      double* target = (in_panel ? panel : update) + static_cast<size_t>(to[j] - shift) * block_ * stride;
      for (int q = 0; q < block_; ++q, target += stride, from += child_stride) {
        for (int i = j; i < m; ++i) {
          double* out = target + (to[i] - shift) * block_;
          const double* in = from + i * block_;
          for (int r = 0; r < block_; ++r) out[r] += in[r];
        }
      }
    }
  }
}

int BlockCholesky::Factorise(std::span<const double> signs) {
  assert(static_cast<int>(signs.size()) == block_);
  const Elimination& e = elimination_;
  for (size_t i = 0; i < signs_.size(); ++i) signs_[i] = signs[i % block_];
  int replaced = 0;
  for (int s = 0; s < e.num_supernodes(); ++s) {
    const int m = e.below(s) * block_;
    double* update = updates_.data() + update_at_[s];
    if (m > 0) std::memset(update, 0, sizeof(double) * (static_cast<size_t>(PaddedRows(m)) * m));
    AddChildren(s);
    replaced += kernels_->factorise(FrontSize(s), e.columns(s) * block_, block_, 0.0, signs_.data(),
                                    panels_.data() + panel_at_[s], update);
  }
  return replaced;
}

void BlockCholesky::Solve(double* x) {
  const Elimination& e = elimination_;
  const size_t bytes = sizeof(double) * block_;
  for (int k = 0; k < e.num_nodes; ++k)
    std::memcpy(&permuted_[static_cast<size_t>(k) * block_], x + static_cast<size_t>(e.order[k]) * block_, bytes);
  const auto move_rows = [&](int s, bool gather) {
    const int k = e.columns(s) * block_;
    double* own = &permuted_[static_cast<size_t>(e.first[s]) * block_];
    std::memcpy(gather ? local_.data() : own, gather ? own : local_.data(), sizeof(double) * k);
    double* local = local_.data() + k;
    for (int r = e.row_start[s]; r < e.row_start[s + 1]; ++r, local += block_) {
      double* global = &permuted_[static_cast<size_t>(e.rows[r]) * block_];
      std::memcpy(gather ? local : global, gather ? global : local, bytes);
    }
  };
  const int count = e.num_supernodes();
  for (int s = 0; s < count; ++s) {
    move_rows(s, true);
    kernels_->forward(FrontSize(s), e.columns(s) * block_, panels_.data() + panel_at_[s], local_.data());
    for (int i = 0; i < e.columns(s) * block_; ++i) local_[i] *= signs_[i];
    move_rows(s, false);
  }
  // The signs have scaled x1 after it was used for x2, as L S L^T x = b asks.
  for (int s = count - 1; s >= 0; --s) {
    move_rows(s, true);
    kernels_->backward(FrontSize(s), e.columns(s) * block_, panels_.data() + panel_at_[s], local_.data());
    move_rows(s, false);
  }
  for (int k = 0; k < e.num_nodes; ++k)
    std::memcpy(x + static_cast<size_t>(e.order[k]) * block_, &permuted_[static_cast<size_t>(k) * block_], bytes);
}

}  // namespace islet::qp
