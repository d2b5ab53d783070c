#include "scenes/verify/motion_family.h"

#include <algorithm>
#include <cmath>

namespace islet {
namespace verify {

void Watch::Step(World* world, double dt, double scale) {
  const double before = Energy(*world);
  failed += world->Step(dt).Failed();
  rise = std::max(rise, (Energy(*world) - before) / scale);
}

void Watch::Report(const std::string& of, Measurements* out) const {
  out->AtMost(of + ": rise of energy in a step", "of the start's", rise, 1e-6);
  out->Absolute(of + ": steps that the ledger calls failed", "", 0, failed, 0);
}

}  // namespace verify

std::span<const Check> MotionChecks() {
  using namespace verify;
  static constexpr Check kChecks[] = {
      {"T46", "spinning and rolling balls at thin walls and posts", Gate::kGate,
       "none passes; rebounds with e times its speed, whenever in the step it hits", MeasureThinWalls},
      {"T47", "dice on thin plates, fixed, kinematic and dynamic", Gate::kGate, "none passes", MeasureDice},
      {"T48", "fast coins at a thin plate on four balls", Gate::kGate, "none passes", MeasureCoins},
      {"T49", "rod that spins over a plate", Gate::kGate, "neither end passes; energy never rises", MeasureTurningRod},
      {"T50", "thrown rods, cards and wires, aspect 10 to 1000", Gate::kGate, "energy never rises, at rest in the end",
       MeasureThrownRods},
      {"T51", "a heap of cards", Gate::kGate, "at rest after 4 s", MeasureCards},
      {"T52", "bounces on slabs", Gate::kGate, "e^(2 n) h0, whatever the slab is", MeasureSlabs},
      {"T53", "a hundred bounces with e = 1", Gate::kGate, "energy stays", MeasureElastic},
      {"T54", "boxes that spin past each other", Gate::kGate, "no velocity changes without a contact", MeasurePassing},
      {"T55", "bowling", Gate::kGate, "pins fall in every throw; nothing passes", MeasureBowling},
      {"T56", "moving and turned frames of reference", Gate::kGate, "the same motion", MeasureFrames},
      {"T57", "in a closed shell", Gate::kGate, "none escapes; e = 1 keeps the energy", MeasureClosedShell},
      {"T58", "a bat", Gate::kGate, "a ball leaves it at (1 + e) w r", MeasureBat},
      {"T59", "a fast crowd in a thin box", Gate::kGate, "none escapes; energy never rises", MeasureFastCrowd},
  };
  return kChecks;
}

}  // namespace islet
