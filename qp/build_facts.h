// What the solvers were built with and run on: for reports.
//   threads: pure functions
#pragma once

#include <string>
#include <vector>

namespace islet::qp {

std::string AmdVersion();  // of SuiteSparse's ordering, as "2.4.6"

// The widths of vectors that this machine and this build have kernels for, narrowest first: "sse2", "avx2", "avx512".
std::vector<const char*> RunnableKernels();
const char* ChosenKernels();  // the width that is used

}  // namespace islet::qp
