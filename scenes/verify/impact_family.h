// What the files of the impact family share: the measurements behind T10 to T13, T31 and T32.
#pragma once

#include "engine/world.h"
#include "scenes/verify/check.h"

namespace islet::verify {

void MeasureBouncingBall(const CheckSettings& settings, Measurements* out);   // T10
void MeasureBouncingCube(const CheckSettings& settings, Measurements* out);   // T11
void MeasureCradle(const CheckSettings& settings, Measurements* out);         // T12
void MeasureSymmetricHit(const CheckSettings& settings, Measurements* out);   // T13
void MeasureCloud(const CheckSettings& settings, Measurements* out);          // T31
void MeasureSphereLattice(const CheckSettings& settings, Measurements* out);  // T32

inline Settings Weightless(Settings engine) {
  engine.gravity.setZero();
  return engine;
}

}  // namespace islet::verify
