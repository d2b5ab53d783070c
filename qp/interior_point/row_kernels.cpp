#include "qp/interior_point/row_kernels.h"

#include <cstring>

#include "qp/linear_algebra/front_kernels.h"

namespace islet::qp {

extern const RowKernels kSse2RowKernels;
#ifdef ISLET_WIDE_KERNELS
extern const RowKernels kAvx2RowKernels;
extern const RowKernels kAvx512RowKernels;
#endif

const RowKernels* FindRowKernels(const char* name) {
  if (!FindFrontKernels(name)) return nullptr;  // the machine cannot run them
#ifdef ISLET_WIDE_KERNELS
  if (std::strcmp(name, "avx2") == 0) return &kAvx2RowKernels;
  if (std::strcmp(name, "avx512") == 0) return __builtin_cpu_supports("avx512dq") ? &kAvx512RowKernels : nullptr;
#endif
  return &kSse2RowKernels;
}

const RowKernels& BestRowKernels() {
  const RowKernels* set = FindRowKernels(BestFrontKernels().name);
  return set ? *set : kSse2RowKernels;
}

}  // namespace islet::qp
