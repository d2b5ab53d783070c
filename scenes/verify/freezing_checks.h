// What the files of the family share: freezing_checks (T25, T26), freezing_supports (T27), freezing_piles (T44, and the pile of
// T27).
#pragma once

#include "engine/world.h"
#include "scenes/verify/check.h"

namespace islet::verify {

bool AllFrozen(const World& world);
void Settle(World* world, double seconds, double dt);  // steps until all bodies are frozen, for at most so long
double FastestPointOf(const Body& body);               // [m/s] bound

void MeasureSupport(const CheckSettings& settings, Measurements* out);     // T27
void MeasurePileImpact(const CheckSettings& settings, Measurements* out);  // T27
void MeasureRest(const CheckSettings& settings, Measurements* out);        // T44

}  // namespace islet::verify
