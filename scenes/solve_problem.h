// A problem of others made ready, solved and put back into the file's own unknowns.
//
//   rigid bodies   M of 6 x 6 blocks (mass, inertia) and at most two bodies a contact: qp::Problem, sparse   our exports
//   anything else  W = H^T M^-1 H, or W as given: qp::DenseProblem, dense
//
// A matrix that is not symmetric is replaced by its symmetric part; how far off it was is kept.
//   errors: FclibError for a problem that cannot be solved by either way
//   threads: one caller at a time
#pragma once

#include <Eigen/SparseCholesky>
#include <optional>
#include <string>
#include <vector>

#include "qp/dense/dense_solver.h"
#include "qp/problem.h"
#include "qp/settings.h"
#include "scenes/fclib_file.h"

namespace islet {

struct SolveProblem {
  std::string name;               // of the file, for messages
  FclibProblem file;              // with symmetric M or W
  double asymmetry = 0;           // max |W - W^T| / max |W|, or of M
  double v_ref = 1;               // fastest approach before the impulses; the unit of all tolerances
  Eigen::VectorXd free_velocity;  // of the contacts without impulses: q, or H^T M^-1 f + w
  std::optional<qp::Problem> rigid;
  std::vector<int> touched;  // bodies of `rigid`, by their place in M; empty if there are no bodies to speak of
};

SolveProblem PrepareProblem(const std::string& name, FclibProblem file);

struct SolveAnswer {
  qp::Status status = qp::Status::kFailed;  // as the solver sees it
  Eigen::VectorXd v;                        // global only: of all bodies
  Eigen::VectorXd u, r;                     // of the contacts
  int iterations = 0;                       // factorisations
};

struct SolveLaw {
  qp::Model model = qp::Model::kCoulomb;  // or kConvex
  qp::Cone cone = qp::Cone::kCircular;
  double tolerance =
      1e-6;  // of the natural map, rms over the contacts, over v_ref; a tenth of that of the worst contact
};

// sparse needs problem.rigid.
SolveAnswer SolveBy(bool sparse, const SolveProblem& problem, const SolveLaw& law);

// Whether the dense way is open: W fits into memory.
bool FitsDense(const SolveProblem& problem);

}  // namespace islet
