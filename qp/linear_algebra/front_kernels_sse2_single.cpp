// Kernels for vectors of 4 floats; see front_kernels_impl.h.
#define ISLET_NUMBER float
#define ISLET_BITS 128
#define ISLET_LANES 4
#define ISLET_TILE 2
#define ISLET_KERNEL_SET kSse2SingleKernels
#define ISLET_KERNEL_NAME "sse2"
#include "qp/linear_algebra/front_kernels_impl.h"
