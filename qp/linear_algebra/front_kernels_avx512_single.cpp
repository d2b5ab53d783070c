// Kernels for vectors of 16 floats; see front_kernels_impl.h.
#define ISLET_NUMBER float
#define ISLET_BITS 512
#define ISLET_LANES 16
#define ISLET_TILE 3
#define ISLET_KERNEL_SET kAvx512SingleKernels
#define ISLET_KERNEL_NAME "avx512"
#include "qp/linear_algebra/front_kernels_impl.h"
