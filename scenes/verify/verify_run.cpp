#include "scenes/verify/verify_run.h"

#include <algorithm>
#include <cctype>
#include <charconv>
#include <cmath>
#include <exception>
#include <initializer_list>
#include <stdexcept>

#include "scenes/interrupt.h"
#include "scenes/seconds_option.h"
#include "scenes/setting_names.h"

namespace islet {
namespace {

constexpr double kShortestStep = 1e-6, kLongestStep = 0.1;  // [s]

std::vector<std::string> Split(const std::string& list) {
  std::vector<std::string> parts;
  for (size_t begin = 0;;) {
    const size_t end = list.find(',', begin);
    parts.push_back(list.substr(begin, end - begin));
    if (end == std::string::npos) return parts;
    begin = end + 1;
  }
}

std::vector<std::string> Choose(const char* option, const std::string& list,
                                std::initializer_list<const char*> choices) {
  std::vector<std::string> chosen;
  for (const std::string& value : Split(list)) {
    std::string names;
    bool known = false;
    for (const char* const choice : choices) {
      names += (names.empty() ? "" : ", ") + std::string(choice);
      known = known || value == choice;
    }
    if (!known) throw std::invalid_argument(std::string(option) + " must be one of " + names + "; got " + value);
    if (std::find(chosen.begin(), chosen.end(), value) == chosen.end()) chosen.push_back(value);
  }
  return chosen;
}

Settings EngineSettings(const std::string& model, const std::string& freeze, const VerifyBase& base) {
  Settings engine = model == "paper" ? Settings::Paper() : Settings{};
  engine.model = ValueIn(kModels, model).value_or(engine.model);
  engine.freezing = *ValueIn(kFreezings, freeze);
  engine.effort = base.effort;
  engine.tolerance = base.tolerance;
  engine.threads = base.threads;
  engine.group_bodies = base.group_bodies;
  return engine;
}

int NumberOf(std::string_view id) {  // of "T7": 7; 0 if there is none
  int number = 0;
  if (id.size() > 1) std::from_chars(id.data() + 1, id.data() + id.size(), number);
  return number;
}

std::string Upper(std::string text) {
  std::transform(text.begin(), text.end(), text.begin(), [](unsigned char c) { return std::toupper(c); });
  return text;
}

[[noreturn]] void ThrowUnknown(const std::string& id, std::span<const Check> checks) {
  constexpr size_t kNear = 5;
  std::vector<const Check*> near;
  for (const Check& check : checks) near.push_back(&check);
  const int wanted = NumberOf(id);
  std::stable_sort(near.begin(), near.end(), [&](const Check* a, const Check* b) {
    return std::abs(NumberOf(a->id) - wanted) < std::abs(NumberOf(b->id) - wanted);
  });
  near.resize(std::min(near.size(), kNear));
  std::string names;
  for (const Check* const check : near) names += (names.empty() ? "" : ", ") + std::string(check->id);
  throw std::invalid_argument("there is no check " + id + "; near it are: " + (names.empty() ? "none" : names) +
                              "; see `islet verify --list`");
}

}  // namespace

std::vector<TimeStep> ParseTimeSteps(const std::string& list) {
  std::vector<TimeStep> steps;
  for (const std::string& text : Split(list)) {
    if (text.empty()) throw std::invalid_argument("--dt: an empty time in '" + list + "'");
    const double seconds = ParseSeconds("--dt", text);
    if (!(seconds >= kShortestStep && seconds <= kLongestStep))
      throw std::invalid_argument("--dt must be numbers or fractions in [1e-6, 0.1] s, as in 1/60,0.004; got " + text);
    steps.push_back({text, seconds});
  }
  return steps;
}

std::vector<Setting> CrossSettings(const std::string& dts, const std::string& models, const std::string& freezings,
                                   const VerifyBase& base) {
  const std::vector<TimeStep> steps = ParseTimeSteps(dts);
  const std::vector<std::string> freezes = Choose("--freeze", freezings, {"off", "certified"});
  std::vector<Setting> settings;
  for (const std::string& model : Choose("--model", models, {"coulomb", "convex", "kinetic", "paper"}))
    for (const TimeStep& dt : steps)
      for (const std::string& freeze : model == "paper" ? std::vector<std::string>{"paper"} : freezes)
        settings.push_back({dt, model, freeze, {dt.seconds, EngineSettings(model, freeze, base), base.quick}});
  return settings;
}

std::vector<const Check*> SelectChecks(std::span<const Check> checks, std::span<const std::string> ids,
                                       const std::string& gates) {
  const std::vector<std::string> wanted_gates =
      gates.empty() ? std::vector<std::string>{"G1", "G2", "G3"} : Choose("--gate", Upper(gates), {"G1", "G2", "G3"});
  std::vector<std::string> wanted;
  for (const std::string& id : ids) {
    wanted.push_back(Upper(id));
    if (std::none_of(checks.begin(), checks.end(), [&](const Check& check) { return check.id == wanted.back(); }))
      ThrowUnknown(id, checks);
  }
  const auto contains = [](const std::vector<std::string>& list, std::string_view value) {
    return std::find(list.begin(), list.end(), value) != list.end();
  };
  std::vector<const Check*> selected;
  for (const Check& check : checks)
    if ((wanted.empty() || contains(wanted, check.id)) && contains(wanted_gates, NameOf(check.gate)))
      selected.push_back(&check);
  if (selected.empty()) throw std::invalid_argument("--gate " + gates + " leaves none of the checks asked for");
  return selected;
}

bool VerifyRow::GateFailed() const {
  if (Pass() || setting->settings.engine.model != Model::kCoulomb) return false;
  return broken || (check->gate != Gate::kStatistics && !measurement.open);
}

std::vector<VerifyRow> RunCheck(const Check& check, std::span<const Setting> settings, const VerifyProgress& progress) {
  std::vector<VerifyRow> rows;
  for (size_t k = 0; k < settings.size() && !Interrupt::Asked(); ++k) {
    if (progress) progress(check, settings[k], static_cast<int>(k));
    Measurements measured;
    std::string problem;
    try {
      check.measure(settings[k].settings, &measured);
      if (measured.all().empty()) problem = "nothing was measured";
    } catch (const std::exception& error) {
      problem = error.what();
    }
    for (const Measurement& m : measured.all()) rows.push_back({&check, &settings[k], m, false});
    if (problem.empty()) continue;
    VerifyRow row{&check, &settings[k], {}, true};
    row.measurement.quantity = "the check itself";
    row.measurement.measured = row.measurement.error = std::numeric_limits<double>::quiet_NaN();
    row.measurement.note = problem;
    rows.push_back(row);
  }
  return rows;
}

const char* NameOf(Gate gate) { return gate == Gate::kGate ? "G1" : gate == Gate::kChart ? "G2" : "G3"; }

}  // namespace islet
