#include "qp/sweep_kernels.h"

#include <cstring>

#include "qp/front_kernels.h"

namespace islet::qp {

extern const SweepKernels kSse2SweepKernels;
#ifdef ISLET_WIDE_KERNELS
extern const SweepKernels kAvx2SweepKernels;
extern const SweepKernels kAvx512SweepKernels;
#endif

const SweepKernels* FindSweepKernels(const char* name) {
  if (!FindFrontKernels(name)) return nullptr;  // the machine cannot run them
#ifdef ISLET_WIDE_KERNELS
  if (std::strcmp(name, "avx2") == 0) return &kAvx2SweepKernels;
  if (std::strcmp(name, "avx512") == 0) return __builtin_cpu_supports("avx512dq") ? &kAvx512SweepKernels : nullptr;
#endif
  return &kSse2SweepKernels;
}

const SweepKernels& BestSweepKernels() {
  const SweepKernels* set = FindSweepKernels(BestFrontKernels().name);
  return set ? *set : kSse2SweepKernels;
}

}  // namespace islet::qp
