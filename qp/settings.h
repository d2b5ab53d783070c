// What an island solve may be asked for.
#pragma once

#include <limits>

#include "qp/effort.h"
#include "qp/ladder.h"

namespace islet::qp {

enum class Model {
  kKinetic,  // least kinetic energy, u_n >= b as an inequality                          [SM04 Eq. 9, 13, 14]
  kConvex,   // cone complementarity: K in j, perpendicular to u - b n in K*             [AP97]
  kCoulomb,  // exact Signorini-Coulomb-Newton: K in j, perpendicular to u - b n + mu |u_t| n in K*   [DS91]
};

enum class Cone {
  kCircular,  // |j_t| <= mu j_n
  kOctagon,   // the eight-sided pyramid inscribed in it                                 [SM04 Eq. 8]
};

struct Settings {
  Model model = Model::kCoulomb;
  Cone cone = Cone::kCircular;
  Effort effort = kNormalEffort;  // of exact Coulomb friction on the circular cone
  double tolerance = 1e-8;   // relative duality gap; dual violation over the velocity scale
  double aim = 0;            // of gap over 1/2 m v_ref^2; if below the tolerance: iterate on while that helps
  int max_iterations = 100;  // of one interior-point solve
  int coulomb_rounds = 3;    // octagon, where Newton's method fails, or no sweeps: cap on re-solves with lagged slip
  // Exact Coulomb in rounds: factorisations after which no further one begins.
  int patience = std::numeric_limits<int>::max();
  // Of exact Coulomb: natural map (rms) over the velocity scale that sweeps aim at; relative gap at which they are the answer.
  double coulomb_tolerance = 1e-6;
  Ladder ladder;              // rungs that may be used
  double velocity_scale = 1;  // [m/s] v_ref, > 0; what the tolerances are relative to
  // [J] an answer with more kinetic energy would be of no use: once the multipliers prove that every feasible velocity has
  // more, the solve stops as infeasible. Infinity: a million times the energy at hand.
  double energy_limit = std::numeric_limits<double>::infinity();
};

}  // namespace islet::qp
