// Fill-reducing elimination order of a graph. The only room that sees SuiteSparse (its AMD, BSD licence).
#pragma once

#include <span>
#include <vector>

namespace islet::qp {

// Symmetric graph in compressed form without self-loops: neighbours of i are adjacency[start[i] .. start[i+1]).
// Returns order[k] = node eliminated k-th.
std::vector<int> MinimumDegreeOrder(std::span<const int> start, std::span<const int> adjacency);

}  // namespace islet::qp
