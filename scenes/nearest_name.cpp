#include "scenes/nearest_name.h"

#include <algorithm>
#include <vector>

namespace islet {

int EditDistance(std::string_view a, std::string_view b) {
  constexpr size_t kMost = 100;
  a = a.substr(0, kMost), b = b.substr(0, kMost);
  std::vector<int> row(b.size() + 1);
  for (size_t j = 0; j <= b.size(); ++j) row[j] = static_cast<int>(j);
  for (size_t i = 1; i <= a.size(); ++i) {
    int diagonal = row[0];
    row[0] = static_cast<int>(i);
    for (size_t j = 1; j <= b.size(); ++j) {
      const int change = diagonal + (a[i - 1] == b[j - 1] ? 0 : 1);
      diagonal = row[j];
      row[j] = std::min({row[j] + 1, row[j - 1] + 1, change});
    }
  }
  return row.back();
}

std::string_view NearestName(std::string_view name, std::span<const char* const> names) {
  const auto nearest = std::min_element(names.begin(), names.end(), [&](std::string_view a, std::string_view b) {
    return EditDistance(a, name) < EditDistance(b, name);
  });
  return nearest == names.end() ? std::string_view() : std::string_view(*nearest);
}

}  // namespace islet
