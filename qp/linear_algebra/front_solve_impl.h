// The kernels of the triangular solves of a front. Part of front_kernels_impl.h.
#pragma once

#include "qp/linear_algebra/front_vectors_impl.h"

namespace islet::qp {
namespace {

#if ISLET_LANES == 4
// All bits of the first lanes, none of the others.
ISLET_INLINE __m256i FirstLanes(int count) {
  return _mm256_cmpgt_epi64(_mm256_set1_epi64x(count), _mm256_setr_epi64x(0, 1, 2, 3));
}
#endif

// x -= columns times their values, for the lines [from, to).
ISLET_INLINE void SubtractColumns(const double* columns, ptrdiff_t stride, const double* value, int from, int to,
                                  double* x) {
  for (int line = from; line < to; line += kLanes) {
    Vec sum = Load(x + line);
    for (int p = 0; p < kColumns; ++p) sum = MultiplyAdd(Load(columns + line + p * stride), -value[p], sum);
    Store(x + line, sum);
  }
}

// Solves the triangle of a panel block in place, group by group; then the lines up to `end` of the vector that it ends in.
void ForwardBlock(const Front& f, int j, double* x) {
  const int stop = j + f.BlockColumns(j), end = f.SolveBegin(j);
  for (int c = j; c < stop; c += kColumns) {
    const double* l = f.panel + c * f.panel_stride;
    double* own = x + f.lead + c;
    double value[kColumns];
    for (int p = 0; p < kColumns; ++p) value[p] = own[p];
    for (int p = 0; p < kColumns; ++p) {
      const double* column = l + f.lead + c + p * f.panel_stride;
      value[p] *= column[p];
      for (int q = p + 1; q < kColumns; ++q) value[q] -= column[q] * value[p];
    }
    for (int p = 0; p < kColumns; ++p) own[p] = value[p];
    const int first = f.lead + c + kColumns, line = RoundDown(first);
    if (line >= end) continue;
#if ISLET_LANES == 4
    // Whole vectors: what lies before the first line stays as it is, without a detour through memory.
    int whole = line;
    for (; whole < first; whole += kLanes) {
      const Vec before = Load(x + whole);
      Vec sum = before;
      for (int p = 0; p < kColumns; ++p) sum = MultiplyAdd(Load(l + whole + p * f.panel_stride), -value[p], sum);
      Store(x + whole, (decltype(sum < sum))FirstLanes(first - whole) ? before : sum);
    }
    SubtractColumns(l, f.panel_stride, value, whole, end, x);
#else
    double kept[kVector];  // whole vectors: what is overwritten before the first line is put back
    for (int q = 0; q < first - line; ++q) kept[q] = x[line + q];
    SubtractColumns(l, f.panel_stride, value, line, end, x);
    for (int q = 0; q < first - line; ++q) x[line + q] = kept[q];
#endif
  }
}

void ForwardLines(const Front& f, int j, int from, int to, double* x) {
  const int stop = j + f.BlockColumns(j);
  for (int c = j; c < stop; c += kColumns)
    SubtractColumns(f.panel + c * f.panel_stride, f.panel_stride, x + f.lead + c, from, to, x);
}

// Lanes from .. to-1 of what is at p, zeros elsewhere; p may hold anything there.
ISLET_INLINE Vec LoadSome(const double* p, int from, int to) {
#if ISLET_LANES == 8
  return (Vec)_mm512_maskz_loadu_pd(static_cast<__mmask8>((1u << to) - (1u << from)), p);
#elif ISLET_LANES == 4
  return (Vec)_mm256_maskload_pd(p, _mm256_and_si256(FirstLanes(to), ~FirstLanes(from)));
#else
  Vec v = {};
  for (int i = from; i < to; ++i) v[i] = p[i];
  return v;
#endif
}

#define ISLET_SHUFFLE(a, b, ...) __builtin_shufflevector(a, b, __VA_ARGS__)
#if ISLET_LANES == 4
// Of four vectors, each ((0 + 1) + (2 + 3)).
ISLET_INLINE Vec SumsOfPairs(Vec a, Vec b, Vec c, Vec d) {
  const Vec p = ISLET_SHUFFLE(a, b, 0, 4, 2, 6) + ISLET_SHUFFLE(a, b, 1, 5, 3, 7);
  const Vec q = ISLET_SHUFFLE(c, d, 0, 4, 2, 6) + ISLET_SHUFFLE(c, d, 1, 5, 3, 7);
  return ISLET_SHUFFLE(p, q, 0, 1, 4, 5) + ISLET_SHUFFLE(p, q, 2, 3, 6, 7);
}
#endif

// Of kVector numbers each, ((0 + 1) + (2 + 3)) + ((4 + 5) + (6 + 7)).
ISLET_INLINE void AddPairs(const Vec (&sums)[kColumns][kVector / kLanes], double* out) {
#if ISLET_LANES == 8
  Vec all[8] = {}, pairs[4], fours[2];
  for (int p = 0; p < kColumns; ++p) all[p] = sums[p][0];
  for (int i = 0; i < 4; ++i)
    pairs[i] = ISLET_SHUFFLE(all[2 * i], all[2 * i + 1], 0, 8, 2, 10, 4, 12, 6, 14) +
               ISLET_SHUFFLE(all[2 * i], all[2 * i + 1], 1, 9, 3, 11, 5, 13, 7, 15);
  for (int i = 0; i < 2; ++i)
    fours[i] = ISLET_SHUFFLE(pairs[2 * i], pairs[2 * i + 1], 0, 1, 8, 9, 4, 5, 12, 13) +
               ISLET_SHUFFLE(pairs[2 * i], pairs[2 * i + 1], 2, 3, 10, 11, 6, 7, 14, 15);
  const Vec sum = ISLET_SHUFFLE(fours[0], fours[1], 0, 1, 2, 3, 8, 9, 10, 11) +
                  ISLET_SHUFFLE(fours[0], fours[1], 4, 5, 6, 7, 12, 13, 14, 15);
  for (int p = 0; p < kColumns; ++p) out[p] = sum[p];
#elif ISLET_LANES == 4
  for (int i = 0; i < kColumns; i += 4) {
    Vec sum[2];
    for (int t = 0; t < 2; ++t) {
      const auto of = [&](int p) { return p < kColumns ? sums[p][t] : Vec{}; };
      sum[t] = SumsOfPairs(of(i), of(i + 1), of(i + 2), of(i + 3));
    }
    const Vec all = sum[0] + sum[1];
    for (int p = i; p < kColumns && p < i + 4; ++p) out[p] = all[p - i];
  }
#else
  for (int p = 0; p < kColumns; ++p) {
    double pair[4];
    for (int t = 0; t < 4; ++t) pair[t] = sums[p][t][0] + sums[p][t][1];
    out[p] = (pair[0] + pair[1]) + (pair[2] + pair[3]);
  }
#endif
}
#undef ISLET_SHUFFLE

// sum[p] = sum of column p times x over the lines [from, end). A sum for each place in the widest vector, then in pairs, so that the bits
// are those of any other width.
ISLET_INLINE void DotColumns(const double* columns, ptrdiff_t stride, const double* x, int from, int end, double* sum) {
  constexpr int kParts = kVector / kLanes;
  Vec sums[kColumns][kParts] = {};
  const auto add = [&](int line, const auto& load) {  // line: a multiple of kVector
    for (int t = 0; t < kParts; ++t) {
      const int first = line + t * kLanes;
      if (first + kLanes <= from || first >= end) continue;
      const Vec v = load(x, first);
      for (int p = 0; p < kColumns; ++p) sums[p][t] += load(columns + p * stride, first) * v;
    }
  };
  const auto some = [&](const double* p, int first) {
    return LoadSome(p + first, from > first ? from - first : 0, end - first < kLanes ? end - first : kLanes);
  };
  const auto whole = [](const double* p, int first) { return Load(p + first); };
  int line = RoundDown(from);
  if (line < from) add(line, some), line += kVector;
  for (; line + kVector <= end; line += kVector) add(line, whole);
  if (line < end) add(line, some);
  AddPairs(sums, sum);
}

// x[c] -= (column c below the panel block at j) x.
void BackwardColumns(const Front& f, int j, int from, int to, double* x) {
  const int first = f.lead + j + f.BlockColumns(j), end = f.lead + f.n;
  if (first == end) return;
  for (int c = from; c < to; c += kColumns) {
    double sum[kColumns];
    DotColumns(f.panel + c * f.panel_stride, f.panel_stride, x, first, end, sum);
    for (int p = 0; p < kColumns; ++p) x[f.lead + c + p] -= sum[p];
  }
}

void BackwardBlock(const Front& f, int j, double* x) {
  const int stop = j + f.BlockColumns(j);
  for (int c = stop - kColumns; c >= j; c -= kColumns) {
    const double* l = f.panel + f.lead + c * f.panel_stride;
    double* own = x + f.lead;
    double sum[kColumns] = {};
    if (c + kColumns < stop) DotColumns(l - f.lead, f.panel_stride, x, f.lead + c + kColumns, f.lead + stop, sum);
    double value[kColumns];
    for (int p = 0; p < kColumns; ++p) value[p] = own[c + p] - sum[p];
    for (int p = kColumns - 1; p >= 0; --p) {  // the one found last is taken off last: only it is waited for
      const double* column = l + p * f.panel_stride;
      for (int q = kColumns - 1; q > p; --q) value[p] -= column[c + q] * value[q];
      value[p] *= column[c + p];
    }
    for (int p = 0; p < kColumns; ++p) own[c + p] = value[p];
  }
}

void ForwardFront(const Front& f, double* x) {
  for (int j = 0; j < f.k; j += kPanelBlock) {
    ForwardBlock(f, j, x);
    ForwardLines(f, j, f.SolveBegin(j), f.EndLine(), x);
  }
}

void BackwardFront(const Front& f, double* x) {
  for (int j = (f.k - 1) / kPanelBlock * kPanelBlock; j >= 0; j -= kPanelBlock) {
    BackwardColumns(f, j, j, j + f.BlockColumns(j), x);
    BackwardBlock(f, j, x);
  }
}

}  // namespace
}  // namespace islet::qp
