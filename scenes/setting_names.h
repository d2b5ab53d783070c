// What settings of the engine and kinds of bodies are called on the command line, in reports and in files.
#pragma once

#include <array>
#include <cstddef>
#include <optional>
#include <string_view>
#include <utility>

#include "engine/body.h"
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
inline constexpr std::array<std::pair<const char*, BodyKind>, 3> kBodyKinds{
    {{"fixed", BodyKind::kFixed}, {"kinematic", BodyKind::kKinematic}, {"dynamic", BodyKind::kDynamic}}};
inline constexpr std::array<std::pair<const char*, Effort>, 3> kEfforts{
    {{"quick", qp::kQuickEffort}, {"normal", qp::kNormalEffort}, {"thorough", qp::kThoroughEffort}}};

// Null if it has none.
template <typename T, std::size_t n>
constexpr const char* NameIn(const std::array<std::pair<const char*, T>, n>& names, const T& value) {
  for (const auto& [name, named] : names)
    if (named == value) return name;
  return nullptr;
}

template <typename T, std::size_t n>
constexpr std::optional<T> ValueIn(const std::array<std::pair<const char*, T>, n>& names, std::string_view name) {
  for (const auto& [known, value] : names)
    if (name == known) return value;
  return std::nullopt;
}

}  // namespace islet
