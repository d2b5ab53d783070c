// Kernels for vectors of 2 doubles; see row_kernels_impl.h.
#define ISLET_LANES 2
#define ISLET_KERNEL_SET kSse2RowKernels
#include "qp/interior_point/row_kernels_impl.h"
