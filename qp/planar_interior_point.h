// The interior point (interior_point.h) for a problem in the plane (planar_problem.h), where the friction cone has two sides:
// the dual cone is u_n + mu u_t >= 0 and u_n - mu u_t >= 0, two ordinary inequalities a contact, and all impulses inside the
// cone are z_1 (1, mu) + z_2 (1, -mu) with z >= 0. So this is a quadratic programme with nothing curved in it:
//
//   find v, z:  M (v - v0) = G^T z,  s = G v + c + R z,  s z = 0,  s, z >= 0
//
// Mehrotra's predictor-corrector, three unknowns a body, the same units, tolerances and statuses as there. Cold start.
//   threads: one caller at a time, idle workers help to factorise; allocates only while problems grow
#pragma once

#include <array>
#include <span>
#include <vector>

#include "qp/planar_problem.h"
#include "qp/planar_system.h"
#include "qp/problem.h"
#include "qp/settings.h"
#include "qp/solution.h"

namespace islet::qp {

class PlanarInteriorPoint {
 public:
  // As InteriorPoint::Solve, the convex model alone, without compliance. weights: what each contact stands for in space; of
  // all impulses that hold, those are found that the interior point would find there.
  void Solve(const Problem& problem, std::span<const PlanarWeight> weights, const Settings& settings,
             std::span<const double> slips, Solution* solution, std::span<const Vector3> near = {});

 private:
  using Sides = std::array<double, 2>;  // of a friction cone: rows (1, mu) and (1, -mu)
  using Flat = std::array<double, 3>;   // x, y, spin
  struct Contact {
    int a, b;
    Flat normal_a, tangent_a, normal_b, tangent_b;
    double friction;
    double offset_n, offset_t;
    double softness;  // u_n gives way by this times j_n
    double size;      // weight of its complementarity
    double response;  // W_nn in space
  };
  struct Residuals {
    double gap, primal, dual;
  };

  void Load(const Problem& problem, std::span<const PlanarWeight> weights, const Settings& settings,
            std::span<const double> slips, std::span<const Vector3> near);
  void ChooseStart();
  Status Iterate(const Settings& settings, Solution* solution);
  void Extract(const Problem& problem, double velocity_scale, std::span<const double> slips,
               std::span<const Vector3> near, Solution* solution);
  Sides Velocity(const Contact& contact, const std::vector<Flat>& v) const;  // G v
  static void AddForce(const Contact& contact, const Sides& z, double sign, std::vector<Flat>* force);
  Residuals ComputeResiduals();
  double MassNorm(const std::vector<Flat>& momentum) const;
  double LeastEnergy();
  void Factorise();
  void ComputeDirection(double weight);
  void CompleteDirection(double weight);
  double LongestStep(double limit) const;

  PlanarSystem system_;
  std::vector<Flat> masses_, free_;  // per body: diagonal of M, v0
  std::vector<Contact> contacts_;
  double mean_mass_ = 1, mass_ = 0, energy_scale_ = 1, energy_limit_ = 0;
  double refine_to_ = 0;
  std::vector<Flat> v_, dual_, dv_, error_;  // per body
  std::vector<Sides> s_, z_, primal_, target_, ds_, dz_, g_, best_z_;
  std::vector<std::array<double, 3>> d_;  // (diag(s/z) + R)^-1: 11, 12, 22
  std::vector<Matrix3> blocks_;           // the same in normal and tangent
  std::vector<double> softness_;          // in the caller's units
};

}  // namespace islet::qp
