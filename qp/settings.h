// What an island solve may be asked for.
#pragma once

#include <limits>

#include "qp/effort.h"
#include "qp/ladder.h"

namespace islet::qp {

// The law between impulses and velocities of contacts.
enum class Model {
  kKinetic,  // least kinetic energy, u_n >= b as an inequality                          [SM04 Eq. 9, 13, 14]
  kConvex,   // cone complementarity: K in j, perpendicular to u - b n in K*             [AP97]
  kCoulomb,  // exact Signorini-Coulomb-Newton: K in j, perpendicular to u - b n + mu |u_t| n in K*   [DS91]
};

// The friction cone K.
enum class Cone {
  kCircular,  // |j_t| <= mu j_n
  kOctagon,   // the eight-sided pyramid inscribed in it                                 [SM04 Eq. 8]
};

struct Settings {
  Model model = Model::kCoulomb;  // the law
  Cone cone = Cone::kCircular;    // of friction
  Effort effort = kNormalEffort;  // of exact Coulomb friction
  // Exact Coulomb: natural map over v_ref, as by NaturalMap::Meets. Other models: see gap_tolerance.
  double tolerance = 1e-6;
  // Small islands by exact Coulomb that move need be no more exact than this share of the speed that their contacts are left with; where
  // they have more than eight bodies, than sweeps. What comes to rest is as exact as iterations get. 0: so is all.
  double speed_share = 0;
  double aim = 0;             // of the gap over 1/2 m v_ref^2; if below its tolerance: iterate on while that helps
  Ladder ladder;              // rungs that may be used
  double velocity_scale = 1;  // [m/s] v_ref, > 0; what the tolerances are relative to
  // [J] an answer with more kinetic energy would be of no use: once the multipliers prove that every feasible velocity has
  // more, the solve stops as infeasible. Infinity: a million times the energy at hand.
  double energy_limit = std::numeric_limits<double>::infinity();

  // Relative duality gap of interior points. Its root bounds the error of the velocities: a hundredth of the tolerance is the cheap
  // middle between the tolerance and its square.
  double gap_tolerance() const { return 1e-2 * tolerance; }
};

}  // namespace islet::qp
