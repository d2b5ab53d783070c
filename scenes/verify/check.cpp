#include "scenes/verify/check.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <initializer_list>

namespace islet {
namespace {

int NumberOf(const Check& check) {
  int number = 0;
  std::from_chars(check.id.data() + 1, check.id.data() + check.id.size(), number);
  return number;
}

std::vector<Check> JoinFamilies() {
  std::vector<Check> all;
  for (const std::span<const Check> family :
       {FrictionChecks(), RollingChecks(), ImpactChecks(), LoadChecks(), StructureChecks(), FreezingChecks(),
        InvarianceChecks(), SpinChecks(), FlowChecks(), MotionChecks()})
    all.insert(all.end(), family.begin(), family.end());
  std::stable_sort(all.begin(), all.end(), [](const Check& a, const Check& b) { return NumberOf(a) < NumberOf(b); });
  return all;
}

}  // namespace

bool Measurement::Pass() const { return std::abs(error) <= bound; }

void Measurements::Absolute(std::string quantity, std::string unit, double reference, double measured, double bound,
                            std::string note) {
  all_.push_back({.quantity = std::move(quantity),
                  .unit = std::move(unit),
                  .reference = reference,
                  .measured = measured,
                  .error = measured - reference,
                  .bound = bound,
                  .note = std::move(note)});
}

void Measurements::Relative(std::string quantity, std::string unit, double reference, double measured, double bound,
                            std::string note) {
  all_.push_back({.quantity = std::move(quantity),
                  .unit = std::move(unit),
                  .reference = reference,
                  .measured = measured,
                  .error = measured / reference - 1,
                  .relative = true,
                  .bound = bound,
                  .note = std::move(note)});
}

void Measurements::AtMost(std::string quantity, std::string unit, double measured, double bound, std::string note) {
  all_.push_back({.quantity = std::move(quantity),
                  .unit = std::move(unit),
                  .measured = measured,
                  .error = std::max(measured, 0.0),  // of NaN: NaN
                  .bound = bound,
                  .note = std::move(note)});
}

void Measurements::Verdict(std::string quantity, bool expected, bool observed, std::string note) {
  Absolute(std::move(quantity), "yes/no", expected, observed, 0, std::move(note));
}

void Measurements::Open() { all_.back().open = true; }

std::span<const Check> AllChecks() {
  static const std::vector<Check> all = JoinFamilies();
  return all;
}

const Check* FindCheck(std::string_view id) {
  for (const Check& check : AllChecks())
    if (check.id == id) return &check;
  return nullptr;
}

}  // namespace islet
