#include "engine/settings.h"

#include <cmath>
#include <stdexcept>
#include <string>

#include "engine/body_definition.h"
#include "engine/number_text.h"

namespace islet {
namespace {

void Require(bool holds, const std::string& field, double value, const std::string& rule) {
  if (!holds) throw std::invalid_argument("settings: " + field + " = " + Text(value) + " must be " + rule);
}

}  // namespace

void Settings::Validate() const {
  RequireFinite("settings", "gravity", gravity);
  const auto one_of = [](auto value, auto last, const char* field) {
    const int number = static_cast<int>(value);
    Require(number >= 0 && number <= static_cast<int>(last), field, number, "one of its names");
  };
  one_of(model, Model::kCoulomb, "model");
  one_of(cone, Cone::kOctagon, "cone");
  one_of(bounce_law, BounceLaw::kExact, "bounce_law");
  one_of(freezing, Freezing::kCertified, "freezing");
  Require(bounce_limit >= 0 || bounce_limit == kAutoBounceLimit, "bounce_limit", bounce_limit, ">= 0, or auto (-1)");
  Require(freeze_count >= 0, "freeze_count", freeze_count, ">= 0 frames");
  Require(freeze_seconds > 0 && std::isfinite(freeze_seconds), "freeze_seconds", freeze_seconds, "> 0 s");
  Require(freeze_travel > 0 && freeze_travel < 1, "freeze_travel", freeze_travel, "in (0, 1) body radii");
  Require(tolerance >= 1e-15 && tolerance <= 0.1, "tolerance", tolerance, "in [1e-15, 0.1]");
  Require(effort.sweeps >= 0, "effort.sweeps", effort.sweeps, ">= 0");
  Require(touch_gap > 0 && touch_gap < 0.1, "touch_gap", touch_gap, "in (0, 0.1) of a shape's size");
  Require(overlap_tolerance > 0 && overlap_tolerance <= touch_gap, "overlap_tolerance", overlap_tolerance,
          "in (0, touch_gap]");
  Require(group_bodies >= 0, "group_bodies", group_bodies, ">= 0 (0: all move as a crowd)");
  Require(threads >= 0 && threads <= 1024, "threads", threads, "in 0 (all cores) to 1024");
  for (const Region& region : cold_volumes)
    for (int i = 0; i < 3; ++i)
      Require(region.lower[i] <= region.upper[i], "cold_volumes: lower corner", region.lower[i],
              "<= the upper one, " + std::to_string(region.upper[i]));
}

Settings Settings::Paper() {
  Settings settings;
  settings.model = Model::kKinetic;
  settings.cone = Cone::kOctagon;
  settings.bounce_law = BounceLaw::kEq5;
  settings.freezing = Freezing::kPaper;
  return settings;
}

}  // namespace islet
