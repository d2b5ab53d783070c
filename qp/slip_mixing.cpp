#include "qp/slip_mixing.h"

#include <algorithm>

namespace islet::qp {
namespace {

constexpr double kDependent = 1e-12;  // of a change's squared size, left of it beside the others: it says nothing new

double Dot(const std::vector<double>& a, const std::vector<double>& b) {
  double sum = 0;
  for (size_t i = 0; i < a.size(); ++i) sum += a[i] * b[i];
  return sum;
}

// y -= share x.
void Subtract(double share, const std::vector<double>& x, std::vector<double>* y) {
  for (size_t i = 0; i < x.size(); ++i) (*y)[i] -= share * x[i];
}

}  // namespace

void SlipMixing::Begin(std::size_t size) {
  pairs_ = 0;
  for (auto* v : {&found_, &miss_, &left_}) v->resize(size);
  for (auto* changes : {&changes_, &mixed_}) {
    for (Change& change : *changes) change.found.resize(size), change.miss.resize(size);
  }
}

void SlipMixing::Add(const std::vector<double>& given, const std::vector<double>& found) {
  left_ = found;
  Subtract(1, given, &left_);
  if (pairs_ > 0) {
    Change& change = changes_[(pairs_ - 1) % kDepth];
    change.found = found, change.miss = left_;
    Subtract(1, found_, &change.found);
    Subtract(1, miss_, &change.miss);
  }
  found_ = found;
  miss_.swap(left_);
  ++pairs_;
}

// The changes of the misses are made orthogonal, latest first; whatever is done to them is done to what was found, so that
// taking a share of one off the miss takes the same share off the slips.
void SlipMixing::Next(std::vector<double>* slips) {
  const int count = std::min(pairs_ - 1, kDepth);
  std::array<Change*, kDepth> order;
  for (int i = 0; i < count; ++i) order[i] = &changes_[(pairs_ - 2 - i) % kDepth];
  *slips = found_;
  left_ = miss_;
  std::array<double, kDepth> sizes;
  for (int i = 0; i < count; ++i) {
    mixed_[i].found = order[i]->found, mixed_[i].miss = order[i]->miss;
    const double whole = Dot(mixed_[i].miss, mixed_[i].miss);
    for (int k = 0; k < i; ++k) {
      if (sizes[k] == 0) continue;
      const double share = Dot(mixed_[k].miss, mixed_[i].miss) / sizes[k];
      Subtract(share, mixed_[k].miss, &mixed_[i].miss);
      Subtract(share, mixed_[k].found, &mixed_[i].found);
    }
    sizes[i] = Dot(mixed_[i].miss, mixed_[i].miss);
    if (!(sizes[i] > kDependent * whole)) {
      sizes[i] = 0;
      continue;
    }
    const double share = Dot(mixed_[i].miss, left_) / sizes[i];
    Subtract(share, mixed_[i].miss, &left_);
    Subtract(share, mixed_[i].found, slips);
  }
  for (double& slip : *slips) slip = std::max(0.0, slip);
}

}  // namespace islet::qp
