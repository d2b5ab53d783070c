// How good an answer is, from nothing but the problem and the answer: none of the solver's own judgement.
//
//   natural map  |j - P_K(j - rho u_hat)| / rho over v_ref, rho = 3 / tr W_cc, u_hat = u - target n + mu |u_t| n: of exact
//                Coulomb friction on the circular cone, whatever was solved
//   gap          sum of |j . (u - target n + s n)|, s the slip that the solver says it used, over
//                1/2 m v_ref^2 + 1/2 v0^T M v0
#pragma once

#include "bench/problem_files.h"
#include "qp/solution.h"

namespace islet::qp {

struct Quality {
  double rms = 0, max = 0;  // natural map, over the contacts
  double gap = 0;
};
Quality Judge(const Island& island, const Solution& solution);

}  // namespace islet::qp
