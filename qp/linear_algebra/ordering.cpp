#include "qp/linear_algebra/ordering.h"

#include <amd.h>

#include <algorithm>
#include <numeric>
#include <utility>

#include "qp/build_facts.h"

namespace islet::qp {

std::string AmdVersion() {
  return std::to_string(AMD_MAIN_VERSION) + "." + std::to_string(AMD_SUB_VERSION) + "." +
         std::to_string(AMD_SUBSUB_VERSION);
}

void MinimumDegree::Order(GraphView graph, std::vector<int>* order) {
  const int n = graph.size(), entries = static_cast<int>(graph.adjacency.size());
  order->resize(n);
  std::iota(order->begin(), order->end(), 0);
  if (n < 3) return;
  const int space = entries + entries / 5 + n;
  work_.resize(space + 8 * static_cast<size_t>(n) + 1);
  int* adjacency = work_.data();
  int* rest = adjacency + space;
  std::copy(graph.adjacency.begin(), graph.adjacency.end(), adjacency);
  const auto take = [&](int count) { return std::exchange(rest, rest + count); };
  int *start = take(n), *length = take(n), *weight = take(n), *next = take(n), *head = take(n), *elements = take(n);
  int *degree = take(n), *marks = take(n);
  for (int i = 0; i < n; ++i) {
    start[i] = graph.start[i];
    length[i] = graph.start[i + 1] - graph.start[i];
  }
  double control[AMD_CONTROL], info[AMD_INFO];
  amd_defaults(control);
  amd_2(n, start, adjacency, length, space, entries, weight, next, order->data(), head, elements, degree, marks,
        control, info);
}

}  // namespace islet::qp
