#include "scenes/verify/check.h"
#include "scenes/verify/structure_measures.h"

namespace islet {
namespace {

constexpr Check kChecks[] = {
    {"T17", "masonry arch", Gate::kChart,
     "a semicircle of n wedges stands if a line of thrust fits into it (limit analysis, a linear program solved here)",
     verify::MeasureArch},
    {"T22", "Painleve's rod", Gate::kGate,
     "above mu = (1 + 3 cos^2)/(3 sin cos) the tip stops at once: impulse -W^-1 q; below it slides on",
     verify::MeasureRod},
    {"T24", "walls that close on a cube", Gate::kGate,
     "no solution: reported in every step, state finite, usable after", verify::MeasureSqueeze},
    {"T37", "row of dominoes", Gate::kStatistics,
     "steady speed from energy between hits and angular momentum in them (van Leeuwen 2010, smooth faces, rough feet)",
     verify::MeasureDominoes},
    {"T39", "heap of cubes", Gate::kStatistics, "the slope does not depend on the time step; the heap does not creep",
     verify::MeasureHeap},
};

}  // namespace

std::span<const Check> StructureChecks() { return kChecks; }

}  // namespace islet
