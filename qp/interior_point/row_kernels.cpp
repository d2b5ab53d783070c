#include "qp/interior_point/row_kernels.h"

#include "qp/build_facts.h"

namespace islet::qp {

extern const RowKernels kSse2RowKernels, kAvx2RowKernels, kAvx512RowKernels;

namespace {

constexpr const RowKernels* kRowKernels[] = {
    &kSse2RowKernels,
#ifdef ISLET_WIDE_KERNELS
    &kAvx2RowKernels,
    &kAvx512RowKernels,
#endif
};

}  // namespace

const RowKernels& BestRowKernels() { return *kRowKernels[ChosenKernelWidth()]; }

const RowKernels* FindRowKernels(const char* name) {
  const int width = KernelWidth(name);
  return width < 0 ? nullptr : kRowKernels[width];
}

}  // namespace islet::qp
