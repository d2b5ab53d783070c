// The smallest displacements that undo overlaps: w of least sum m |w|^2 (and turns by their inertia) with gap + J w >= 0 at every contact,
// to first order in w. One frictionless convex problem an island.                                                      [GBF03]
//
//   threads: islands are shared by the pool; the result does not depend on it    allocation: none after warm-up
#pragma once

#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "engine/contact_suite.h"
#include "engine/response/island_problem.h"
#include "islands/partition.h"
#include "parallel/schedule.h"
#include "parallel/worker_pool.h"
#include "qp/cascade/island_solver.h"

namespace islet {

class SuiteProjection {
 public:
  // Returns [m] the deepest overlap that is left to first order.
  double Project(std::span<const Body> bodies, std::span<const Contact> contacts, const Settings& settings,
                 parallel::WorkerPool* pool);
  std::span<const Twist> displacements() const { return displacements_; }

 private:
  struct Worker {
    IslandGatherer gatherer;
    qp::IslandSolver solver;
    qp::Problem problem;
    qp::Solution solution;
    std::vector<int> contacts;
    double left = 0;
  };
  void ProjectIsland(int island, const Settings& settings, Worker* worker);

  std::vector<Body> at_rest_;
  std::vector<Contact> smooth_;  // without friction
  std::vector<Matrix3> frames_;
  std::vector<std::uint8_t> cut_;
  std::vector<std::pair<int, int>> pairs_;
  islands::Partition partition_;
  std::vector<double> costs_;
  parallel::Schedule schedule_;
  std::vector<Worker> workers_;
  std::vector<Twist> displacements_;
};

}  // namespace islet
