#include "qp/build_facts.h"

#include "qp/gauss_seidel/sweep_kernels.h"
#include "qp/interior_point/row_kernels.h"
#include "qp/linear_algebra/front_kernels.h"

namespace islet::qp {

std::vector<const char*> RunnableKernels() {
  std::vector<const char*> names;
  for (const char* const name : {"sse2", "avx2", "avx512"})
    if (FindFrontKernels(name) && FindSweepKernels(name).plain && FindRowKernels(name)) names.push_back(name);
  return names;
}

const char* ChosenKernels() { return BestFrontKernels().name; }

}  // namespace islet::qp
