// One problem, one solver: what tests of the island solver and of its rungs begin with.
#pragma once

#include "qp/cascade/island_solver.h"
#include "tests/support/random_problems.h"

namespace islet::testing {

// Tolerances relative to the problem's own velocities.
inline qp::Settings MakeSettings(const Problem& problem, qp::Model model, qp::Cone cone = qp::Cone::kCircular) {
  qp::Settings settings;
  settings.model = model;
  settings.cone = cone;
  settings.velocity_scale = VelocityScale(problem);
  return settings;
}

// By a solver that has seen nothing before.
inline qp::Solution Solve(const Problem& problem, const qp::Settings& settings) {
  qp::IslandSolver solver;
  qp::Solution solution;
  solver.Solve(problem, settings, &solution);
  return solution;
}

}  // namespace islet::testing
