// The inner loop of the Gauss-Seidel sweeps: batches of eight contacts, one in each lane of wide vectors. Compiled for
// several vector widths; the widest that the machine has is chosen once, at run time.
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
struct alignas(64) SweepBatch {
  double rows[2][3][6][kBatchLanes];  // T^T J G of side a and b: [side][direction][component of y][lane]
  double offset[3][kBatchLanes];      // T^T (drift - target n)
  // j_1 = tangent_1 x_1, j_2 = tangent_2 x_2, j_n = normal x_n + shear_1 j_1 + shear_2 j_2: the matrix T
  double normal[kBatchLanes], tangent[2][kBatchLanes], shear[2][kBatchLanes];
  double friction[kBatchLanes];
  double weight[kBatchLanes];  // W_nn: makes a velocity of an impulse, for the stopping test
  double compliance[kBatchLanes];
  int body[2][kBatchLanes];  // places in the array of velocities
};

struct alignas(64) SweepState {
  double x[3][kBatchLanes];         // after the last sweep
  double previous[3][kBatchLanes];  // after the one before
  double lambda[kBatchLanes];       // of a contact that slides, u_t = -lambda j_t; else 0
};

struct alignas(64) SweepVelocity {
  double y[8];  // six numbers; the last two stay zero
};

struct SweepSums {
  double largest = 0;  // change of an impulse times its weight [velocity]
  double change = 0;   // |x - z|^2
  double ahead = 0;    // (x - z) . (x - previous): negative where momentum led astray
};

struct SweepKernels {
  const char* name;
  // One sweep over the batches from z = x + momentum (x - previous); velocities must be those of z, and are those of the new
  // x then. compliant: some contact has compliance.
  SweepSums (*coulomb)(int num_batches, const SweepBatch* batches, bool compliant, double momentum, SweepState* states,
                       SweepVelocity* velocities);
};

// The widest set that this machine can run. ISLET_KERNELS=sse2|avx2|avx512 in the environment chooses a narrower one.
const SweepKernels& BestSweepKernels();

// The set of that name, or null if this machine or build has none.
const SweepKernels* FindSweepKernels(const char* name);

}  // namespace islet::qp
