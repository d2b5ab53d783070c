// Kernels for vectors of 8 doubles; see row_kernels_impl.h.
#define ISLET_LANES 8
#define ISLET_KERNEL_SET kAvx512RowKernels
#include "qp/interior_point/row_kernels_impl.h"
