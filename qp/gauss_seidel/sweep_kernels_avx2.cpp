// Kernels for vectors of 4 doubles; see sweep_kernels_impl.h.
#define ISLET_LANES 4
#define ISLET_KERNEL_SET kAvx2SweepKernels
#define ISLET_KERNEL_NAME "avx2"
#include "qp/gauss_seidel/sweep_kernels_impl.h"
