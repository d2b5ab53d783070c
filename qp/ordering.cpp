#include "qp/ordering.h"

#include <amd.h>

#include <numeric>

namespace islet::qp {

std::vector<int> MinimumDegreeOrder(std::span<const int> start, std::span<const int> adjacency) {
  const int n = static_cast<int>(start.size()) - 1;
  std::vector<int> order(n);
  std::iota(order.begin(), order.end(), 0);
  if (n < 3) return order;
  double control[AMD_CONTROL];
  amd_defaults(control);
  const int status = amd_order(n, start.data(), adjacency.data(), order.data(), control, nullptr);
  if (status != AMD_OK && status != AMD_OK_BUT_JUMBLED) std::iota(order.begin(), order.end(), 0);
  return order;
}

}  // namespace islet::qp
