// How exact an answer to a problem from outside is: residuals computed from the file's matrices and the answer alone. Shares
// no code with the solvers. All relative: velocities to v_ref, the fastest approach before the impulses.
//   threads: pure functions
#pragma once

#include "qp/settings.h"
#include "scenes/solve_problem.h"

namespace islet {

struct SolveVerdict {
  // |j - P_K(j - rho u_hat)| / rho of a contact, rho = 3 / tr W_cc, over v_ref; zero where the law holds. natural_map is that of
  // the model and cone asked for, coulomb_map that of exact Coulomb friction: circular cone, u_hat = u + mu |u_t| n.
  double natural_map_max = 0, natural_map_rms = 0;
  double coulomb_map_max = 0, coulomb_map_rms = 0;
  // As Siconos measures a local problem (fc3d_compute_error): the Euclidean norm over all contacts of r - P_K(r - u_hat), with
  // no rho, divided by that of q (if q is not zero), where u = W r + q. The numbers therefore depend on the units of the file.
  // W is the file's own, symmetric or not. A global problem is measured as the local one that it amounts to.
  double siconos_error = 0;
  double gap = 0;  // sum of |r . u_hat| over sum of 1/2 rho v_ref^2, u_hat of the model asked for
  double momentum =
      0;  // global: |M v - H r - f| in the metric of diag M, over v_ref sqrt(tr M); local: max |u - W r - q| / v_ref
  bool finite = true;  // no number of the answer is NaN or infinite; if not, all of the above are 0
};

// original: as it was read, before any matrix was made symmetric.
SolveVerdict Judge(const FclibProblem& original, const SolveProblem& problem, const SolveAnswer& answer,
                   qp::Model model, qp::Cone cone);

}  // namespace islet
