#include "scenes/verify/verify_report.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>
#include <utility>
#include <vector>

namespace islet {
namespace {

using Json = nlohmann::ordered_json;

constexpr int kQuantityWidth = 74;  // characters; a longer one shifts its own line

double InBounds(const VerifyRow& row) {  // how many bounds the error is; infinity if there is no telling
  const double infinity = std::numeric_limits<double>::infinity();
  if (row.broken || std::isnan(row.measurement.error)) return infinity;
  const double error = std::abs(row.measurement.error);
  return error == 0 ? 0 : error / row.measurement.bound;
}

bool Same(const VerifyRow& a, const VerifyRow& b) {
  return a.check == b.check && a.measurement.quantity == b.measurement.quantity;
}

std::string Verdict(const VerifyRow& row) {
  if (row.Pass()) return "pass";
  if (row.GateFailed()) return "FAIL";
  if (row.measurement.open) return "OPEN";
  return row.setting->settings.engine.model == Model::kCoulomb ? "outside" : "differs";
}

std::string Short(double value) {
  if (value == 0) return "0";  // also -0
  return std::abs(value) >= 1e-3 && std::abs(value) < 1e5 ? fmt::format("{:.6g}", value) : fmt::format("{:.2e}", value);
}

std::string Error(const Measurement& m) {
  return m.error == 0 ? "0" : fmt::format("{:.1e}{}", m.error, m.relative ? " rel" : "");
}

std::string Quantity(const Measurement& m) {
  std::string text = "  " + m.quantity + (m.unit.empty() || m.unit == "yes/no" ? "" : " [" + m.unit + "]");
  return text;
}

// "T4   sliding cube stops (G1): within bounds coulomb 40 of 40, convex 3 of 10"
std::string CheckLine(const Check& check, std::span<const VerifyRow> rows, const std::vector<std::string>& models) {
  std::string line = fmt::format("{:<4} {} ({})", check.id, check.name, NameOf(check.gate));
  for (const std::string& model : models) {
    int all = 0, passed = 0;
    for (const VerifyRow& row : rows) {
      if (row.check != &check || row.setting->model != model) continue;
      ++all;
      passed += row.Pass();
    }
    line += fmt::format("{} {} {} of {}", &model == &models[0] ? ": within bounds" : ",", model, passed, all);
  }
  return line + "\n";
}

std::string NoteLine(const VerifyRow& row) {
  return row.Pass() || row.measurement.note.empty() ? "" : fmt::format("       {}\n", row.measurement.note);
}

// One quantity: its rows by the model they were measured under, models in the order asked for.
struct Group {
  std::vector<std::vector<const VerifyRow*>> by_model;
};

std::vector<std::string> ModelsOf(std::span<const Setting> settings) {
  std::vector<std::string> models;
  for (const Setting& setting : settings)
    if (std::find(models.begin(), models.end(), setting.model) == models.end()) models.push_back(setting.model);
  return models;
}

std::vector<Group> GroupRows(std::span<const VerifyRow> rows, const std::vector<std::string>& models) {
  std::vector<Group> groups;
  std::vector<const VerifyRow*> first;  // of each group
  size_t check_begin = 0;               // groups of the same check
  for (const VerifyRow& row : rows) {
    if (!first.empty() && first.back()->check != row.check) check_begin = groups.size();
    size_t g = check_begin;
    while (g < groups.size() && !Same(*first[g], row)) ++g;
    if (g == groups.size()) {
      groups.push_back({std::vector<std::vector<const VerifyRow*>>(models.size())});
      first.push_back(&row);
    }
    const auto model = std::find(models.begin(), models.end(), row.setting->model) - models.begin();
    groups[g].by_model[model].push_back(&row);
  }
  return groups;
}

const VerifyRow* Worst(const std::vector<const VerifyRow*>& rows) {
  if (rows.empty()) return nullptr;
  return *std::max_element(rows.begin(), rows.end(),
                           [](const VerifyRow* a, const VerifyRow* b) { return Worse(*b, *a); });
}

constexpr const char* kRow = "{:<{}} {:<7} {:>6} {:<9} {:>12} {:>12} {:>12} {:>8}  {}\n";

std::string RowLine(const VerifyRow& row) {
  const Measurement& m = row.measurement;
  return fmt::format(kRow, Quantity(m), kQuantityWidth, row.setting->model, row.setting->dt.name, row.setting->freeze,
                     Short(m.reference), Short(m.measured), Error(m), fmt::format("{:.1e}", m.bound), Verdict(row));
}

std::string OneModelTable(std::span<const VerifyRow> all, const std::vector<Group>& groups,
                          const std::vector<std::string>& models, bool all_settings) {
  std::string table;
  const Check* check = nullptr;
  for (const Group& group : groups) {
    for (const std::vector<const VerifyRow*>& rows : group.by_model) {
      if (rows.empty()) continue;
      if (check != rows[0]->check) table += CheckLine(*(check = rows[0]->check), all, models);
      if (all_settings) {
        for (const VerifyRow* const row : rows) table += RowLine(*row) + NoteLine(*row);
      } else {
        table += RowLine(*Worst(rows)) + NoteLine(*Worst(rows));
      }
    }
  }
  return table;
}

std::string SideBySideTable(std::span<const VerifyRow> all, const std::vector<Group>& groups,
                            const std::vector<std::string>& models) {
  std::string table;
  const Check* check = nullptr;
  for (const Group& group : groups) {
    std::string cells, notes;
    const VerifyRow* first = nullptr;
    for (const std::vector<const VerifyRow*>& rows : group.by_model) {
      const VerifyRow* const worst = Worst(rows);
      cells += fmt::format("  {:>12} {:<7}", worst ? Error(worst->measurement) : "-", worst ? Verdict(*worst) : "");
      if (worst && !first) first = worst;
      if (worst && (worst->broken || worst->GateFailed())) notes += NoteLine(*worst);
    }
    if (check != first->check) table += CheckLine(*(check = first->check), all, models);
    table += fmt::format("{:<{}} {:>12} {:>8}{}\n", Quantity(first->measurement), kQuantityWidth,
                         Short(first->measurement.reference), fmt::format("{:.1e}", first->measurement.bound), cells);
    table += notes;
  }
  return table;
}

}  // namespace

bool Worse(const VerifyRow& a, const VerifyRow& b) {
  if (a.Pass() != b.Pass()) return b.Pass();
  return InBounds(a) > InBounds(b);
}

std::string VerifyHeader(std::span<const Setting> settings, bool all_settings) {
  const std::vector<std::string> models = ModelsOf(settings);
  if (models.size() == 1 || all_settings)
    return fmt::format(kRow, "check and quantity", kQuantityWidth, "model", "dt", "freezing", "reference", "measured",
                       "error", "bound", "verdict");
  std::string header =
      fmt::format("{:<{}} {:>12} {:>8}", "check and quantity: errors", kQuantityWidth, "reference", "bound");
  for (const std::string& model : models) header += fmt::format("  {:>12}        ", model);
  return header + "\n";
}

std::string VerifyTable(std::span<const VerifyRow> rows, std::span<const Setting> settings, bool all_settings) {
  const std::vector<std::string> models = ModelsOf(settings);
  const std::vector<Group> groups = GroupRows(rows, models);
  return models.size() == 1 || all_settings ? OneModelTable(rows, groups, models, all_settings)
                                            : SideBySideTable(rows, groups, models);
}

std::string VerifyJson(std::span<const VerifyRow> rows, double tolerance) {
  Json list = Json::array();
  for (const VerifyRow& row : rows) {
    const Measurement& m = row.measurement;
    list.push_back(Json{{"id", row.check->id},
                        {"name", row.check->name},
                        {"gate", NameOf(row.check->gate)},
                        {"quantity", m.quantity},
                        {"unit", m.unit},
                        {"dt", row.setting->settings.dt},
                        {"model", row.setting->model},
                        {"freeze", row.setting->freeze},
                        {"tolerance", tolerance},
                        {"reference", m.reference},
                        {"measured", m.measured},
                        {"error", m.error},
                        {"relative", m.relative},
                        {"bound", m.bound},
                        {"pass", row.Pass()},
                        {"open", m.open},
                        {"note", m.note}});
  }
  return list.dump(2, ' ', false, Json::error_handler_t::replace) + "\n";
}

int CountFailedGates(std::span<const VerifyRow> rows) {
  int count = 0;
  for (auto row = rows.begin(); row != rows.end(); ++row) {
    if (!row->GateFailed()) continue;
    count += std::none_of(rows.begin(), row, [&](const VerifyRow& r) { return r.GateFailed() && Same(r, *row); });
  }
  return count;
}

}  // namespace islet
