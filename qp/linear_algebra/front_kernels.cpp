#include "qp/linear_algebra/front_kernels.h"

#include <cstdlib>
#include <cstring>
#include <initializer_list>

namespace islet::qp {

extern const FrontKernels kSse2Kernels;
#ifdef ISLET_WIDE_KERNELS
extern const FrontKernels kAvx2Kernels;
extern const FrontKernels kAvx512Kernels;
#endif

const FrontKernels* FindFrontKernels(const char* name) {
#ifdef ISLET_WIDE_KERNELS
  const bool avx2 = __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma");
  if (std::strcmp(name, "avx2") == 0) return avx2 ? &kAvx2Kernels : nullptr;
  if (std::strcmp(name, "avx512") == 0) {
    return avx2 && __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512vl") ? &kAvx512Kernels : nullptr;
  }
#endif
  return std::strcmp(name, "sse2") == 0 ? &kSse2Kernels : nullptr;
}

const FrontKernels& BestFrontKernels() {
  static const FrontKernels& best = []() -> const FrontKernels& {
    if (const char* wanted = std::getenv("ISLET_KERNELS")) {
      if (const FrontKernels* set = FindFrontKernels(wanted)) return *set;
    }
    for (const char* name : {"avx512", "avx2"}) {
      if (const FrontKernels* set = FindFrontKernels(name)) return *set;
    }
    return kSse2Kernels;
  }();
  return best;
}

}  // namespace islet::qp
