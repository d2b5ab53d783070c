// Kernels for vectors of 2 doubles; see sweep_kernels_impl.h.
#define ISLET_LANES 2
#define ISLET_KERNEL_SET kSse2SweepKernels
#define ISLET_KERNEL_NAME "sse2"
#include "qp/gauss_seidel/sweep_kernels_impl.h"
