// Kernels for vectors of 2 doubles; see front_kernels_impl.h.
#define ISLET_LANES 2
#define ISLET_TILE 2
#define ISLET_KERNEL_SET kSse2Kernels
#include "qp/linear_algebra/front_kernels_impl.h"
