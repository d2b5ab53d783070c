// The inner loops of the interior point over the contacts' cones: eight contacts of one kind of cone are a batch, one in each
// lane of wide vectors. Compiled for several vector widths; the widest that the machine has is chosen once, at run time.
//
// The same operations as in cone.h, whose notation is used: s, z rows of the cone, W their scaling, lambda = W z = W^-1 s,
// target t = W dz + W^-1 ds. Each number is made by the same operations however the batches are split.
//   threads: kernels on disjoint ranges of batches (or places) may run side by side; no allocation
#pragma once

namespace islet::qp {

inline constexpr int kRowLanes = 8;

struct alignas(64) Lanes {
  double at[kRowLanes];
};

// Constants of eight contacts: [side][direction][component][lane]. An empty lane has rows of zero, offset (1, 0, 0),
// nothing in `used`, and stays at s = z = the cone's unit element.
struct alignas(64) RowBatch {
  double jacobian[2][3][6][kRowLanes];
  double offset[3][kRowLanes];  // the constant part of the contact velocity
  double friction[kRowLanes];
  double compliance[kRowLanes];  // R: the contact velocity gives way by R j
  double used[kRowLanes];        // 1 or 0
  int velocity[2][kRowLanes];    // first of the six numbers in y that it constrains
  int contact[kRowLanes];
  int rows;     // of the cone: 1 a ray, 3 a second-order cone, 8 the octagon
  int first;    // of its `rows` Lanes in each array of rows
  double sign;  // with which the rows enter the matrix
  bool soft;    // R is not zero in some lane
};

// What the kernels work on. Arrays of rows start at batch.first; per batch there are 9 Lanes of softening.
struct RowArrays {
  const RowBatch* batches;
  const double* edges;             // of the octagon: cosine and sine, eight times
  Lanes *s, *z, *primal, *lambda;  // primal: s - T (J y + offset + R j)
  Lanes *point, *inverse;          // W; ray and octagon: its inverse; circle: eta, 1 / eta, 1 / (1 + w_0)
  Lanes* softening;                // (I + D R)^-1, row by row
};

// One direction: target, ds and dz in scaled space, ds once more as it is, and per batch three Lanes with the part of dj that
// dy does not change.
struct RowDirection {
  Lanes *target, *ds, *dz, *plain, *constants;
};

struct RowSums {
  double gap = 0, worst = 0;
};

// J^T of one side of a contact, row by row, and where its force is.
struct alignas(64) SideRows {
  double rows[3][kRowLanes];  // six numbers and two zeros
};

struct RowKernels {
  // primal, forces (three Lanes a batch: sign j) and the sums for batches from .. to-1. y has two numbers to spare.
  RowSums (*residuals)(const RowArrays& arrays, int from, int to, const double* y, Lanes* forces);
  // Scaling and affine target; D (9 Lanes a batch, softened) with (I + D R)^-1. False if s or z left its cone.
  bool (*scale)(const RowArrays& arrays, int from, int to, Lanes* target, Lanes* d);
  // Mehrotra's target: s o z = goal e, less what the direction leaves of second order.
  void (*aim)(const RowArrays& arrays, const RowDirection& direction, int from, int to, double goal);
  // Gondzio's target in `next`: that of `now`, and what pulls products after the whole step into [low, high].
  void (*centre)(const RowArrays& arrays, const RowDirection& now, const RowDirection& next, int from, int to,
                 double low, double high);
  // Constants of the direction, and the forces that they are.
  void (*start)(const RowArrays& arrays, const RowDirection& direction, int from, int to, double weight, Lanes* forces);
  // ds, dz and plain that belong to dy. Returns 1 / the longest step, or 0 if there is no bound.
  double (*complete)(const RowArrays& arrays, const RowDirection& direction, int from, int to, double weight,
                     const double* dy);
  // Takes the correction off them: dy -= correction. Returns as `complete`.
  double (*correct)(const RowArrays& arrays, const RowDirection& direction, int from, int to, const double* correction);
  // sign dj.
  void (*forces)(const RowArrays& arrays, const RowDirection& direction, int from, int to, Lanes* forces);
  void (*advance)(const RowArrays& arrays, const RowDirection& direction, int from, int to, double step);
  // out[6 place ..] = sum of J^T f over the sides start[place] .. start[place + 1] - 1; force_at: of each side, a double.
  void (*gather)(int from, int to, const int* start, const SideRows* sides, const int* force_at, const Lanes* forces,
                 double* out);
};

// The set of the chosen width (build_facts.h).
const RowKernels& BestRowKernels();

// The set of that name, or null if this machine or build has none.
const RowKernels* FindRowKernels(const char* name);

}  // namespace islet::qp
