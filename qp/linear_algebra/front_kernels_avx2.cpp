// Kernels for vectors of 4 doubles; see front_kernels_impl.h.
#define ISLET_LANES 4
#define ISLET_TILE 2
#define ISLET_KERNEL_SET kAvx2Kernels
#include "qp/linear_algebra/front_kernels_impl.h"
