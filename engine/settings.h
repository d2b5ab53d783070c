// Every knob of the engine, with default, unit and reason. Validate() names the first bad field and its value.
#pragma once

#include <vector>

#include "engine/linear_algebra.h"
#include "qp/settings.h"

namespace islet {

using qp::Cone;
using qp::Effort;
using qp::Ladder;
using qp::Model;

// What a blow at one contact does.
enum class BounceLaw {
  kEq5,    // frictionless normal impulse, then friction opposite to the slip                     [SM04 Eq. 2, 5]
  kEq6,    // normal impulse that accounts for the friction's direction                           [SM04 Eq. 6]
  kExact,  // one-contact Coulomb: sticks if it can, else slides on the cone; never adds energy
};

// When bodies are frozen.
enum class Freezing {
  kOff,        // never
  kPaper,      // kinetic energy below Eq. 15 for more than freeze_count frames; wakes by collision only, not by forces or what is removed
  kCertified,  // frozen while a static-contact solution holds the body; design in engine/freezing/README.md
};

// Box along the world's axes.
struct Region {
  Vector3 lower, upper;  // [m] corners, W; lower <= upper
};

// Value of Settings::bounce_limit: chosen by islet.
inline constexpr int kAutoBounceLimit = -1;

struct Settings {
  // Behaviour
  Vector3 gravity{0, 0, -9.81};              // [m/s^2]
  Model model = Model::kCoulomb;             // law of the contact problems
  Cone cone = Cone::kCircular;               // of friction
  BounceLaw bounce_law = BounceLaw::kExact;  // of blows
  int bounce_limit = kAutoBounceLimit;       // c_b per island; auto: two a body; eq5, eq6: as in [SM04 Sec. 5.1]
  Freezing freezing = Freezing::kCertified;  // when bodies are frozen
  int freeze_count = 3;              // c_f of kPaper: frames                                     [SM04 Sec. 5.2]
  double freeze_seconds = 0.1;       // kCertified: how long a body must have stood still
  double freeze_travel = 1e-3;       // kCertified: farthest a point may have moved in that time, per body radius
  std::vector<Region> cold_volumes;  // kPaper: bodies freeze only inside one of these; none: everywhere

  // Accuracy
  // Of the contact problems. kCoulomb: natural map of the law over v_ref, rms over the contacts of an island, and ten times that at any.
  // Other models: a hundredth of it is the relative duality gap; velocities are good to about the root of that.
  double tolerance = 1e-6;
  Effort effort = qp::kNormalEffort;  // kCoulomb: cap on the work for an island that does not get there
  Ladder ladder;                      // ways to answer a problem more cheaply that may be used
  double touch_gap = 1e-3;            // contacts closer than this touch; per shape size
  double overlap_tolerance =
      2.5e-4;  // contacts closer than this are closed, and what a crowd's gaps may miss their end by; per shape size

  // Every step begins from poses and velocities alone: no impulse is remembered, and nothing freezes. Dearer, for what rests above all.
  bool stateless = false;

  // Performance
  int threads = 0;  // 0: all cores
  // Bodies that may meet in a step and are no more than this move by the law of the step (engine/motion/README.md), exact Coulomb
  // friction only. Larger groups are a crowd, which takes one piece a step. 0: all are.
  int group_bodies = 20;

  void Validate() const;    // throws std::invalid_argument
  static Settings Paper();  // kinetic, octagon, Eq. 5, paper freezing                       [SM04]
};

}  // namespace islet
