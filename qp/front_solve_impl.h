// The kernels of the triangular solves of a front. Part of front_kernels_impl.h.
#pragma once

#include "qp/front_vectors_impl.h"

namespace islet::qp {
namespace {

// x -= columns j .. j+N-1 times value, for the lines [from, to).
template <int N>
ISLET_INLINE void SubtractColumns(const double* columns, int stride, const double* value, int from, int to, double* x) {
  for (int line = from; line < to; line += kLanes) {
    Vec sum = Load(x + line);
    for (int p = 0; p < N; ++p) sum = MultiplyAdd(Load(columns + line + p * stride), -value[p], sum);
    Store(x + line, sum);
  }
}

// Solves the triangle of columns j .. j+N-1 in place; then the lines up to `end` of the vector that it ends in.
template <int N>
void ForwardBlock(const Front& f, int j, double* x) {
  const int stop = j + f.BlockColumns(j), end = f.SolveBegin(j);
  for (int c = j; c < stop; c += N) {
    const double* l = f.panel + c * f.panel_stride;
    double* own = x + f.lead + c;
    double value[N];
    for (int p = 0; p < N; ++p) value[p] = own[p];
    for (int p = 0; p < N; ++p) {
      const double* column = l + f.lead + c + p * f.panel_stride;
      value[p] *= column[p];
      for (int q = p + 1; q < N; ++q) value[q] -= column[q] * value[p];
    }
    for (int p = 0; p < N; ++p) own[p] = value[p];
    const int line = RoundDown(f.lead + c + N), stays = f.lead + c + N - line;
    if (line >= end) continue;
    double kept[kVector];  // whole vectors: what is overwritten before the first line is put back
    for (int q = 0; q < stays; ++q) kept[q] = x[line + q];
    SubtractColumns<N>(l, f.panel_stride, value, line, end, x);
    for (int q = 0; q < stays; ++q) x[line + q] = kept[q];
  }
}

template <int N>
void ForwardLines(const Front& f, int j, int from, int to, double* x) {
  const int stop = j + f.BlockColumns(j);
  for (int c = j; c < stop; c += N)
    SubtractColumns<N>(f.panel + c * f.panel_stride, f.panel_stride, x + f.lead + c, from, to, x);
}

// x[c] -= (column c below the panel block at j) x.
template <int N>
void BackwardColumns(const Front& f, int j, int from, int to, double* x) {
  const int first = f.lead + j + f.BlockColumns(j), end = f.lead + f.n;
  for (int c = from; c < to; c += N) {
    const double* l = f.panel + c * f.panel_stride;
    Vec sums[N] = {};
    double sum[N] = {};
    int line = first;
    for (; line < end && line % kLanes != 0; ++line)
      for (int p = 0; p < N; ++p) sum[p] += l[line + p * f.panel_stride] * x[line];
    for (; line + kLanes <= end; line += kLanes) {
      const Vec v = Load(x + line);
      for (int p = 0; p < N; ++p) sums[p] += Load(l + line + p * f.panel_stride) * v;
    }
    for (; line < end; ++line)
      for (int p = 0; p < N; ++p) sum[p] += l[line + p * f.panel_stride] * x[line];
    for (int p = 0; p < N; ++p) {
      for (int t = 0; t < kLanes; ++t) sum[p] += sums[p][t];
      x[f.lead + c + p] -= sum[p];
    }
  }
}

template <int N>
void BackwardBlock(const Front& f, int j, double* x) {
  const int stop = j + f.BlockColumns(j);
  for (int c = stop - N; c >= j; c -= N) {
    const double* l = f.panel + f.lead + c * f.panel_stride;
    double* own = x + f.lead;
    double sum[N] = {};
    for (int r = c + N; r < stop; ++r)
      for (int p = 0; p < N; ++p) sum[p] += l[r + p * f.panel_stride] * own[r];
    for (int p = N - 1; p >= 0; --p) {
      const double* column = l + p * f.panel_stride;
      double value = own[c + p] - sum[p];
      for (int q = p + 1; q < N; ++q) value -= column[c + q] * own[c + q];
      own[c + p] = value * column[c + p];
    }
  }
}

template <int N>
void ForwardFront(const Front& f, double* x) {
  for (int j = 0; j < f.k; j += kPanelBlock) {
    ForwardBlock<N>(f, j, x);
    ForwardLines<N>(f, j, f.SolveBegin(j), f.EndLine(), x);
  }
}

template <int N>
void BackwardFront(const Front& f, double* x) {
  for (int j = (f.k - 1) / kPanelBlock * kPanelBlock; j >= 0; j -= kPanelBlock) {
    BackwardColumns<N>(f, j, j, j + f.BlockColumns(j), x);
    BackwardBlock<N>(f, j, x);
  }
}

}  // namespace
}  // namespace islet::qp
