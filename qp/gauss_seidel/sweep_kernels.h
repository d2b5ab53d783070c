// The inner loop of the Gauss-Seidel sweeps: batches of eight contacts, one in each lane of wide vectors. Compiled for
// several vector widths, for doubles and for floats; the widest that the machine has is chosen once, at run time.
//
// No two contacts of a batch share a body, so that their order within it does not matter. In coordinates of its own each
// contact is as simple as can be: bodies have unit mass (y = G^-1 v with M^-1 = G G^T), tangents point along the axes of the
// tangential operator, and impulses x = T^-1 j are scaled and sheared such that T^T W_cc T = 1. An empty lane has rows
// of zero and offset 1: it stays open.
//   threads: pure functions on the memory they are given
#pragma once

namespace islet::qp {

inline constexpr int kBatchLanes = 8;

// [direction][lane]; directions are the normal and two tangents in the contact's own coordinates.
template <typename Number>
struct alignas(64) SweepBatch {
  Number rows[2][3][6][kBatchLanes];  // T^T J G of side a and b: [side][direction][component of y][lane]
  Number offset[3][kBatchLanes];      // T^T (drift - target n)
  // j_1 = tangent_1 x_1, j_2 = tangent_2 x_2, j_n = normal x_n + shear_1 j_1 + shear_2 j_2: the matrix T
  Number normal[kBatchLanes], tangent[2][kBatchLanes], shear[2][kBatchLanes];
  Number friction[kBatchLanes];
  Number weight[kBatchLanes];  // W_nn: makes a velocity of an impulse, for the stopping test
  Number compliance[kBatchLanes];
  int body[2][kBatchLanes];  // places in the array of velocities
  int used;                  // lanes from the first on; vectors of empty lanes are left out
};

template <typename Number>
struct alignas(64) SweepState {
  Number x[3][kBatchLanes];         // after the last sweep
  Number previous[3][kBatchLanes];  // after the one before
  Number lambda[kBatchLanes];       // of a contact that slides, u_t = -lambda j_t; else 0
};

template <typename Number>
struct alignas(8 * sizeof(Number)) SweepVelocity {
  Number y[8];  // six numbers; the last two stay zero
};

struct SweepSums {
  double largest = 0;  // change of an impulse times its weight [velocity]
  double change = 0;   // |x - z|^2
  double ahead = 0;    // (x - z) . (x - previous): negative where momentum led astray
};

template <typename Number>
struct SweepKernels {
  const char* name;
  // One sweep over the batches from z = x + momentum (x - previous); velocities must be those of z, and are those of the new
  // x then. compliant: some contact has compliance.
  SweepSums (*coulomb)(int num_batches, const SweepBatch<Number>* batches, bool compliant, Number momentum,
                       SweepState<Number>* states, SweepVelocity<Number>* velocities);
  // The same where no contact has friction or compliance: tangential rows, impulses and lambda are neither read nor written.
  SweepSums (*normal)(int num_batches, const SweepBatch<Number>* batches, Number momentum, SweepState<Number>* states,
                      SweepVelocity<Number>* velocities);
};

// Both sets of one width.
struct SweepKernelSet {
  const SweepKernels<double>* plain;
  const SweepKernels<float>* single;
};

// Those of the chosen width (build_facts.h).
SweepKernelSet BestSweepKernels();

// Those of that name; null pointers if this machine or build has none.
SweepKernelSet FindSweepKernels(const char* name);

}  // namespace islet::qp
