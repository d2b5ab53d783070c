// The checks of the family "structures", one function each; structure_checks.cpp lists them.
#pragma once

#include "scenes/verify/check.h"

namespace islet::verify {

void MeasureArch(const CheckSettings& settings, Measurements* out);      // T17
void MeasureRod(const CheckSettings& settings, Measurements* out);       // T22
void MeasureSqueeze(const CheckSettings& settings, Measurements* out);   // T24
void MeasureDominoes(const CheckSettings& settings, Measurements* out);  // T37
void MeasureHeap(const CheckSettings& settings, Measurements* out);      // T39

}  // namespace islet::verify
