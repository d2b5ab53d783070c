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

#include "qp/cone.h"
#include "qp/incidence.h"
#include "qp/kkt.h"
#include "qp/problem.h"
#include "qp/settings.h"
#include "qp/solution.h"

namespace islet::qp {

class InteriorPoint {
 public:
  // slips: one number per contact added to the normal row (De Saxce), or empty for none. Solves the convex problem of
  // settings.cone, or the kinetic one if settings.model says so. `solution` keeps its memory.
  // near: impulses, or empty. The slips then give way a little, in proportion to how far the normal impulses end up from
  // these (a proximal step): of all impulses that hold, those near by are chosen, and slips that contradict each other in
  // a jam do no harm. The solution's slips are those that its answer satisfies.
  void Solve(const Problem& problem, const Settings& settings, std::span<const double> slips, Solution* solution,
             std::span<const Vector3> near = {});

 private:
  // What one contact contributes: first row in s_ and z_, its cone, and the constant part of its velocity.
  struct Rows {
    int first;
    int contact;
    int field;    // whose velocity it constrains
    double sign;  // +1, or -1 where the rows enter the matrix negatively (kinetic cone rows)
    ContactCone cone;
    Vector3 offset;
    double compliance, softness;  // R = compliance I + softness n n^T
    bool IsSoft() const { return compliance > 0 || softness > 0; }
    Vector3 Yield(const Vector3& j) const { return compliance * j + Vector3(softness * j[0], 0, 0); }  // R j
  };
  struct Residuals {
    double gap, primal, dual;
  };

  void Load(const Problem& problem, const Settings& settings, std::span<const double> slips,
            std::span<const Vector3> near);
  void ChooseStart();
  Residuals ComputeResiduals();
  double LeastEnergy();
  bool UpdateScalings();
  void FactoriseNewton();
  // Direction for the complementarity targets in target_ (scaled space), residuals weighted by `weight`.
  void ComputeDirection(double weight, bool refine);  // reads primal_, dual_ and the factors
  void CompleteDirection(double weight);
  void Correct();
  double DirectionError(double weight);
  double MassNorm(const std::vector<double>& momentum) const;
  double LongestStep(double limit);
  void AimAt(double goal, double share);
  bool ImproveCentrality(double weight, double aim, double* step);
  void Advance(double step);
  Status Iterate(const Settings& settings, Solution* solution);
  void Extract(const Problem& problem, double velocity_scale, std::span<const double> slips,
               std::span<const Vector3> near, Solution* solution);

  Scaling ScalingOf(size_t r) { return {point_.data() + rows_[r].first, lambda_.data() + rows_[r].first, eta_[r]}; }

  Problem scaled_;
  Incidence incidence_;
  KktSystem kkt_;
  std::vector<Rows> rows_;
  int num_rows_ = 0, degree_ = 0;
  double mean_mass_ = 1, energy_scale_ = 1, energy_limit_ = 0;
  std::vector<double> y_;                       // unknowns
  std::vector<double> s_, z_, point_, lambda_;  // per row
  std::vector<double> eta_;                     // per Rows
  std::vector<double> primal_, dual_;           // residuals: s - A y - c; stationarity
  std::vector<double> target_, ds_, dz_, dy_;   // direction; target, ds and dz in scaled space
  std::vector<double> ds_plain_;                // not scaled
  std::vector<double> saved_target_, saved_ds_, saved_dz_, saved_dy_, saved_plain_, best_z_, best_y_;
  std::vector<double> error_;       // of the direction, in the momentum balance
  std::vector<Vector3> constants_;  // per Rows: part of dj that dy does not change
  std::vector<Vector3> forces_;     // per field and contact
  std::vector<double> partial_;     // per range of rows
  bool refine_ = false;
  double refine_to_ = 0;               // error of a direction that is small enough
  std::vector<double> softness_;       // per contact, in the caller's units: what its slip gives way per impulse
  std::vector<Matrix3> softening_;     // (I + D R)^-1 per Rows; unused where R = 0
  std::vector<Matrix3> blocks_;        // D per contact
  std::vector<double> normal_blocks_;  // E per contact
};

}  // namespace islet::qp
