#include "qp/linear_algebra/front_kernels.h"

#include "qp/build_facts.h"

namespace islet::qp {

extern const FrontKernels kSse2Kernels, kAvx2Kernels, kAvx512Kernels;

namespace {

constexpr const FrontKernels* kFrontKernels[] = {
    &kSse2Kernels,
#ifdef ISLET_WIDE_KERNELS
    &kAvx2Kernels,
    &kAvx512Kernels,
#endif
};

}  // namespace

const FrontKernels& BestFrontKernels() { return *kFrontKernels[ChosenKernelWidth()]; }

const FrontKernels* FindFrontKernels(const char* name) {
  const int width = KernelWidth(name);
  return width < 0 ? nullptr : kFrontKernels[width];
}

}  // namespace islet::qp
