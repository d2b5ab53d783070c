// The checks of the family "rolling" that live in files of their own: blocks and seams.
#pragma once

#include "scenes/verify/check.h"

namespace islet::verify {

void MeasureBalancedCube(const CheckSettings& settings, Measurements* out);   // T20
void MeasureRockingBlock(const CheckSettings& settings, Measurements* out);   // T21
void MeasureSpinningBlock(const CheckSettings& settings, Measurements* out);  // T29
void MeasureSeams(const CheckSettings& settings, Measurements* out);          // T30

}  // namespace islet::verify
