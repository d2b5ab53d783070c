// Exact Coulomb friction by proximal steps, each solved by semismooth Newton's method: the finisher of sweeps.   [Roc76, AC91]
//
//   one step, from impulses j':  j_c = L(j'_c - t rho_c (u_c - b_c n)),  M (v - v0) = J^T j,  u = J v (+ R j)
//
// L is the law of a contact on a spring of stiffness t rho: x_n cut at 0, then x_t cut at the disc of radius mu x_n. The answer
// of a step is the next j'; where impulses stay what they were, they are exact, and t decides about nothing but the pace.
//
//   Newton's matrix   M + J^T G J,  G = t rho L' of each contact, which is not symmetric where a contact slides. GMRES solves it,
//                     with the Cholesky factor of the same matrix without the normal-tangent coupling of sliding contacts
//   redundant contacts do no harm, since the unknown is v; what is larger than the law asks for is not sought, since every step
//                     starts from the impulses at hand
//
//   threads: one caller at a time, idle workers help with the factorisation; allocates only while problems grow
#pragma once

#include <vector>

#include "qp/linear_algebra/kkt.h"
#include "qp/natural_map.h"
#include "qp/problem.h"

namespace islet::qp {

class CoulombNewton {
 public:
  // What the natural map of every contact shall be below: `enough`, and that share of the speed that the contacts are left with, or
  // what rests would creep; no less than `least`.
  struct Aim {
    double enough, least;  // [velocity]
    double of_speed = 0;
  };
  // Improves impulses until they meet the aim, the factorisations are used up, or nothing gains any more; below `enough` it goes on
  // only as long as every few steps halve the map. impulses are the best that it met. rho: as by ImpulseScales. Returns their map.
  NaturalMap Solve(const Problem& problem, const std::vector<double>& rho, const Aim& aim, int max_factorisations,
                   std::vector<Vector3>* impulses);
  // Whether contacts move slower than that [velocity] on springs that begin relaxed, once these are stiff enough: what stands without having
  // been squeezed before.
  bool StandsOnSprings(const Problem& problem, const std::vector<double>& rho, double slow, int max_factorisations);

  int factorisations() const { return factorisations_; }  // of the last call

 private:
  void Prepare(const Problem& problem, const std::vector<double>& rho);
  double Residual();
  double Speed() const;
  bool Step(double aim, int most);
  void FindDirection();
  void Multiply(const std::vector<double>& b, const std::vector<double>& x, std::vector<double>* out) const;
  double Dot(const std::vector<double>& p, const std::vector<double>& q) const;

  const Problem* problem_ = nullptr;  // during Solve
  const std::vector<double>* rho_ = nullptr;
  KktSystem system_;
  int factorisations_ = 0;
  bool refines_ = false;  // the map is below `enough`
  double stiffness_ = 1, total_mass_ = 0;
  std::vector<Vector3> centre_, pulls_, impulses_;  // j', x, j
  std::vector<Matrix3> slopes_, plain_slopes_;      // G, and without its coupling
  std::vector<double> v_, from_, residual_, direction_, weights_;
  std::vector<std::vector<double>> basis_, steps_;  // of GMRES: residuals, and what the factor makes of them
};

}  // namespace islet::qp
