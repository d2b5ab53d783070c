#include "qp/gauss_seidel/sweep_kernels.h"

#include <cstring>

#include "qp/linear_algebra/front_kernels.h"

namespace islet::qp {

extern const SweepKernels<double> kSse2SweepKernels;
extern const SweepKernels<float> kSse2SingleSweepKernels;
#ifdef ISLET_WIDE_KERNELS
extern const SweepKernels<double> kAvx2SweepKernels, kAvx512SweepKernels;
extern const SweepKernels<float> kAvx2SingleSweepKernels, kAvx512SingleSweepKernels;
#endif

SweepKernelSet FindSweepKernels(const char* name) {
  if (!FindFrontKernels(name)) return {nullptr, nullptr};  // the machine cannot run them
#ifdef ISLET_WIDE_KERNELS
  if (std::strcmp(name, "avx2") == 0) return {&kAvx2SweepKernels, &kAvx2SingleSweepKernels};
  if (std::strcmp(name, "avx512") == 0) {
    if (!__builtin_cpu_supports("avx512dq")) return {nullptr, nullptr};
    return {&kAvx512SweepKernels, &kAvx512SingleSweepKernels};
  }
#endif
  return {&kSse2SweepKernels, &kSse2SingleSweepKernels};
}

SweepKernelSet BestSweepKernels() {
  const SweepKernelSet set = FindSweepKernels(BestFrontKernels().name);
  return set.plain ? set : SweepKernelSet{&kSse2SweepKernels, &kSse2SingleSweepKernels};
}

}  // namespace islet::qp
