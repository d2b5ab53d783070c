// A textbook interior point for the convex contact problem, on CHOLMOD: what one gets by putting known parts together.
// Mehrotra's predictor and corrector, Nesterov-Todd scaling, one condensed matrix M + G^T W^-2 G on the velocities, supernodal
// factorisation with OpenBLAS, analysed once a problem. Shares no code with islet's.
//
//   tolerance   complementarity s^T z per contact below 1e-2 tolerance^2, residuals below tolerance / 10, in units in which
//               every contact has tr W_cc = 3 and the fastest contact the speed 1
//   threads: one; sets the number of threads of OpenBLAS and of OpenMP for the whole program
//   ISLET_HAVE_CHOLMOD   defined where both libraries were found; without them there is none
#pragma once

#include <string>

#include "bench/studies/general_problem.h"

namespace islet::studies {

struct ReferenceLimits {
  double tolerance = 1e-6;
  double seconds = 10;  // wall time, checked once an iteration
  int iterations = 200;
};

bool ReferenceAvailable();
std::string ReferenceVersion();

// False if the problem's matrix is too full for this solver.
bool FitsReference(const GeneralProblem& problem);

GeneralAnswer SolveByReference(const GeneralProblem& problem, const ReferenceLimits& limits);

}  // namespace islet::studies
