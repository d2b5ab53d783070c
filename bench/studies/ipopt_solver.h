// IPOPT, a general solver for smooth nonlinear programs, on the convex contact problem: what one gets without any code for
// contacts. Unknowns v and j; M v - H j = f as linear equalities, j_n >= 0 and (mu j_n)^2 - |j_t|^2 >= 0 for the cones; exact
// second derivatives, IPOPT's own defaults otherwise, MUMPS as Debian links it. The same units as the reference interior point.
//
//   tolerance   IPOPT's `tol` is 1e-2 tolerance^2, at least 1e-13
//   threads: one caller at a time
//   ISLET_HAVE_IPOPT   defined where it was found
#pragma once

#include <string>

#include "bench/studies/general_problem.h"

namespace islet::studies {

struct IpoptLimits {
  double tolerance = 1e-6;
  double seconds = 10;  // processor time
  int iterations = 1000;
};

bool IpoptAvailable();
std::string IpoptVersion();
GeneralAnswer SolveByIpopt(const GeneralProblem& problem, const IpoptLimits& limits);

}  // namespace islet::studies
