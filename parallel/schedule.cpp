#include "parallel/schedule.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <sstream>
#include <stdexcept>

namespace islet::parallel {
namespace {

void CheckCost(const char* name, double cost) {
  if (!(std::isfinite(cost) && cost >= 0)) {
    std::ostringstream text;
    text << "Schedule: " << name << " = " << cost << " must be finite and >= 0";
    throw std::invalid_argument(text.str());
  }
}

// The index as second key makes std::sort stable; std::stable_sort would allocate.
void SortLargestFirst(std::span<const double> costs, std::vector<int>* order) {
  for (const double cost : costs) CheckCost("cost", cost);
  order->resize(costs.size());
  std::iota(order->begin(), order->end(), 0);
  std::sort(order->begin(), order->end(), [costs](int a, int b) {
    const double cost_a = costs[static_cast<std::size_t>(a)];
    const double cost_b = costs[static_cast<std::size_t>(b)];
    return cost_a != cost_b ? cost_a > cost_b : a < b;
  });
}

}  // namespace

void MakeSchedule(std::span<const double> costs, double batch_cost, Schedule* schedule) {
  CheckCost("batch_cost", batch_cost);
  SortLargestFirst(costs, &schedule->order);
  std::vector<int>& batch_start = schedule->batch_start;
  batch_start.clear();
  batch_start.reserve(costs.size() + 1);
  batch_start.push_back(0);
  double open_cost = 0;  // of the batch being filled
  int end = 0;
  for (const int task : schedule->order) {
    open_cost += costs[static_cast<std::size_t>(task)];
    ++end;
    if (open_cost < batch_cost) continue;
    batch_start.push_back(end);
    open_cost = 0;
  }
  if (batch_start.back() != end) batch_start.push_back(end);
}

}  // namespace islet::parallel
