// The kernels that factorise a front, and those that it takes to share one. Part of front_kernels_impl.h.
#pragma once

#include "qp/linear_algebra/front_vectors_impl.h"

namespace islet::qp {
namespace {

// Where the parts of Front::scratch begin, for the panel block at column j.
struct Scratch {
  Scratch(const Front& f, int j) : width(f.BlockColumns(j)) {
    inverse = f.scratch;
    triangle = inverse + width;
    packed = triangle + width * (width + f.block);
  }
  int width;
  double* inverse;   // sign / pivot, per column
  double* triangle;  // per group of N columns i: -L S of its rows, up to and with its own columns: (i + N) x N
  double* packed;    // -L S of the rows below, per group of N rows: width x N
};

// Position of group i (first column, multiple of N) in the triangle: sum of (q + N) N over the groups before.
template <int N>
ISLET_INLINE int TriangleAt(int i) {
  const int g = i / N;
  return N * N * (g * (g + 1) / 2);
}

// By how much whole vectors go beyond N numbers.
template <int N>
constexpr int kSpill = (N + kLanes - 1) / kLanes* kLanes - N;

// whole_vectors: what lies beyond the N rows may be read.
// out[p N + i] = -signs[p] a[i + p lda] for i in [from, to).
template <int N>
ISLET_INLINE void PackRows(int k, const double* a, int lda, const double* signs, int from, int to, bool whole_vectors,
                           double* out) {
  if (from == 0 && to == N) {
    // Whole vectors spill over into the place of the next columns, which are written later; so not for the last ones.
    int p = 0;
    for (; whole_vectors && (k - p) * N >= N + kSpill<N>; ++p, a += lda, out += N)
      for (int i = 0; i < N; i += kLanes) Store(out + i, Load(a + i) * -signs[p]);
    for (; p < k; ++p, a += lda, out += N)
      for (int i = 0; i < N; ++i) out[i] = -signs[p] * a[i];
  } else {
    for (int p = 0; p < k; ++p, a += lda, out += N)
      for (int i = from; i < to; ++i) out[i] = -signs[p] * a[i];
  }
}

// The rows of the lines [from, to) that lie below the panel block, for update_lines.
template <int N>
void PackLines(const Front& f, int j, int from, int to) {
  const Scratch s(f, j);
  const int begin = f.lead + j + s.width, end = to < f.lead + f.n ? to : f.lead + f.n;
  for (int line = from > begin ? from : begin; line < end;) {
    const int group = (line - begin) / N, first = begin + group * N;
    const int stop = end < first + N ? end : first + N;
    // The lines from `to` on may be another thread's.
    PackRows<N>(s.width, f.panel + first + j * f.panel_stride, f.panel_stride, f.signs + j, line - first, stop - first,
                first + N + kSpill<N> <= to, s.packed + group * N * s.width);
    line = stop;
  }
}

// Signed Cholesky of the N x N block at d, in place, its diagonal inverted. Returns the number of replaced pivots.
template <int N>
ISLET_INLINE int FactoriseDiagonal(double* d, int stride, const double* signs, double tiny) {
  int replaced = 0;
  double l[N][N];
  for (int j = 0; j < N; ++j)
    for (int i = j; i < N; ++i) l[i][j] = d[i + j * stride];
  for (int j = 0; j < N; ++j) {
    double pivot = signs[j] * l[j][j];
    if (!(pivot > tiny)) {
      pivot = 1e128;  // the row drops out of the solution, as in interior-point practice
      ++replaced;
    }
    const double inverse = 1 / __builtin_sqrt(pivot);
    l[j][j] = inverse;
    const double signed_inverse = signs[j] * inverse;
    for (int i = j + 1; i < N; ++i) l[i][j] *= signed_inverse;
    for (int q = j + 1; q < N; ++q) {
      const double factor = signs[j] * l[q][j];
      for (int i = q; i < N; ++i) l[i][q] -= factor * l[i][j];
    }
  }
  for (int j = 0; j < N; ++j)
    for (int i = j; i < N; ++i) d[i + j * stride] = l[i][j];
  return replaced;
}

// Columns i .. i+N-1 of the panel block at j, for T vectors of lines: X <- (X - earlier columns) L^-T S.
template <int T, int N>
ISLET_INLINE void SolveGroup(const Front& f, const Scratch& s, int j, int i, int line) {
  double* x = f.panel + line + (j + i) * f.panel_stride;
  const double* b = s.triangle + TriangleAt<N>(i);
  Vec sum[T][N];
  LoadTile<T, N>(x, f.panel_stride, sum);
  AddMultiple<T, N>(i, f.panel + line + j * f.panel_stride, f.panel_stride, b, sum);
  b += i * N;
  for (int p = 0; p < N; ++p) {
    for (int t = 0; t < T; ++t) sum[t][p] *= s.inverse[i + p];
    for (int q = p + 1; q < N; ++q)
      for (int t = 0; t < T; ++t) sum[t][q] = MultiplyAdd(sum[t][p], b[p * N + q], sum[t][q]);
  }
  StoreTile<T, N>(sum, x, f.panel_stride);
}

template <int N>
void SolveLines(const Front& f, int j, int from, int to) {
  const Scratch s(f, j);
  int line = from;
  for (; line + kTile * kLanes <= to; line += kTile * kLanes)
    for (int i = 0; i < s.width; i += N) SolveGroup<kTile, N>(f, s, j, i, line);
  for (; line < to; line += kLanes)
    for (int i = 0; i < s.width; i += N) SolveGroup<1, N>(f, s, j, i, line);
  if (j + s.width < f.n) PackLines<N>(f, j, from, to);
}

// The triangle of the panel block at j, and what shares its last vector of lines.
template <int N>
int Eliminate(const Front& f, int j) {
  const Scratch s(f, j);
  const int stride = f.panel_stride, end = f.SolveBegin(j);
  int replaced = 0;
  for (int i = 0; i < s.width; i += N) {
    const int line = f.lead + j + i, top = RoundDown(line);
    double* triangle = s.triangle + TriangleAt<N>(i);
    const double* rows = f.panel + line + j * stride;
    PackRows<N>(i, rows, stride, f.signs + j, 0, N, true, triangle);
    double diagonal[2 * kVector * N];  // N <= 8 rows lie in two of the widest vectors
    for (int v = 0; v < 2 * kVector && top + v < line + N; v += kLanes) {
      Vec sum[1][N];
      LoadTile<1, N>(f.panel + top + v + (j + i) * stride, stride, sum);
      AddMultiple<1, N>(i, f.panel + top + v + j * stride, stride, triangle, sum);
      StoreTile<1, N>(sum, diagonal + v, 2 * kVector);
    }
    double* d = diagonal + (line - top);
    replaced += FactoriseDiagonal<N>(d, 2 * kVector, f.signs + j + i, f.tiny);
    for (int p = 0; p < N; ++p) {
      s.inverse[i + p] = f.signs[j + i + p] * d[p + p * 2 * kVector];
      for (int q = p + 1; q < N; ++q) triangle[(i + p) * N + q] = -f.signs[j + i + p] * d[q + p * 2 * kVector];
    }
    // Whole vectors: rows of the diagonal block are overwritten, and put back.
    int below = RoundDown(line + N);
    for (; below + kTile * kLanes <= end; below += kTile * kLanes) SolveGroup<kTile, N>(f, s, j, i, below);
    for (; below < end; below += kLanes) SolveGroup<1, N>(f, s, j, i, below);
    for (int q = 0; q < N; ++q)
      for (int p = q; p < N; ++p) f.panel[line + p + (j + i + q) * stride] = d[p + q * 2 * kVector];
  }
  if (j + s.width < f.n) PackLines<N>(f, j, f.lead + j + s.width, end);
  return replaced;
}

// G groups of N columns behind the panel block, for T vectors of lines.
template <int T, int N, int G>
ISLET_INLINE void UpdateTile(const Front& f, const Scratch& s, int j, int line, const double* b, double* c, int stride,
                             bool fresh) {
  Vec sum[T][G * N];
  if (fresh) {
    for (int q = 0; q < G * N; ++q)
      for (int t = 0; t < T; ++t) sum[t][q] = Vec{};
  } else {
    LoadTile<T, G * N>(c, stride, sum);
  }
  const double* a = f.panel + line + j * f.panel_stride;
  for (int p = 0; p < s.width; ++p, a += f.panel_stride, b += N) {
    Vec column[T];
    for (int t = 0; t < T; ++t) column[t] = Load(a + t * kLanes);
    for (int g = 0; g < G; ++g)
      for (int q = 0; q < N; ++q)
        for (int t = 0; t < T; ++t)
          sum[t][g * N + q] = MultiplyAdd(column[t], b[g * N * s.width + q], sum[t][g * N + q]);
  }
  StoreTile<T, G * N>(sum, c, stride);
}

// Lines [first, end) of G groups of columns; at most a tile of them.
template <int N, int G>
ISLET_INLINE void UpdateGroups(const Front& f, const Scratch& s, int j, int first, int end, const double* b,
                               double* out, int stride, bool fresh) {
  int line = first;
  if (line + kTile * kLanes == end) {
    UpdateTile<kTile, N, G>(f, s, j, line, b, out + line, stride, fresh);
    return;
  }
  if (kTile > 2 && line + 2 * kLanes <= end) {
    UpdateTile<2, N, G>(f, s, j, line, b, out + line, stride, fresh);
    line += 2 * kLanes;
  }
  for (; line < end; line += kLanes) UpdateTile<1, N, G>(f, s, j, line, b, out + line, stride, fresh);
}

// Lines [from, to) of the columns behind the panel block; no split at line lead + k within.
template <int N>
void UpdatePart(const Front& f, int j, int from, int to) {
  constexpr int kGroups = N <= 3 ? 2 : 1;  // of few columns two at once: more sums that do not wait for each other
  const Scratch s(f, j);
  const int behind = j + s.width, tile = kTile * kLanes;
  const int middle = f.lead + f.k;
  for (int begin = from; begin < to; begin += tile) {
    const int end = begin + tile < to ? begin + tile : to;
    const double* b = s.packed;
    for (int c = behind; c < f.n && f.lead + c < end;) {
      const int diagonal = (f.lead + c) / kLanes * kLanes;
      const int line = diagonal > begin ? diagonal : begin;
      const bool in_panel = c < f.k;
      const int stride = in_panel ? f.panel_stride : f.update_stride;
      double* out = in_panel ? f.panel + c * stride : f.update + (c - f.k) * stride - middle;
      const bool fresh = !in_panel && f.fresh && j == 0;
      if (kGroups > 1 && c + kGroups * N <= (in_panel ? f.k : f.n)) {
        UpdateGroups<N, kGroups>(f, s, j, line, end, b, out, stride, fresh);
        c += kGroups * N, b += kGroups * N * s.width;
      } else {
        UpdateGroups<N, 1>(f, s, j, line, end, b, out, stride, fresh);
        c += N, b += N * s.width;
      }
    }
  }
}

template <int N>
void UpdateLines(const Front& f, int j, int from, int to) {
  const int middle = f.lead + f.k;
  if (from < middle) UpdatePart<N>(f, j, from, to < middle ? to : middle);
  if (to > middle) UpdatePart<N>(f, j, from > middle ? from : middle, to);
}

template <int N>
int FactoriseFront(const Front& f) {
  int replaced = 0;
  for (int j = 0; j < f.k; j += kPanelBlock) {
    replaced += Eliminate<N>(f, j);
    if (f.SolveBegin(j) < f.EndLine()) SolveLines<N>(f, j, f.SolveBegin(j), f.EndLine());
    if (j + f.BlockColumns(j) < f.n) UpdateLines<N>(f, j, f.UpdateBegin(j), f.EndLine());
  }
  return replaced;
}

}  // namespace
}  // namespace islet::qp
