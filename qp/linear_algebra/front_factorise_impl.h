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
  double* triangle;  // per group of columns i: -L S of its rows, up to and with its own columns: (i + kColumns) rows
  double* packed;    // -L S of the rows below, per group of kColumns rows: width x kColumns
};

// Position of group i (first column, multiple of kColumns) in the triangle: sum of (q + kColumns) kColumns over the groups before.
ISLET_INLINE int TriangleAt(int i) {
  const int g = i / kColumns;
  return kColumns * kColumns * (g * (g + 1) / 2);
}

// By how much whole vectors go beyond a row of a group.
constexpr int kSpill = (kColumns + kLanes - 1) / kLanes * kLanes - kColumns;

// whole_vectors: what lies beyond the rows of the group may be read.
// out[p kColumns + i] = -signs[p] a[i + p lda] for i in [from, to).
ISLET_INLINE void PackRows(int k, const double* a, ptrdiff_t lda, const double* signs, int from, int to,
                           bool whole_vectors, double* out) {
  if (from == 0 && to == kColumns) {
    // Whole vectors spill over into the place of the next columns, which are written later; so not for the last ones.
    int p = 0;
    for (; whole_vectors && (k - p) * kColumns >= kColumns + kSpill; ++p, a += lda, out += kColumns)
      for (int i = 0; i < kColumns; i += kLanes) Store(out + i, Load(a + i) * -signs[p]);
    for (; p < k; ++p, a += lda, out += kColumns)
      for (int i = 0; i < kColumns; ++i) out[i] = -signs[p] * a[i];
  } else {
    for (int p = 0; p < k; ++p, a += lda, out += kColumns)
      for (int i = from; i < to; ++i) out[i] = -signs[p] * a[i];
  }
}

// The rows of the lines [from, to) that lie below the panel block, for update_lines.
void PackLines(const Front& f, int j, int from, int to) {
  const Scratch s(f, j);
  const int begin = f.lead + j + s.width, end = to < f.lead + f.n ? to : f.lead + f.n;
  for (int line = from > begin ? from : begin; line < end;) {
    const int group = (line - begin) / kColumns, first = begin + group * kColumns;
    const int stop = end < first + kColumns ? end : first + kColumns;
    // The lines from `to` on may be another thread's.
    PackRows(s.width, f.panel + first + j * f.panel_stride, f.panel_stride, f.signs + j, line - first, stop - first,
             first + kColumns + kSpill <= to, s.packed + group * kColumns * s.width);
    line = stop;
  }
}

// Signed Cholesky of the square block at d, in place, its diagonal inverted. Returns the number of replaced pivots.
ISLET_INLINE int FactoriseDiagonal(double* d, int stride, const double* signs) {
  int replaced = 0;
  double l[kColumns][kColumns];
  for (int j = 0; j < kColumns; ++j)
    for (int i = j; i < kColumns; ++i) l[i][j] = d[i + j * stride];
  for (int j = 0; j < kColumns; ++j) {
    double pivot = signs[j] * l[j][j];
    if (!(pivot > 0)) {
      pivot = 1e128;  // the row drops out of the solution, as in interior-point practice
      ++replaced;
    }
    const double inverse = 1 / __builtin_sqrt(pivot);
    l[j][j] = inverse;
    const double signed_inverse = signs[j] * inverse;
    for (int i = j + 1; i < kColumns; ++i) l[i][j] *= signed_inverse;
    for (int q = j + 1; q < kColumns; ++q) {
      const double factor = signs[j] * l[q][j];
      for (int i = q; i < kColumns; ++i) l[i][q] -= factor * l[i][j];
    }
  }
  for (int j = 0; j < kColumns; ++j)
    for (int i = j; i < kColumns; ++i) d[i + j * stride] = l[i][j];
  return replaced;
}

// The group of columns from i on of the panel block at j, for T vectors of lines: X <- (X - earlier columns) L^-T S.
template <int T>
ISLET_INLINE void SolveGroup(const Front& f, const Scratch& s, int j, int i, int line) {
  double* x = f.panel + line + (j + i) * f.panel_stride;
  const double* b = s.triangle + TriangleAt(i);
  Vec sum[T][kColumns];
  LoadTile<T, kColumns>(x, f.panel_stride, sum);
  AddMultiple<T, kColumns>(i, f.panel + line + j * f.panel_stride, f.panel_stride, b, sum);
  b += i * kColumns;
  for (int p = 0; p < kColumns; ++p) {
    for (int t = 0; t < T; ++t) sum[t][p] *= s.inverse[i + p];
    for (int q = p + 1; q < kColumns; ++q)
      for (int t = 0; t < T; ++t) sum[t][q] = MultiplyAdd(sum[t][p], b[p * kColumns + q], sum[t][q]);
  }
  StoreTile<T, kColumns>(sum, x, f.panel_stride);
}

void SolveLines(const Front& f, int j, int from, int to) {
  const Scratch s(f, j);
  int line = from;
  for (; line + kTile * kLanes <= to; line += kTile * kLanes)
    for (int i = 0; i < s.width; i += kColumns) SolveGroup<kTile>(f, s, j, i, line);
  for (; line < to; line += kLanes)
    for (int i = 0; i < s.width; i += kColumns) SolveGroup<1>(f, s, j, i, line);
  if (j + s.width < f.n) PackLines(f, j, from, to);
}

