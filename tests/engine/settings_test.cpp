#include "engine/settings.h"

#include <functional>
#include <limits>
#include <stdexcept>
#include <string>

#include <gtest/gtest.h>

namespace islet {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr double kInfinity = std::numeric_limits<double>::infinity();

TEST(Settings, DefaultsAndThePaperAreValid) {
  EXPECT_NO_THROW(Settings().Validate());
  EXPECT_NO_THROW(Settings::Paper().Validate());
}

TEST(Settings, PaperIsThePaper) {
  const Settings paper = Settings::Paper();
  EXPECT_EQ(paper.model, Model::kKinetic);
  EXPECT_EQ(paper.cone, Cone::kOctagon);
  EXPECT_EQ(paper.bounce_law, BounceLaw::kEq5);
  EXPECT_EQ(paper.freezing, Freezing::kPaper);
}

TEST(Settings, EveryBadValueIsNamed) {
  struct Case {
    const char* field;
    const char* value;
    std::function<void(Settings*)> spoil;
  };
  const Case cases[] = {
      {"gravity", "nan", [](Settings* s) { s->gravity.y() = kNan; }},
      {"gravity", "inf", [](Settings* s) { s->gravity.z() = kInfinity; }},
      {"gravity", "1e+200", [](Settings* s) { s->gravity.z() = 1e200; }},
      {"bounce_limit", "-2", [](Settings* s) { s->bounce_limit = -2; }},
      {"freeze_count", "-1", [](Settings* s) { s->freeze_count = -1; }},
      {"freeze_seconds", "0", [](Settings* s) { s->freeze_seconds = 0; }},
      {"freeze_seconds", "nan", [](Settings* s) { s->freeze_seconds = kNan; }},
      {"freeze_travel", "1", [](Settings* s) { s->freeze_travel = 1; }},
      {"freeze_travel", "-", [](Settings* s) { s->freeze_travel = -0.1; }},
      {"tolerance", "0", [](Settings* s) { s->tolerance = 0; }},
      {"tolerance", "1e-16", [](Settings* s) { s->tolerance = 1e-16; }},
      {"tolerance", "0.2", [](Settings* s) { s->tolerance = 0.2; }},
      {"tolerance", "nan", [](Settings* s) { s->tolerance = kNan; }},
      {"touch_gap", "0.1", [](Settings* s) { s->touch_gap = 0.1; }},
      {"touch_gap", "nan", [](Settings* s) { s->touch_gap = kNan; }},
      {"overlap_tolerance", "0.5", [](Settings* s) { s->overlap_tolerance = 0.5; }},
      {"overlap_tolerance", "= 0 ", [](Settings* s) { s->overlap_tolerance = 0; }},
      {"threads", "-1", [](Settings* s) { s->threads = -1; }},
      {"cold_volumes", "2",
       [](Settings* s) {
         s->cold_volumes = {{{0, 0, 2}, {1, 1, 1}}};
       }},
      {"cold_volumes", "nan",
       [](Settings* s) {
         s->cold_volumes = {{{0, 0, 0}, {1, kNan, 1}}};
       }},
  };
  for (const Case& bad : cases) {
    Settings settings;
    bad.spoil(&settings);
    try {
      settings.Validate();
      ADD_FAILURE() << bad.field << " " << bad.value << " was accepted";
    } catch (const std::invalid_argument& error) {
      EXPECT_NE(std::string(error.what()).find(bad.field), std::string::npos) << error.what();
      EXPECT_NE(std::string(error.what()).find(bad.value), std::string::npos) << error.what();
    }
  }
}

// The bounds themselves are allowed.
TEST(Settings, LimitsThatAreValid) {
  Settings settings;
  settings.bounce_limit = 0;
  settings.freeze_count = 0;
  settings.tolerance = 0.1;
  settings.overlap_tolerance = settings.touch_gap;
  settings.gravity.setZero();
  settings.cold_volumes = {{{1, 1, 1}, {1, 1, 1}}};
  EXPECT_NO_THROW(settings.Validate());
}

}  // namespace
}  // namespace islet
