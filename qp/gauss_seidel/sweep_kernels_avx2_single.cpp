// Kernels for vectors of 8 floats; see sweep_kernels_impl.h.
#define ISLET_SINGLE
#define ISLET_LANES 8
#define ISLET_KERNEL_SET kAvx2SingleSweepKernels
#define ISLET_KERNEL_NAME "avx2"
#include "qp/gauss_seidel/sweep_kernels_impl.h"
