// What the files of the motion family share: scenes in which bodies are thin, long or fast for their step (T46 to T59).
#pragma once

#include "engine/world.h"
#include "scenes/verify/builders.h"
#include "scenes/verify/check.h"

namespace islet::verify {

void MeasureThinWalls(const CheckSettings& settings, Measurements* out);    // T46
void MeasureDice(const CheckSettings& settings, Measurements* out);         // T47
void MeasureCoins(const CheckSettings& settings, Measurements* out);        // T48
void MeasureTurningRod(const CheckSettings& settings, Measurements* out);   // T49
void MeasureThrownRods(const CheckSettings& settings, Measurements* out);   // T50
void MeasureCards(const CheckSettings& settings, Measurements* out);        // T51
void MeasureSlabs(const CheckSettings& settings, Measurements* out);        // T52
void MeasureElastic(const CheckSettings& settings, Measurements* out);      // T53
void MeasurePassing(const CheckSettings& settings, Measurements* out);      // T54
void MeasureBowling(const CheckSettings& settings, Measurements* out);      // T55
void MeasureFrames(const CheckSettings& settings, Measurements* out);       // T56
void MeasureClosedShell(const CheckSettings& settings, Measurements* out);  // T57
void MeasureBat(const CheckSettings& settings, Measurements* out);          // T58
void MeasureFastCrowd(const CheckSettings& settings, Measurements* out);    // T59

// Steps worlds and keeps the worst of what every one of these scenes must obey: energy that no wall brings never rises, and the
// ledger, which neither solver nor motion writes, is clean.
struct Watch {
  double rise = 0;  // [of the energy at the start]
  int failed = 0;   // steps that the ledger calls failed
  // scale: [J] what `rise` is of
  void Step(World* world, double dt, double scale);
  void Report(const std::string& of, Measurements* out) const;
};

}  // namespace islet::verify