// The triangle of the panel block at j, and what shares its last vector of lines.
int Eliminate(const Front& f, int j) {
  const Scratch s(f, j);
  const ptrdiff_t stride = f.panel_stride;
  const int end = f.SolveBegin(j);
  int replaced = 0;
  for (int i = 0; i < s.width; i += kColumns) {
    const int line = f.lead + j + i, top = RoundDown(line);
    double* triangle = s.triangle + TriangleAt(i);
    const double* rows = f.panel + line + j * stride;
    PackRows(i, rows, stride, f.signs + j, 0, kColumns, true, triangle);
    double diagonal[2 * kVector * kColumns];  // the rows of a group lie in two of the widest vectors
    for (int v = 0; v < 2 * kVector && top + v < line + kColumns; v += kLanes) {
      Vec sum[1][kColumns];
      LoadTile<1, kColumns>(f.panel + top + v + (j + i) * stride, stride, sum);
      AddMultiple<1, kColumns>(i, f.panel + top + v + j * stride, stride, triangle, sum);
      StoreTile<1, kColumns>(sum, diagonal + v, 2 * kVector);
    }
    double* d = diagonal + (line - top);
    replaced += FactoriseDiagonal(d, 2 * kVector, f.signs + j + i);
    for (int p = 0; p < kColumns; ++p) {
      s.inverse[i + p] = f.signs[j + i + p] * d[p + p * 2 * kVector];
      for (int q = p + 1; q < kColumns; ++q)
        triangle[(i + p) * kColumns + q] = -f.signs[j + i + p] * d[q + p * 2 * kVector];
    }
    // Whole vectors: rows of the diagonal block are overwritten, and put back.
    int below = RoundDown(line + kColumns);
    for (; below + kTile * kLanes <= end; below += kTile * kLanes) SolveGroup<kTile>(f, s, j, i, below);
    for (; below < end; below += kLanes) SolveGroup<1>(f, s, j, i, below);
    for (int q = 0; q < kColumns; ++q)
      for (int p = q; p < kColumns; ++p) f.panel[line + p + (j + i + q) * stride] = d[p + q * 2 * kVector];
  }
  if (j + s.width < f.n) PackLines(f, j, f.lead + j + s.width, end);
  return replaced;
}

// A group of columns behind the panel block, for T vectors of lines.
template <int T>
ISLET_INLINE void UpdateTile(const Front& f, const Scratch& s, int j, int line, const double* b, double* c,
                             ptrdiff_t stride, bool fresh) {
  Vec sum[T][kColumns];
  if (fresh) {
    for (int q = 0; q < kColumns; ++q)
      for (int t = 0; t < T; ++t) sum[t][q] = Vec{};
  } else {
    LoadTile<T, kColumns>(c, stride, sum);
  }
  const double* a = f.panel + line + j * f.panel_stride;
  for (int p = 0; p < s.width; ++p, a += f.panel_stride, b += kColumns) {
    Vec column[T];
    for (int t = 0; t < T; ++t) column[t] = Load(a + t * kLanes);
    for (int q = 0; q < kColumns; ++q)
      for (int t = 0; t < T; ++t) sum[t][q] = MultiplyAdd(column[t], b[q], sum[t][q]);
  }
  StoreTile<T, kColumns>(sum, c, stride);
}

// Lines [first, end) of a group of columns; at most a tile of them.
ISLET_INLINE void UpdateGroup(const Front& f, const Scratch& s, int j, int first, int end, const double* b, double* out,
                              ptrdiff_t stride, bool fresh) {
  int line = first;
  if (line + kTile * kLanes == end) {
    UpdateTile<kTile>(f, s, j, line, b, out + line, stride, fresh);
    return;
  }
  if (kTile > 2 && line + 2 * kLanes <= end) {
    UpdateTile<2>(f, s, j, line, b, out + line, stride, fresh);
    line += 2 * kLanes;
  }
  for (; line < end; line += kLanes) UpdateTile<1>(f, s, j, line, b, out + line, stride, fresh);
}

// Lines [from, to) of the columns behind the panel block; no split at line lead + k within.
void UpdatePart(const Front& f, int j, int from, int to) {
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
      const ptrdiff_t stride = in_panel ? f.panel_stride : f.update_stride;
      double* out = in_panel ? f.panel + c * stride : f.update + (c - f.k) * stride - middle;
      const bool fresh = !in_panel && f.fresh && j == 0;
      UpdateGroup(f, s, j, line, end, b, out, stride, fresh);
      c += kColumns, b += kColumns * s.width;
    }
  }
}

void UpdateLines(const Front& f, int j, int from, int to) {
  const int middle = f.lead + f.k;
  if (from < middle) UpdatePart(f, j, from, to < middle ? to : middle);
  if (to > middle) UpdatePart(f, j, from > middle ? from : middle, to);
}

int FactoriseFront(const Front& f) {
  int replaced = 0;
  for (int j = 0; j < f.k; j += kPanelBlock) {
    replaced += Eliminate(f, j);
    if (f.SolveBegin(j) < f.EndLine()) SolveLines(f, j, f.SolveBegin(j), f.EndLine());
    if (j + f.BlockColumns(j) < f.n) UpdateLines(f, j, f.UpdateBegin(j), f.EndLine());
  }
  return replaced;
}

}  // namespace
}  // namespace islet::qp
