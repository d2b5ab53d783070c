// Kernels for vectors of 8 floats; see front_kernels_impl.h.
#define ISLET_NUMBER float
#define ISLET_BITS 256
#define ISLET_LANES 8
#define ISLET_TILE 2
#define ISLET_KERNEL_SET kAvx2SingleKernels
#define ISLET_KERNEL_NAME "avx2"
#include "qp/linear_algebra/front_kernels_impl.h"
