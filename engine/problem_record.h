// One problem that a step solved, with its answer: for whoever wants to look at what the solver is given.
//
//   threads: an observer is called by the thread that steps the world, after the islands are done, in an order that does not
//            depend on the number of threads; the record is valid during the call
#pragma once

#include <functional>

#include "engine/step_report.h"
#include "qp/problem.h"
#include "qp/solution.h"

namespace islet {

// Which problem of a step.
enum class Stage {
  kCollision,  // step 2: what comes of blows
  kStatic      // step 3: what carries weight
};

struct ProblemRecord {
  // Of a small group: which of its problems in this step. Of a crowd: 0.
  int round = 0;
  int island =
      0;  // of a small group: its smallest body; of a crowd: in the partition of this step, numbered by smallest body
  Stage stage = Stage::kCollision;    // which of its two problems
  QpStatus status = QpStatus::kNone;  // how it ended
  qp::Problem problem;                // with the bounces that were asked for in the end
  qp::Solution solution;              // the answer, where the status tells of one
};

// Whom World and ContactSuite show their problems to.
using ProblemObserver = std::function<void(const ProblemRecord& record)>;

}  // namespace islet
