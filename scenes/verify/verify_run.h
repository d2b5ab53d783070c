// Runs a check under a list of settings: every time step with every model, and with every freezing.
//
//   in:  a check, and the settings to cross     out: one row per measurement and setting, in the order of settings
//   rule: an interrupt (scenes/interrupt.h) ends it after the setting under way: the rows are those of the settings run
//   rule: a check that throws, or measures nothing, is a row that does not pass; its other settings still run
//   threads: one run after the other; Settings::threads is for the engine
#pragma once

#include <functional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "scenes/verify/check.h"

namespace islet {

struct TimeStep {
  std::string name;  // as it was asked for: "1/60"
  double seconds = 0;
};

struct Setting {
  TimeStep dt;
  std::string model;   // "coulomb", "convex", "kinetic", or "paper": all as Settings::Paper() has it
  std::string freeze;  // "off", "certified" or "paper"
  CheckSettings settings;
};

// What is the same for all settings.
struct VerifyBase {
  double tolerance = 1e-6;
  Effort effort = qp::kNormalEffort;
  int threads = 0;  // 0: all cores
  int group_bodies = 20;
  bool quick = false;
};

// "0.01", "1/60,1/240". Throws std::invalid_argument if one is no number, or outside of [1e-6, 0.1] s.
std::vector<TimeStep> ParseTimeSteps(const std::string& list);

// The cross product, models outermost. Paper brings its own freezing and is there once per time step.
// Throws std::invalid_argument that names the option and the value it does not know.
std::vector<Setting> CrossSettings(const std::string& dts, const std::string& models, const std::string& freezings,
                                   const VerifyBase& base);

// The checks asked for by name ("T7" or "t7") and gate ("G1,G2"), none of either: all, in their own order and each once.
// Throws std::invalid_argument that names the value, and checks near it.
std::vector<const Check*> SelectChecks(std::span<const Check> checks, std::span<const std::string> ids,
                                       const std::string& gates);

struct VerifyRow {
  const Check* check = nullptr;
  const Setting* setting = nullptr;
  Measurement measurement;
  bool broken = false;  // threw, or measured nothing; the reason is the measurement's note
  bool Pass() const { return !broken && measurement.Pass(); }
  // G1 and G2 must hold under exact Coulomb friction; no check may break there.
  bool GateFailed() const;
};

// Called before each setting, with the number of those that are done.
using VerifyProgress = std::function<void(const Check& check, const Setting& setting, int done)>;

// The rows point to the check and into `settings`.
std::vector<VerifyRow> RunCheck(const Check& check, std::span<const Setting> settings, const VerifyProgress& progress);

const char* NameOf(Gate gate);  // "G1"

}  // namespace islet
