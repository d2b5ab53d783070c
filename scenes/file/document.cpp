#include "scenes/file/document.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <memory>
#include <stdexcept>
#include <utility>

#include "scenes/file/number_format.h"
#include "scenes/nearest_name.h"

namespace islet {
namespace {

const char* Named(JsonKind kind) {
  switch (kind) {
    case JsonKind::kArray:
      return "an array";
    case JsonKind::kObject:
      return "an object";
    default:
      return "";
  }
}

std::string MessageOf(const std::string& file, JsonPlace place, const std::string& path, const std::string& what) {
  return file + ":" + std::to_string(place.line) + ":" + std::to_string(place.column) + ": " +
         (path.empty() ? "the document" : path) + ": " + what;
}

}  // namespace

std::string ReadWholeFile(const std::string& path, size_t most_bytes, const std::string& what) {
  std::error_code error;
  if (std::filesystem::is_directory(path, error)) throw std::invalid_argument(path + ": is a folder, not " + what);
  const std::unique_ptr<std::FILE, int (*)(std::FILE*)> file(std::fopen(path.c_str(), "rb"), &std::fclose);
  if (!file) throw std::invalid_argument(path + ": cannot be read: " + std::strerror(errno));
  const std::string limit = ": is too large: " + what + " has at most " + std::to_string(most_bytes >> 20) + " MiB";
  const std::uintmax_t size = std::filesystem::file_size(path, error);
  if (!error && size > most_bytes)
    throw std::invalid_argument(path + limit + "; got " + std::to_string(size) + " bytes");
  std::string text;
  if (!error) text.reserve(static_cast<size_t>(size));
  for (char part[65536];;) {
    const size_t got = std::fread(part, 1, sizeof part, file.get());
    text.append(part, got);
    if (text.size() > most_bytes) throw std::invalid_argument(path + limit);
    if (got < sizeof part) break;
  }
  if (std::ferror(file.get())) throw std::invalid_argument(path + ": cannot be read: " + std::strerror(errno));
  return text;
}

Document::Document(std::string name, std::string text) : name_(std::move(name)), text_(std::move(text)) {
  try {
    tree_.emplace(text_);
  } catch (const JsonError& error) {
    throw std::invalid_argument(MessageOf(name_, error.place, error.path, error.what()));
  }
}

std::string ReadSceneText(const std::string& path) { return ReadWholeFile(path, kMostFileBytes, "a scene file"); }

std::string Document::folder() const {
  const size_t slash = name_.rfind('/');
  return slash == std::string::npos ? "" : name_.substr(0, slash + 1);
}

Field Document::root() const { return Field(this, 0); }

std::string Field::Label() const {
  const JsonTree& tree = document_->tree();
  const std::string message = MessageOf(document_->name(), tree.place(value_), tree.path(value_), "");
  return message.substr(0, message.size() - 2);
}

void Field::Refuse(const std::string& why) const { throw std::invalid_argument(Label() + ": " + why); }

void Field::Fail(const std::string& rule) const {
  const char* const named = Named(kind());
  Refuse(rule + "; got " + (*named ? named : Shown(document_->tree().source(value_))));
}

double Field::Number() const {
  if (kind() != JsonKind::kNumber) Fail("must be a number");
  return at().number;
}

double Field::Number(double low, double high) const {
  const double value = Number();
  if (!(value >= low && value <= high)) Fail("must be a number from " + ShortNumber(low) + " to " + ShortNumber(high));
  return value;
}

double Field::Positive(double most) const {
  const double value = Number();
  if (!(value >= 1e-30 && value <= most)) Fail("must be a positive number, at most " + ShortNumber(most));
  return value;
}

std::int64_t Field::Whole(std::int64_t low, std::int64_t high) const {
  const double value = kind() == JsonKind::kNumber ? at().number : 0.5;
  if (!(value == std::floor(value) && value >= static_cast<double>(low) && value <= static_cast<double>(high)))
    Fail(low == high ? "must be " + std::to_string(low)
                     : "must be a whole number from " + std::to_string(low) + " to " + std::to_string(high));
  return static_cast<std::int64_t>(value);
}

std::uint64_t Field::Seed() const {
  const std::string_view text = document_->tree().source(value_);
  std::uint64_t seed = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), seed);
  if (error != std::errc() || end != text.data() + text.size()) Fail("must be a whole number from 0 to 2^64 - 1");
  return seed;
}

