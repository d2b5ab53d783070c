// Projected block Gauss-Seidel for exact Coulomb friction: visits the contacts in a fixed order and solves each exactly
// with the others held. Cheap per sweep and good at local stick-slip, slow to carry loads across a pile.           [JAJ98]
//
// Contacts are visited eight at a time (sweep_kernels) in an order that depends on the contact graph alone
// (sweep_order); large islands are swept in parts by the idle workers of the pool. Same bits for any number of threads.
//
//   threads: one caller at a time; allocates only while problems grow
#pragma once

#include <vector>

#include "qp/gauss_seidel/sweep_kernels.h"
#include "qp/gauss_seidel/sweep_order.h"
#include "qp/problem.h"

namespace islet::qp {

enum class Pace {
  kPlain,     // stays near where it starts, which is what a polish of an answer wants
  kMomentum,  // impulses go on for a while in the direction in which they moved: loads are carried several times faster
              // [Nes83]; a sweep that is led astray starts anew from rest
};

// Of the sweeps alone: what goes in and what is returned is double.
enum class Precision { kDouble, kSingle };

class GaussSeidel {
 public:
  // kernels: the best of this machine unless told otherwise.
  explicit GaussSeidel(SweepKernelSet kernels = BestSweepKernels()) {
    plain_.kernels = kernels.plain;
    single_.kernels = kernels.single;
  }

  void Prepare(const Problem& problem);

  // Sweeps the problem of the last Prepare until the largest change of a contact's impulse times its W_nn falls below
  // `tolerance` [velocity], at most `max_sweeps` times. impulses and velocities must satisfy M (v - v0) = J^T j before, and
  // do so after. Returns the number of sweeps. In single precision a sweep takes half to two thirds of the time, and rounding leaves
  // a natural map of 1e-5 to 1e-4 of v_ref, however fast all travel together; what is returned satisfies cones and momentum as well as in double.
  int Sweep(const Problem& problem, int max_sweeps, double tolerance, std::vector<Vector3>* impulses,
            std::vector<double>* velocities, Pace pace = Pace::kPlain, Precision precision = Precision::kDouble);

 private:
  struct BodyRoot {  // G = diag(mass_root I, inertia_root), M^-1 = G G^T
    double mass_root;
    Matrix3 inertia_root;
  };
  struct Axes {  // of the tangential operator: angle to the problem's tangents
    double cosine, sine;
  };
  // What the kernels work on.
  template <typename Number>
  struct Field {
    const SweepKernels<Number>* kernels = nullptr;
    std::vector<SweepBatch<Number>> batches;
    std::vector<SweepState<Number>> states;
    std::vector<SweepVelocity<Number>> velocities;  // bodies in their places, then an immovable one per section
    std::vector<SweepVelocity<Number>> previous;    // of the bodies, one sweep before
  };
  void PrepareBatch(const Problem& problem, int number, int still);
  void PrepareContact(const Problem& problem, int number, int lane, SweepBatch<double>* batch);
  void PrepareNormal(const Problem& problem, int number, int lane, SweepBatch<double>* batch);
  static Vector3 CommonVelocity(const Problem& problem, const std::vector<double>& velocities);
  void PrepareSingle(const Problem& problem);
  template <typename Run>
  void ForkBatches(const Run& run) const;
  template <typename Number>
  void MakeRoom(Field<Number>* field) const;
  template <typename Number>
  int SweepIn(Field<Number>* field, const Problem& problem, int max_sweeps, double tolerance,
              std::vector<Vector3>* impulses, std::vector<double>* velocities, Pace pace);
  template <typename Number>
  void Load(const Problem& problem, const std::vector<Vector3>& impulses, const std::vector<double>& velocities,
            Field<Number>* field) const;
  template <typename Number>
  void Unload(const Field<Number>& field, std::vector<Vector3>* impulses, std::vector<double>* velocities) const;
  template <typename Number>
  void LoadBatch(const std::vector<Vector3>& impulses, int number, SweepState<Number>* state) const;
  template <typename Number>
  void UnloadBatch(const SweepState<Number>& state, int number, std::vector<Vector3>* impulses) const;
  template <typename Number>
  SweepSums SweepOnce(bool ahead, Number momentum, Field<Number>* field);

  SweepOrder order_;
  bool compliant_ = false;
  bool normal_ = false;              // no contact has friction or compliance
  Vector3 frame_ = Vector3::Zero();  // [m/s] in which single precision sweeps
  bool single_prepared_ = false;     // for the problem of the last Prepare
  std::vector<BodyRoot> roots_;
  std::vector<Axes> axes_;
  Field<double> plain_;
  Field<float> single_;
  std::vector<SweepSums> sums_;  // per section
};

}  // namespace islet::qp
