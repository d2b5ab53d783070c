// Projected block Gauss-Seidel for exact Coulomb friction: visits the contacts in a fixed order and solves each exactly
// with the others held. Cheap per sweep and good at local stick-slip, slow to carry loads across a pile. Here it polishes
// what the interior point left, and finds the slips of the next round.                                     [JAJ98]
//
// Contacts are visited eight at a time (sweep_kernels) in an order that depends on the contact graph alone
// (sweep_order); large islands are swept in parts by the idle workers of the pool. Same bits for any number of threads.
//
//   threads: one caller at a time; allocates only while problems grow
#pragma once

#include <vector>

#include "qp/one_contact.h"
#include "qp/problem.h"
#include "qp/sweep_kernels.h"
#include "qp/sweep_order.h"

namespace islet::qp {

enum class Pace {
  kPlain,     // stays near where it starts, which is what a polish of an answer wants
  kMomentum,  // impulses go on for a while in the direction in which they moved: loads are carried several times faster
              // [Nes83]; a sweep that is led astray starts anew from rest
};

class GaussSeidel {
 public:
  // kernels: the best of this machine unless told otherwise.
  explicit GaussSeidel(const SweepKernels& kernels = BestSweepKernels()) : kernels_(&kernels) {}

  void Prepare(const Problem& problem);

  // Sweeps the problem of the last Prepare until the largest change of a contact's impulse times its W_nn falls below
  // `tolerance` [velocity], at most `max_sweeps` times. impulses and velocities must satisfy M (v - v0) = J^T j before, and
  // do so after. Returns the number of sweeps.
  int Sweep(const Problem& problem, int max_sweeps, double tolerance, std::vector<Vector3>* impulses,
            std::vector<double>* velocities, Pace pace = Pace::kPlain);

 private:
  struct BodyRoot {  // G = diag(mass_root I, inertia_root), M^-1 = G G^T
    double mass_root;
    Matrix3 inertia_root;
  };
  struct Axes {  // of the tangential operator: angle to the problem's tangents
    double cosine, sine;
  };
  void PrepareBatch(const Problem& problem, int number, int still);
  void PrepareContact(const Problem& problem, int number, int lane, SweepBatch* batch);
  void Load(const Problem& problem, const std::vector<Vector3>& impulses, const std::vector<double>& velocities);
  void Unload(std::vector<Vector3>* impulses, std::vector<double>* velocities) const;
  SweepSums SweepOnce(double momentum);
  void Extrapolate(double momentum);

  const SweepKernels* kernels_;
  SweepOrder order_;
  bool compliant_ = false;
  std::vector<BodyRoot> roots_;
  std::vector<Axes> axes_;
  std::vector<SweepBatch> batches_;
  std::vector<SweepState> states_;
  std::vector<SweepVelocity> velocities_;  // bodies, then an immovable one per section
  std::vector<SweepVelocity> previous_;    // the same, one sweep before
  std::vector<SweepSums> sums_;            // per section
};

}  // namespace islet::qp
