// What the settings of the engine are called on the command line, in reports and in scene files.
#pragma once

#include <array>
#include <utility>

#include "engine/settings.h"

namespace islet {

inline constexpr std::array<std::pair<const char*, Model>, 3> kModels{
    {{"kinetic", Model::kKinetic}, {"convex", Model::kConvex}, {"coulomb", Model::kCoulomb}}};
inline constexpr std::array<std::pair<const char*, Cone>, 2> kCones{
    {{"circular", Cone::kCircular}, {"octagon", Cone::kOctagon}}};
inline constexpr std::array<std::pair<const char*, BounceLaw>, 3> kBounceLaws{
    {{"eq5", BounceLaw::kEq5}, {"eq6", BounceLaw::kEq6}, {"exact", BounceLaw::kExact}}};
inline constexpr std::array<std::pair<const char*, Freezing>, 3> kFreezings{
    {{"off", Freezing::kOff}, {"paper", Freezing::kPaper}, {"certified", Freezing::kCertified}}};
inline constexpr std::array<std::pair<const char*, Effort>, 3> kEfforts{
    {{"quick", qp::kQuickEffort}, {"normal", qp::kNormalEffort}, {"thorough", qp::kThoroughEffort}}};

}  // namespace islet
