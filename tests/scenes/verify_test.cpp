// The command around the checks: its arguments, its verdicts and what it writes. The checks here are made up.
#include "scenes/verify/verify.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <fstream>
#include <limits>
#include <nlohmann/json.hpp>
#include <set>
#include <stdexcept>

#include "scenes/verify/verify_report.h"
#include "scenes/verify/verify_run.h"

namespace islet::testing {
namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

void MeasureGood(const CheckSettings& settings, Measurements* out) {
  out->Absolute("time step", "s", settings.dt, settings.dt, 0);
  out->Relative("ratio", "", 2, 2 + 1e-9, 1e-8);
}
void MeasureWorseWhenFine(const CheckSettings& settings, Measurements* out) {
  out->Absolute("creep", "m", 0, settings.dt < 0.01 ? -2e-3 : 1e-3, 1.5e-3, "why not");
}
void MeasureNaN(const CheckSettings&, Measurements* out) { out->AtMost("overlap", "m", kNaN, 1e300); }
void MeasureThrow(const CheckSettings&, Measurements* out) {
  out->Verdict("before", true, true);
  throw std::runtime_error("a wall fell");
}
void MeasureNothing(const CheckSettings&, Measurements*) {}
void MeasureCoulombOnly(const CheckSettings& settings, Measurements* out) {
  out->Verdict("is Coulomb", true, settings.engine.model == Model::kCoulomb);
}

Check MakeCheck(std::string_view id, void (*measure)(const CheckSettings&, Measurements*), Gate gate = Gate::kGate) {
  return {id, "made up", gate, "by hand", measure};
}

// The rows point into both.
std::vector<VerifyRow> Rows(const Check& check, const std::vector<Setting>& settings) {
  return RunCheck(check, settings, {});
}

std::vector<Setting> Defaults(const char* models = "coulomb") {
  return CrossSettings("1/60,1/240", models, "off,certified", {});
}

// The message of what is thrown, or "nothing thrown".
template <typename Call>
std::string Rejection(Call call) {
  try {
    call();
  } catch (const std::invalid_argument& error) {
    return error.what();
  }
  return "nothing thrown";
}

void ExpectNames(const std::string& message, const char* option, const char* value) {
  EXPECT_NE(message.find(option), std::string::npos) << message;
  EXPECT_NE(message.find(value), std::string::npos) << message;
}

TEST(Measurement, NaNNeverPasses) {
  const double infinity = std::numeric_limits<double>::infinity();
  Measurement nan_error, nan_bound;
  nan_error.error = kNaN;
  nan_error.bound = infinity;
  nan_bound.bound = kNaN;
  EXPECT_FALSE(nan_error.Pass());
  EXPECT_FALSE(nan_bound.Pass());
  Measurements m;
  m.Absolute("a", "", 1, kNaN, 1e300);
  m.Relative("b", "", 1, kNaN, 1e300);
  m.Relative("c", "", 0, 0, 1e300);  // 0 / 0
  m.AtMost("d", "", kNaN, 1e300);
  for (const Measurement& each : m.all()) EXPECT_FALSE(each.Pass()) << each.quantity;
}

TEST(VerifyArguments, TimeSteps) {
  const std::vector<TimeStep> steps = ParseTimeSteps("1/60,0.004,1e-3");
  ASSERT_EQ(steps.size(), 3u);
  EXPECT_EQ(steps[0].seconds, 1.0 / 60);
  EXPECT_EQ(steps[0].name, "1/60");
  EXPECT_EQ(steps[1].seconds, 0.004);
  EXPECT_EQ(steps[2].seconds, 1e-3);
  for (const char* const bad :
       {"", "x", "1/0", "0/0", "0", "-1/60", "1/60,", "0.5", "nan", "inf", "1/60 ", "1e-9", "1/"})
    ExpectNames(Rejection([&] { ParseTimeSteps(bad); }), "--dt", bad);
}

TEST(VerifyArguments, CrossesModelsStepsAndFreezings) {
  VerifyBase base;
  base.tolerance = 1e-4;
  base.effort = qp::kThoroughEffort;
  base.quick = true;
  const std::vector<Setting> settings =
      CrossSettings("1/60,1/240", "paper,coulomb,coulomb,convex", "off,certified", base);
  ASSERT_EQ(settings.size(), 2u + 4u + 4u);  // paper has one freezing, and what is named twice runs once
  EXPECT_EQ(settings[0].model, "paper");
  EXPECT_EQ(settings[0].freeze, "paper");
  EXPECT_EQ(settings[0].settings.engine.freezing, Freezing::kPaper);
  EXPECT_EQ(settings[0].settings.engine.cone, Cone::kOctagon);
  EXPECT_EQ(settings[2].settings.engine.model, Model::kCoulomb);
  EXPECT_EQ(settings[2].settings.engine.effort.sweeps, qp::kThoroughEffort.sweeps);
  EXPECT_EQ(settings[2].settings.engine.freezing, Freezing::kOff);
  EXPECT_EQ(settings[3].settings.engine.freezing, Freezing::kCertified);
  EXPECT_EQ(settings[3].settings.dt, 1.0 / 60);
  EXPECT_EQ(settings[4].settings.dt, 1.0 / 240);
  for (const Setting& setting : settings) {
    EXPECT_EQ(setting.settings.engine.tolerance, 1e-4);
    EXPECT_TRUE(setting.settings.quick);
    EXPECT_NO_THROW(setting.settings.engine.Validate());
  }
  ExpectNames(Rejection([] { CrossSettings("1/60", "newton", "off", {}); }), "--model", "newton");
  ExpectNames(Rejection([] { CrossSettings("1/60", "coulomb", "paper", {}); }), "--freeze", "paper");
}

TEST(VerifyArguments, SelectsChecks) {
  const Check checks[] = {MakeCheck("T1", MeasureGood), MakeCheck("T2", MeasureGood, Gate::kChart),
                          MakeCheck("T10", MeasureGood), MakeCheck("T38", MeasureGood, Gate::kStatistics)};
  const std::string none[] = {"T3"}, two[] = {"T10", "t1", "T1"}, word[] = {"bounce"};
  EXPECT_EQ(SelectChecks(checks, {}, "").size(), 4u);
  ASSERT_EQ(SelectChecks(checks, two, "").size(), 2u);
  EXPECT_EQ(SelectChecks(checks, two, "")[0]->id, "T1");
  EXPECT_EQ(SelectChecks(checks, {}, "g2,G3").size(), 2u);
  ExpectNames(Rejection([&] { SelectChecks(checks, none, ""); }), "T3", "T2, T1, T10");
  ExpectNames(Rejection([&] { SelectChecks(checks, word, ""); }), "bounce", "T1");
  ExpectNames(Rejection([&] { SelectChecks(checks, {}, "G4"); }), "--gate", "G4");
  ExpectNames(Rejection([&] { SelectChecks(checks, two, "G3"); }), "--gate", "G3");
}

TEST(VerifyArguments, OfTheCommand) {
  const Check checks[] = {MakeCheck("T1", MeasureGood)};
  const auto message = [&](auto change) {
    VerifyOptions options;
    change(&options);
    return Rejection([&] { Verify(options, checks); });
  };
  ExpectNames(message([](VerifyOptions* o) { o->effort = "best"; }), "--effort", "best");
  ExpectNames(message([](VerifyOptions* o) { o->tolerance = kNaN; }), "--tolerance", "nan");
  ExpectNames(message([](VerifyOptions* o) { o->tolerance = 0; }), "--tolerance", "0");
  ExpectNames(message([](VerifyOptions* o) { o->threads = -1; }), "--threads", "-1");
  ExpectNames(message([](VerifyOptions* o) { o->report = "no_such_folder/r.json"; }), "--report", "no_such_folder");
}

TEST(VerifyRun, FailuresCountUnderCoulombAlone) {
  const std::vector<Setting> settings = Defaults("coulomb,convex,kinetic,paper");
  const Check check = MakeCheck("T1", MeasureCoulombOnly);
  const std::vector<VerifyRow> rows = Rows(check, settings);
  ASSERT_EQ(rows.size(), settings.size());
  for (const VerifyRow& row : rows) {
    EXPECT_EQ(row.Pass(), row.setting->model == "coulomb");
    EXPECT_FALSE(row.GateFailed());
  }
}

TEST(VerifyRun, GatesByClass) {
  for (const Gate gate : {Gate::kGate, Gate::kChart, Gate::kStatistics}) {
    const std::vector<Setting> settings = Defaults();
    for (const auto measure : {MeasureWorseWhenFine, MeasureNaN}) {
      const bool fails = CountFailedGates(Rows(MakeCheck("T1", measure, gate), settings)) > 0;
      EXPECT_EQ(fails, gate != Gate::kStatistics) << NameOf(gate);
    }
    EXPECT_EQ(CountFailedGates(Rows(MakeCheck("T1", MeasureThrow, gate), settings)), 1) << NameOf(gate);
    EXPECT_EQ(CountFailedGates(Rows(MakeCheck("T1", MeasureNothing, gate), settings)), 1) << NameOf(gate);
    EXPECT_EQ(CountFailedGates(Rows(MakeCheck("T1", MeasureGood, gate), settings)), 0) << NameOf(gate);
  }
}

void ThrowAtTheCoarseStep(const CheckSettings& settings, Measurements* out) {
  out->Verdict("before", true, true);
  if (settings.dt > 0.01) throw std::runtime_error("a wall fell");
  out->Verdict("after", true, true);
}

TEST(VerifyRun, WhatThrowsIsARowAndTheOtherSettingsRun) {
  const std::vector<Setting> settings = CrossSettings("1/60,1/240", "coulomb", "off", {});
  const Check check = MakeCheck("T1", ThrowAtTheCoarseStep);
  const std::vector<VerifyRow> rows = Rows(check, settings);
  ASSERT_EQ(rows.size(), 4u);
  EXPECT_TRUE(rows[0].Pass());
  EXPECT_FALSE(rows[1].Pass());
  EXPECT_EQ(rows[1].measurement.note, "a wall fell");
  EXPECT_TRUE(rows[2].Pass() && rows[3].Pass());
  EXPECT_NE(VerifyTable(rows, settings, false).find("a wall fell"), std::string::npos);
}

TEST(VerifyCommand, AThrowingCheckDoesNotStopTheOthers) {
  const std::string file = ::testing::TempDir() + "verify_test_throw.json";
  const Check checks[] = {MakeCheck("T1", MeasureThrow), MakeCheck("T2", MeasureGood)};
  VerifyOptions options;
  options.dt = "1/60";
  options.freeze = "off";
  options.report = file;
  EXPECT_FALSE(Verify(options, checks));
  std::ifstream stream(file);
  const nlohmann::json list = nlohmann::json::parse(stream);
  std::remove(file.c_str());
  ASSERT_EQ(list.size(), 4u);
  EXPECT_EQ(list[3]["id"], "T2");
  EXPECT_TRUE(list[3]["pass"]);
}

TEST(VerifyTable, ShowsTheWorstSettingOrAll) {
  const std::vector<Setting> settings = Defaults();
  const Check check = MakeCheck("T1", MeasureWorseWhenFine);
  const std::vector<VerifyRow> rows = Rows(check, settings);
  ASSERT_EQ(rows.size(), 4u);
  const std::string worst = VerifyTable(rows, settings, false), all = VerifyTable(rows, settings, true);
  EXPECT_NE(worst.find("FAIL"), std::string::npos) << worst;
  EXPECT_NE(worst.find("1/240"), std::string::npos) << worst;
  EXPECT_NE(worst.find("why not"), std::string::npos) << worst;
  EXPECT_EQ(worst.find("pass"), std::string::npos) << worst;
  EXPECT_NE(all.find("pass"), std::string::npos) << all;
  EXPECT_NE(all.find("1/60"), std::string::npos) << all;
}

TEST(VerifyTable, PutsModelsSideBySide) {
  const std::vector<Setting> settings = Defaults("paper,convex,coulomb");
  const std::string table = VerifyTable(Rows(MakeCheck("T1", MeasureCoulombOnly), settings), settings, false);
  const size_t line = table.find("is Coulomb");
  ASSERT_NE(line, std::string::npos) << table;
  const std::string row = table.substr(line, table.find('\n', line) - line);
  EXPECT_LT(row.find("differs"), row.rfind("differs")) << table;  // twice
  EXPECT_LT(row.rfind("differs"), row.find("pass")) << table;
}

TEST(VerifyTable, AFailureIsWorseThanAnyPass) {
  const std::vector<Setting> settings = Defaults();
  const Check check = MakeCheck("T1", MeasureGood);
  const auto row = [&](double error, double bound) {
    VerifyRow r{&check, &settings[0], {}, false};
    r.measurement.error = error;
    r.measurement.bound = bound;
    return r;
  };
  EXPECT_TRUE(Worse(row(kNaN, 1), row(1e300, 1)));
  EXPECT_TRUE(Worse(row(1e-9, 0), row(5, 1)));
  EXPECT_TRUE(Worse(row(2, 1), row(1, 1)));
  EXPECT_FALSE(Worse(row(0, 0), row(1e-3, 1)));
}

TEST(VerifyJson, HasEveryFieldOfEverySetting) {
  const std::string file = ::testing::TempDir() + "verify_test.json";
  const Check checks[] = {MakeCheck("T1", MeasureGood), MakeCheck("T2", MeasureNaN)};
  VerifyOptions options;
  options.model = "coulomb,paper";
  options.report = file;
  EXPECT_FALSE(Verify(options, checks));
  std::ifstream stream(file);
  const nlohmann::json list = nlohmann::json::parse(stream);
  std::remove(file.c_str());
  ASSERT_EQ(list.size(), 6u * 3u);
  const std::set<std::string> fields{"id",       "name",   "gate",      "quantity",  "unit",     "dt",
                                     "model",    "freeze", "tolerance", "reference", "measured", "error",
                                     "relative", "bound",  "pass",      "open",      "note"};
  for (const nlohmann::json& entry : list) {
    std::set<std::string> found;
    for (const auto& [key, value] : entry.items()) found.insert(key);
    EXPECT_EQ(found, fields);
    EXPECT_EQ(entry["pass"], entry["id"] == "T1");
  }
  EXPECT_EQ(list[1]["quantity"], "ratio");
  EXPECT_TRUE(list[1]["relative"]);
  EXPECT_NEAR(list[1]["error"].get<double>(), 5e-10, 1e-12);
  EXPECT_EQ(list[0]["dt"], 1.0 / 60);
  EXPECT_TRUE(list.back()["measured"].is_null());  // NaN has no number in JSON
}

void MeasureOpen(const CheckSettings&, Measurements* out) {
  out->AtMost("asked for", "m", 2, 1, "why it does not hold yet");
  out->Open();
}

TEST(VerifyRun, WhatIsKnownToBeOpenIsShownAndFailsNothing) {
  const std::vector<Setting> settings = Defaults();
  const Check check = MakeCheck("T1", MeasureOpen);
  const std::vector<VerifyRow> rows = Rows(check, settings);
  for (const VerifyRow& row : rows) {
    EXPECT_FALSE(row.Pass());
    EXPECT_FALSE(row.GateFailed());
  }
  const std::string table = VerifyTable(rows, settings, false);
  EXPECT_NE(table.find("OPEN"), std::string::npos);
  EXPECT_NE(table.find("why it does not hold yet"), std::string::npos);
}

TEST(VerifyCommand, TrueIfNoGateFailed) {
  VerifyOptions options;
  const Check good[] = {MakeCheck("T1", MeasureGood), MakeCheck("T2", MeasureNaN, Gate::kStatistics)};
  EXPECT_TRUE(Verify(options, good));
  const Check bad[] = {MakeCheck("T1", MeasureGood), MakeCheck("T2", MeasureNaN)};
  EXPECT_FALSE(Verify(options, bad));
  options.model = "convex";
  EXPECT_TRUE(Verify(options, bad));
}

TEST(AllChecks, EachHasItsOwnNumberAndAReference) {
  std::set<std::string_view> ids;
  for (const Check& check : AllChecks()) {
    EXPECT_TRUE(ids.insert(check.id).second) << check.id;
    EXPECT_FALSE(check.name.empty()) << check.id;
    EXPECT_FALSE(check.reference.empty()) << check.id;
    EXPECT_NE(check.measure, nullptr) << check.id;
  }
}

}  // namespace
}  // namespace islet::testing
