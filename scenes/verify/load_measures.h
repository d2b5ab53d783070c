// The checks of the family "loads", one function each; load_checks.cpp lists them.
#pragma once

#include "scenes/verify/check.h"

namespace islet::verify {

void MeasureColumn(const CheckSettings& settings, Measurements* out);        // T14
void MeasureHeavyOnLight(const CheckSettings& settings, Measurements* out);  // T15
void MeasureHeavyInPile(const CheckSettings& settings, Measurements* out);   // T16
void MeasureTables(const CheckSettings& settings, Measurements* out);        // T28
void MeasureSilo(const CheckSettings& settings, Measurements* out);          // T40
void MeasureWeighedGlass(const CheckSettings& settings, Measurements* out);  // T41

}  // namespace islet::verify
