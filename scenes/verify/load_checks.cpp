#include "scenes/verify/check.h"
#include "scenes/verify/load_measures.h"

namespace islet {
namespace {

constexpr Check kChecks[] = {
    {"T14", "column of cubes", Gate::kGate, "contact k carries all that is above it, (N - k + 1) m g; nothing moves",
     verify::MeasureColumn},
    {"T15", "heavy on light", Gate::kGate, "contact k carries all that is above it, up to 1 : 1e6; nothing moves",
     verify::MeasureHeavyOnLight},
    {"T16", "a cube of 1e4 kg in a pyramid of 1 kg cubes", Gate::kChart,
     "the floor carries the weight; nothing overlaps, nothing moves", verify::MeasureHeavyInPile},
    {"T28", "table on 3 to 100 legs", Gate::kGate,
     "sum of loads m g, sum of moments 0; three loads follow from statics; by symmetry m g / n", verify::MeasureTables},
    {"T40", "silo", Gate::kStatistics,
     "base + walls carry the weight; the base alone carries what Janssen's law leaves it", verify::MeasureSilo},
    {"T41", "hourglass on a scale", Gate::kGate,
     "mean force on the container = weight of the pieces, over a time from rest to rest (momentum balance)",
     verify::MeasureWeighedGlass},
};

}  // namespace

std::span<const Check> LoadChecks() { return kChecks; }

}  // namespace islet
