// Kernels for vectors of 8 doubles; see front_kernels_impl.h.
#define ISLET_LANES 8
#define ISLET_TILE 3
#define ISLET_KERNEL_SET kAvx512Kernels
#include "qp/linear_algebra/front_kernels_impl.h"
