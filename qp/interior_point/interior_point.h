// Primal-dual interior-point method for one island: Nesterov-Todd scaling, Mehrotra's predictor-corrector.
//
//   find v, z:  M (v - v0) = J^T j,  s = T (J v + drift + (slip - target) n + compliance j),  j = T^T z,  s o z = 0
//   with s, z in the product of the contacts' self-dual cones (cone.h). For the kinetic model with bounce targets a
//   second unknown p and a second row per contact appear (kkt.h).
//
// Works in units of its own: velocity in settings.velocity_scale, mass in the mean mass. Cold start.
//   threads: one caller at a time, idle workers help with its loops; allocates only while problems grow
#pragma once

#include <span>
#include <vector>

#include "parallel/fork.h"
#include "qp/cone.h"
#include "qp/interior_point/row_batches.h"
#include "qp/linear_algebra/kkt.h"
#include "qp/problem.h"
#include "qp/settings.h"
#include "qp/solution.h"

namespace islet::qp {

class InteriorPoint {
 public:
  // slips: one number per contact added to the normal row (De Saxce), or empty for none. Solves the convex problem of
  // settings.cone, or the kinetic one if settings.model says so. `solution` keeps its memory.
  void Solve(const Problem& problem, const Settings& settings, std::span<const double> slips, Solution* solution);

 private:
  // What one contact contributes: its cone, the constant part of its velocity, and where its rows are.
  struct Rows {
    int contact;
    int field;  // whose velocity it constrains
    ContactCone cone;
    Vector3 offset;
    double compliance;
    RowPlace place;
    double rho = 0;  // of the natural map, 3 / tr W
  };
  struct Residuals {
    double gap, primal, dual;
  };
  struct Direction {
    std::vector<Lanes> target, ds, dz, plain, constants;
    std::vector<double> dy;
    double bound = 0;  // 1 / the longest step, 0 if it has no end
    RowDirection View() { return {target.data(), ds.data(), dz.data(), plain.data(), constants.data()}; }
  };

  void Load(const Problem& problem, const Settings& settings, std::span<const double> slips);
  void AddRows(const Rows& rows);
  void PlaceRows();
  void ChooseStart();
  Residuals ComputeResiduals();
  double LeastEnergy();
  bool HasNaturalMap() const;
  double NaturalMap() const;
  bool UpdateScalings();
  // Direction for its targets, residuals weighted by `weight`. Reads primal_, dual_ and the factors.
  void ComputeDirection(double weight, bool refine, Direction* direction);
  void Correct(Direction* direction);
  double DirectionError(double weight, Direction* direction);
  template <typename Run>
  double WorstBound(const Run& run);
  double MassNorm(const std::vector<double>& momentum) const;
  void AimAt(double goal);
  bool ImproveCentrality(double weight, double aim, bool refine, double* step);
  void Advance(double step);
  Status Iterate(const Settings& settings, Solution* solution);
  void Extract(const Problem& problem, double velocity_scale, std::span<const double> slips, Solution* solution);
  // run(first, last) over the batches, side by side.
  template <typename Run>
  void ForBatches(const Run& run) {
    parallel::ForkRanges(static_cast<int>(batches_.size()), run);
  }
  RowArrays Arrays();

  Problem scaled_;
  KktSystem kkt_;
  const RowKernels* kernels_ = &BestRowKernels();
  RowBatches batches_;
  std::vector<Rows> rows_;
  int degree_ = 0;
  double mean_mass_ = 1, energy_scale_ = 1, energy_limit_ = 0;
  std::vector<double> y_;                                // unknowns, and two numbers to spare
  std::vector<Lanes> s_, z_, point_, inverse_, lambda_;  // per row
  std::vector<Lanes> primal_;                            // s - A y - c
  std::vector<double> dual_;                             // stationarity
  Direction direction_, trial_;
  std::vector<Lanes> best_z_;
  std::vector<double> best_y_;
  std::vector<double> error_;          // of the direction, in the momentum balance
  std::vector<double> gathered_;       // sum of the forces on each body, field by field
  std::vector<Lanes> forces_;          // three a batch
  std::vector<double> partial_;        // per range of batches
  double refine_to_ = 0;               // error of a direction that is small enough
  std::vector<Lanes> softening_;       // (I + D R)^-1, nine a batch; unused where R = 0
  std::vector<Lanes> scaling_blocks_;  // D, nine a batch
  std::vector<Matrix3> blocks_;        // D per contact
  std::vector<double> normal_blocks_;  // E per contact
};

}  // namespace islet::qp
