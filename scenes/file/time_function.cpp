#include "scenes/file/time_function.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "qp/elementary.h"

namespace islet {
namespace {

double InTable(const std::vector<std::array<double, 2>>& table, double time) {
  const auto after =
      std::upper_bound(table.begin(), table.end(), time, [](double t, const auto& row) { return t < row[0]; });
  if (after == table.begin()) return table.front()[1];
  const auto& before = *(after - 1);
  if (after == table.end()) return before[1];
  return std::lerp(before[1], (*after)[1], (time - before[0]) / ((*after)[0] - before[0]));
}

}  // namespace

double TimeFunction::At(double time) const {
  double value = constant;
  if (!table.empty()) value += InTable(table, time);
  if (amplitude != 0) value += amplitude * Sine(2 * std::numbers::pi * frequency * time + phase);
  return value;
}

Vector3 At(const TimeVector& functions, double time) {
  return {functions[0].At(time), functions[1].At(time), functions[2].At(time)};
}

}  // namespace islet
