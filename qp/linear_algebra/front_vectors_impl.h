// Vectors of ISLET_LANES doubles, and tiles of them in registers. Part of front_kernels_impl.h.
#pragma once

#if ISLET_LANES > 2
#include <immintrin.h>
#endif

#include "qp/linear_algebra/front_kernels.h"

namespace islet::qp {
namespace {

constexpr int kLanes = ISLET_LANES;
constexpr int kTile = ISLET_TILE;
constexpr int kColumns = 6;  // of a group: a node's, or half of them
typedef double Vec __attribute__((vector_size(ISLET_LANES * sizeof(double)), may_alias));

// In memory, at any double. Only behind pointers: as the type of a template's argument it would lose its alignment.
typedef double VecAt __attribute__((vector_size(ISLET_LANES * sizeof(double)), aligned(sizeof(double)), may_alias));
typedef double PairAt __attribute__((vector_size(2 * sizeof(double)), aligned(sizeof(double)), may_alias));

#define ISLET_INLINE inline __attribute__((always_inline))

ISLET_INLINE Vec Load(const double* p) { return *reinterpret_cast<const VecAt*>(p); }
ISLET_INLINE void Store(double* p, Vec v) { *reinterpret_cast<VecAt*>(p) = v; }

// a b + c with two roundings: not every machine can do it with one.
ISLET_INLINE Vec MultiplyAdd(Vec a, double b, Vec c) { return a * b + c; }

// C = C + A B for T vectors of rows and N columns: C from `in` to `out`, A column-major, B k x N row by row.
template <int T, int N>
ISLET_INLINE void LoadTile(const double* c, ptrdiff_t stride, Vec (&sum)[T][N]) {
  for (int j = 0; j < N; ++j)
    for (int t = 0; t < T; ++t) sum[t][j] = Load(c + j * stride + t * kLanes);
}
template <int T, int N>
ISLET_INLINE void StoreTile(const Vec (&sum)[T][N], double* c, ptrdiff_t stride) {
  for (int j = 0; j < N; ++j)
    for (int t = 0; t < T; ++t) Store(c + j * stride + t * kLanes, sum[t][j]);
}
template <int T, int N>
ISLET_INLINE void AddMultiple(int k, const double* a, ptrdiff_t lda, const double* b, Vec (&sum)[T][N]) {
  for (int p = 0; p < k; ++p, a += lda, b += N) {
    Vec column[T];
    for (int t = 0; t < T; ++t) column[t] = Load(a + t * kLanes);
    for (int j = 0; j < N; ++j)
      for (int t = 0; t < T; ++t) sum[t][j] = MultiplyAdd(column[t], b[j], sum[t][j]);
  }
}

}  // namespace
}  // namespace islet::qp
