// Kernels for vectors of 4 doubles; see row_kernels_impl.h.
#define ISLET_LANES 4
#define ISLET_KERNEL_SET kAvx2RowKernels
#include "qp/interior_point/row_kernels_impl.h"
