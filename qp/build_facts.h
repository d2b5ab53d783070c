// What the solvers were built with and run on: for reports, and for who chooses kernels.
//   threads: pure functions
#pragma once

#include <string>
#include <vector>

namespace islet::qp {

std::string AmdVersion();  // of SuiteSparse's ordering, as "2.4.6"

// The widths of vectors that this machine and this build have kernels for, narrowest first: "sse2", "avx2", "avx512".
std::vector<const char*> RunnableKernels();
// The place of that width in this list, and in the lists of kernels; -1: this machine or build has none.
int KernelWidth(const char* name);
// The widest. ISLET_KERNELS=sse2|avx2|avx512 in the environment chooses a narrower one.
int ChosenKernelWidth();
const char* ChosenKernels();  // its name

}  // namespace islet::qp