bool Field::Bool() const {
  if (kind() != JsonKind::kTrue && kind() != JsonKind::kFalse) Fail("must be true or false");
  return kind() == JsonKind::kTrue;
}

std::string Field::Text(size_t most) const {
  if (kind() != JsonKind::kString) Fail("must be a string");
  std::string text = document_->tree().text(value_);
  if (text.size() > most) Fail("must have at most " + std::to_string(most) + " bytes");
  return text;
}

size_t Field::Choice(std::span<const char* const> names) const {
  std::string all;
  for (const char* name : names) all += (all.empty() ? "" : ", ") + std::string(name);
  if (kind() == JsonKind::kString) {
    const std::string text = document_->tree().text(value_);
    for (size_t i = 0; i < names.size(); ++i)
      if (text == names[i]) return i;
  }
  Fail("must be one of " + all);
}

std::vector<Field> Field::Items(size_t least, size_t most) const {
  if (kind() != JsonKind::kArray) Fail("must be an array");
  std::vector<Field> items;
  for (std::uint32_t item = value_ + 1; item < at().next; item = document_->tree().at(item).next)
    items.emplace_back(document_, item);
  if (items.size() < least || items.size() > most) {
    const std::string count =
        least == most ? std::to_string(least) : std::to_string(least) + " to " + std::to_string(most);
    Refuse("must be an array of " + count + " values; got " + std::to_string(items.size()));
  }
  return items;
}

Vector3 Field::Vector() const {
  if (kind() != JsonKind::kArray) Fail("must be an array of three numbers");
  const std::vector<Field> items = Items(3, 3);
  return {items[0].Number(-1e30, 1e30), items[1].Number(-1e30, 1e30), items[2].Number(-1e30, 1e30)};
}

Vector3 Field::UnitVector() const {
  const Vector3 vector = Vector();
  const double length = vector.stableNorm();
  if (!(length >= 1e-30)) Refuse("must be a direction, and not of length 0");
  return vector / length;
}

Fields::Fields(const Field& object) : object_(object) {
  if (object.kind() != JsonKind::kObject) object.Fail("must be an object");
  const JsonTree& tree = object.document_->tree();
  for (std::uint32_t key = object.value_ + 1; key < object.at().next; key = tree.at(key + 1).next)
    members_.emplace_back(tree.text(key), Field(object.document_, key + 1));
}

Fields::Fields(const Field& object, std::span<const char* const> known) : Fields(object) {
  for (const auto& [name, field] : members_) {
    if (std::find(known.begin(), known.end(), name) != known.end()) continue;
    const std::string_view nearest = NearestName(name, known);
    if (EditDistance(name, nearest) <= std::max<int>(1, static_cast<int>(name.size()) / 3))
      field.Refuse("there is no such key here; did you mean \"" + std::string(nearest) + "\"?");
    std::string all;
    for (const char* const key : known) all += (all.empty() ? "" : ", ") + std::string(key);
    field.Refuse("there is no such key here; there are " + all);
  }
}

std::optional<Field> Fields::Get(std::string_view key) const {
  for (const auto& [name, field] : members_)
    if (name == key) return field;
  return std::nullopt;
}

Field Fields::Need(std::string_view key) const {
  if (const std::optional<Field> field = Get(key)) return *field;
  object_.Refuse("needs \"" + std::string(key) + "\"");
}

std::string_view Fields::One(std::initializer_list<const char*> keys) const {
  std::string all;
  std::string_view found;
  for (const char* key : keys) {
    all += (all.empty() ? "\"" : ", \"") + std::string(key) + "\"";
    const std::optional<Field> field = Get(key);
    if (field && !found.empty()) field->Refuse("stands beside \"" + std::string(found) + "\"; only one of them may");
    if (field) found = key;
  }
  if (found.empty()) object_.Refuse("needs one of " + all);
  return found;
}

}  // namespace islet
