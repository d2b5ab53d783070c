// How exact an answer is: residuals computed from the problem and the answer alone. Shares no code with the solver that
// is judged, except the definition of the problem. What each number proves: engine/README.md.
//   threads: pure functions
#pragma once

#include "engine/linear_algebra.h"
#include "engine/step_report.h"
#include "qp/problem.h"
#include "qp/settings.h"
#include "qp/solution.h"

namespace islet {

// v_ref: [m/s] max(|g| dt, fastest approach) of the island. The problem is the one whose answer is judged; its targets are
// the bounces, solution.slips the De Saxce terms of the model that was solved.
Certificate Certify(const qp::Problem& problem, const qp::Solution& solution, qp::Model model, qp::Cone cone,
                    double v_ref);

}  // namespace islet
