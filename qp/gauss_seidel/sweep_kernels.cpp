#include "qp/gauss_seidel/sweep_kernels.h"

#include "qp/build_facts.h"

namespace islet::qp {

extern const SweepKernels<double> kSse2SweepKernels, kAvx2SweepKernels, kAvx512SweepKernels;
extern const SweepKernels<float> kSse2SingleSweepKernels, kAvx2SingleSweepKernels, kAvx512SingleSweepKernels;

namespace {

constexpr SweepKernelSet kSweepKernels[] = {
    {&kSse2SweepKernels, &kSse2SingleSweepKernels},
#ifdef ISLET_WIDE_KERNELS
    {&kAvx2SweepKernels, &kAvx2SingleSweepKernels},
    {&kAvx512SweepKernels, &kAvx512SingleSweepKernels},
#endif
};

}  // namespace

SweepKernelSet BestSweepKernels() { return kSweepKernels[ChosenKernelWidth()]; }

SweepKernelSet FindSweepKernels(const char* name) {
  const int width = KernelWidth(name);
  return width < 0 ? SweepKernelSet{nullptr, nullptr} : kSweepKernels[width];
}

}  // namespace islet::qp
