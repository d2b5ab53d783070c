// Kernels for vectors of 4 floats; see sweep_kernels_impl.h.
#define ISLET_SINGLE
#define ISLET_LANES 4
#define ISLET_KERNEL_SET kSse2SingleSweepKernels
#define ISLET_KERNEL_NAME "sse2"
#include "qp/gauss_seidel/sweep_kernels_impl.h"
