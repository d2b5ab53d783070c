// A slow, dense, independent solver of the convex contact problems, to check the fast ones against: nothing but
// qp/problem.h and qp/settings.h is shared with the library.
//
// On the impulses, in long double:  minimise 1/2 j^T W j + q^T j,  j in K,  and for the kinetic model  A j + c >= 0
// with W = J M^-1 J^T + R, q = J v0 + drift (- target n if convex), A the normal rows of J M^-1 J^T, c what u_n lacks.
// Proximal method of multipliers; every inner problem is unconstrained and once differentiable, solved by a semismooth
// Newton method with line search. The octagon is taken from its facets [SM04 Eq. 8], not from its edges.
//   threads: pure function
#pragma once

#include <vector>

#include "qp/problem.h"
#include "qp/settings.h"

namespace islet::testing {

struct ReferenceSolution {
  std::vector<double> velocities;     // 6 per body
  std::vector<qp::Vector3> impulses;  // per contact
  double residual = 0;                // largest violation of the optimality conditions, in the solver's scaled units
  int newton_steps = 0;
};

// model: kConvex or kKinetic. At the bounded number of steps the residual tells how good the answer is.
ReferenceSolution SolveReference(const qp::Problem& problem, qp::Model model, qp::Cone cone);

using LongVector3 = Eigen::Matrix<long double, 3, 1>;
using LongMatrix3 = Eigen::Matrix<long double, 3, 3>;
// Nearest point of the friction cone; derivative (may be null): an element of the generalised Jacobian.
LongVector3 ProjectOnCone(const LongVector3& x, double friction, qp::Cone cone, LongMatrix3* derivative = nullptr);

}  // namespace islet::testing
