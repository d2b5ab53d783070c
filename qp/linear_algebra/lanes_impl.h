// Vectors of ISLET_LANES numbers with one contact in each lane, for the kernels that go through contacts in batches of eight.
// Part of sweep_kernels_impl.h and row_kernels_impl.h, whose users define ISLET_LANES, and ISLET_SINGLE if the numbers are floats;
// nothing but builtins and intrinsics is used.
#pragma once

#if defined(__SSE2__)
#include <immintrin.h>
#endif

namespace islet::qp {
namespace {

#ifdef ISLET_SINGLE
using Number = float;
#else
using Number = double;
#endif
constexpr int kLanes = ISLET_LANES;
typedef Number Vec __attribute__((vector_size(kLanes * sizeof(Number))));
// The same in memory that is aligned for single numbers alone.
typedef Number VecAt __attribute__((vector_size(kLanes * sizeof(Number)), aligned(sizeof(Number)), may_alias));
typedef decltype(Vec{} < Vec{}) Mask;

inline Vec Load(const Number* p) { return *reinterpret_cast<const VecAt*>(p); }
inline void Store(Number* p, Vec v) { *reinterpret_cast<VecAt*>(p) = v; }
inline Vec Max(Vec a, Vec b) { return a > b ? a : b; }
inline Vec Abs(Vec a) { return a < 0 ? -a : a; }

// Whether any lane is true; square roots. Both are exact, so the bits are those of any other width.
#if defined(ISLET_SINGLE) && ISLET_LANES == 8
inline bool Any(Mask m) { return _mm256_movemask_ps((__m256)m) != 0; }
inline Vec Root(Vec a) { return (Vec)_mm256_sqrt_ps((__m256)a); }
#elif defined(ISLET_SINGLE)
inline bool Any(Mask m) { return _mm_movemask_ps((__m128)m) != 0; }
inline Vec Root(Vec a) { return (Vec)_mm_sqrt_ps((__m128)a); }
#elif ISLET_LANES == 8
inline bool Any(Mask m) { return _mm512_movepi64_mask((__m512i)m) != 0; }
inline Vec Root(Vec a) { return (Vec)_mm512_maskz_sqrt_pd(0xff, (__m512d)a); }
#elif ISLET_LANES == 4
inline bool Any(Mask m) { return _mm256_movemask_pd((__m256d)m) != 0; }
inline Vec Root(Vec a) { return (Vec)_mm256_sqrt_pd((__m256d)a); }
#else
inline bool Any(Mask m) { return (m[0] | m[1]) != 0; }
inline Vec Root(Vec a) { return Vec{__builtin_sqrt(a[0]), __builtin_sqrt(a[1])}; }
#endif

// Six numbers from address(i) on, lane i; on wider vectors two more are read there. A transposition in registers.
#define ISLET_SHUFFLE(a, b, ...) __builtin_shufflevector(a, b, __VA_ARGS__)
#if defined(ISLET_SINGLE) && ISLET_LANES == 8
inline void Transpose(const Vec* in, Vec* out) {
  Vec pairs[8], fours[8];  // [component of 128 bits][two, four lanes of them]
  for (int i = 0; i < 8; i += 2) {
    pairs[i] = ISLET_SHUFFLE(in[i], in[i + 1], 0, 8, 1, 9, 4, 12, 5, 13);
    pairs[i + 1] = ISLET_SHUFFLE(in[i], in[i + 1], 2, 10, 3, 11, 6, 14, 7, 15);
  }
  for (int i = 0; i < 8; i += 4) {
    for (int k = 0; k < 2; ++k) {
      fours[i + 2 * k] = ISLET_SHUFFLE(pairs[i + k], pairs[i + 2 + k], 0, 1, 8, 9, 4, 5, 12, 13);
      fours[i + 2 * k + 1] = ISLET_SHUFFLE(pairs[i + k], pairs[i + 2 + k], 2, 3, 10, 11, 6, 7, 14, 15);
    }
  }
  for (int k = 0; k < 4; ++k) {
    out[k] = ISLET_SHUFFLE(fours[k], fours[4 + k], 0, 1, 2, 3, 8, 9, 10, 11);
    out[4 + k] = ISLET_SHUFFLE(fours[k], fours[4 + k], 4, 5, 6, 7, 12, 13, 14, 15);
  }
}
template <typename Address>
inline void Gather(const Address& address, Vec* out) {
  Vec in[8], all[8];
  for (int i = 0; i < 8; ++i) in[i] = Load(address(i));
  Transpose(in, all);
  for (int k = 0; k < 6; ++k) out[k] = all[k];
}
#elif ISLET_LANES == 8
template <typename Address>
inline void Gather(const Address& address, Vec* out) {
  Vec even[4], odd[4];
  for (int i = 0; i < 4; ++i) {
    const Vec p = Load(address(2 * i)), q = Load(address(2 * i + 1));
    even[i] = ISLET_SHUFFLE(p, q, 0, 8, 2, 10, 4, 12, 6, 14);
    odd[i] = ISLET_SHUFFLE(p, q, 1, 9, 3, 11, 5, 13, 7, 15);
  }
  for (int k = 0; k < 2; ++k) {
    const Vec* in = k == 0 ? even : odd;
    const Vec p = ISLET_SHUFFLE(in[0], in[1], 0, 1, 2, 3, 8, 9, 10, 11);
    const Vec q = ISLET_SHUFFLE(in[2], in[3], 0, 1, 2, 3, 8, 9, 10, 11);
    const Vec r = ISLET_SHUFFLE(in[0], in[1], 4, 5, 6, 7, 12, 13, 14, 15);
    const Vec s = ISLET_SHUFFLE(in[2], in[3], 4, 5, 6, 7, 12, 13, 14, 15);
    out[k] = ISLET_SHUFFLE(p, q, 0, 1, 4, 5, 8, 9, 12, 13);
    out[2 + k] = ISLET_SHUFFLE(p, q, 2, 3, 6, 7, 10, 11, 14, 15);
    out[4 + k] = ISLET_SHUFFLE(r, s, 0, 1, 4, 5, 8, 9, 12, 13);
  }
}
#elif ISLET_LANES == 4
inline void Transpose(const Vec* in, Vec* out) {
  const Vec p = ISLET_SHUFFLE(in[0], in[1], 0, 4, 2, 6), q = ISLET_SHUFFLE(in[0], in[1], 1, 5, 3, 7);
  const Vec r = ISLET_SHUFFLE(in[2], in[3], 0, 4, 2, 6), s = ISLET_SHUFFLE(in[2], in[3], 1, 5, 3, 7);
  out[0] = ISLET_SHUFFLE(p, r, 0, 1, 4, 5);
  out[1] = ISLET_SHUFFLE(q, s, 0, 1, 4, 5);
  out[2] = ISLET_SHUFFLE(p, r, 2, 3, 6, 7);
  out[3] = ISLET_SHUFFLE(q, s, 2, 3, 6, 7);
}
template <typename Address>
inline void Gather(const Address& address, Vec* out) {
  Vec in[4], rest[4];
  for (int i = 0; i < 4; ++i) in[i] = Load(address(i));
  Transpose(in, out);
  for (int i = 0; i < 4; ++i) in[i] = Load(address(i) + 4);
  Transpose(in, rest);
  out[4] = rest[0];
  out[5] = rest[1];
}
#else
template <typename Address>
inline void Gather(const Address& address, Vec* out) {
  for (int k = 0; k < 6; ++k) out[k] = Vec{address(0)[k], address(1)[k]};
}
#endif

}  // namespace
}  // namespace islet::qp
