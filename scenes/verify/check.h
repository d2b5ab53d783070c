// A check: a scene whose answer is known, what is measured in it, and how far it may be off.
//
//   in:  the settings to run under (time step, engine settings)     out: one Measurement per quantity
//   rule: a check builds its worlds itself, measures from poses, velocities and impulses, never from what the solver says of
//         itself, and holds the reference as a formula, not as a number that came out once
//   threads: a check runs on one thread; what it steps may use Settings::threads
#pragma once

#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "engine/settings.h"

namespace islet {

enum class Gate {
  kGate,        // G1: must hold, a failure fails the run
  kChart,       // G2: must hold for exact Coulomb friction; other models are shown
  kStatistics,  // G3: a chaotic scene; a statistic with its spread
};

struct CheckSettings {
  double dt = 1.0 / 60;  // [s]
  Settings engine;       // gravity is the check's own to choose; the other fields are what the user asked for
  bool quick = false;    // leave out what takes more than some seconds: the largest sizes, the longest times
};

// What passes: |error| <= bound. NaN never passes.
struct Measurement {
  std::string quantity;  // "creep in 10 s at 0.99 mu"
  std::string unit;      // "m", "m/s", "" for ratios and counts
  double reference = 0;
  double measured = 0;
  double error = 0;  // measured - reference, in `unit`, or over the reference: see `relative`
  bool relative = false;
  double bound = 0;
  bool open = false;  // asked for and known not to hold yet: shown as OPEN, does not fail the run; the note tells why
  std::string note = {};  // why a bound is what it is here, or why it cannot be met; empty for most
  bool Pass() const;
};

// Collects the measurements of one check.
class Measurements {
 public:
  // |measured - reference| <= bound, all in `unit`.
  void Absolute(std::string quantity, std::string unit, double reference, double measured, double bound,
                std::string note = {});
  // |measured / reference - 1| <= bound; reference must not be 0.
  void Relative(std::string quantity, std::string unit, double reference, double measured, double bound,
                std::string note = {});
  // measured <= bound, for what should be 0 and cannot be negative, or has one-sided bounds.
  void AtMost(std::string quantity, std::string unit, double measured, double bound, std::string note = {});
  // A yes or no: measured 1 or 0 against the reference.
  void Verdict(std::string quantity, bool expected, bool observed, std::string note = {});

  void Open();  // the last one added; its note must tell why
  const std::vector<Measurement>& all() const { return all_; }

 private:
  std::vector<Measurement> all_;
};

struct Check {
  std::string_view id;    // "T1"
  std::string_view name;  // "block on an incline below the friction angle"
  Gate gate;
  std::string_view reference;  // the formula and where it comes from
  void (*measure)(const CheckSettings& settings, Measurements* out);
};

std::span<const Check> AllChecks();           // in the order of their numbers
const Check* FindCheck(std::string_view id);  // null if there is none

// The families, one file each; AllChecks() joins them.
std::span<const Check> FrictionChecks();
std::span<const Check> RollingChecks();
std::span<const Check> ImpactChecks();
std::span<const Check> LoadChecks();
std::span<const Check> StructureChecks();
std::span<const Check> FreezingChecks();
std::span<const Check> InvarianceChecks();
std::span<const Check> SpinChecks();
std::span<const Check> FlowChecks();
std::span<const Check> MotionChecks();

}  // namespace islet
