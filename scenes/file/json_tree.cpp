#include "scenes/file/json_tree.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <set>
#include <vector>

#include "scenes/printable.h"

namespace islet {
namespace {

using Json = nlohmann::json;

constexpr size_t kMostStringBytes = 100'000;
constexpr size_t kMostWordBytes = 1000;
constexpr size_t kMostMembers = 10'000;  // of an object: their names are held while it is read

bool IsWord(std::string_view key) {
  return !key.empty() && std::all_of(key.begin(), key.end(), [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '_' || c == '$';
  });
}

std::string Member(const std::string& path, const std::string& key) {
  if (!IsWord(key)) return path + "[\"" + Shown(key) + "\"]";
  return path.empty() ? Shown(key) : path + "." + Shown(key);
}

// Where the next value begins and ends is found by walking along the text: the parser has just accepted it.
class Reader : public nlohmann::json_sax<Json> {
 public:
  Reader(std::string_view text, std::deque<JsonTree::Value>* values) : text_(text), values_(*values) {
    if (text.substr(0, 3) == "\xef\xbb\xbf") cursor_ = 3;
  }

  bool null() override { return Word(JsonKind::kNull, 4); }
  bool boolean(bool yes) override { return yes ? Word(JsonKind::kTrue, 4) : Word(JsonKind::kFalse, 5); }
  bool number_integer(number_integer_t value) override { return Number(static_cast<double>(value)); }
  bool number_unsigned(number_unsigned_t value) override { return Number(static_cast<double>(value)); }
  bool number_float(number_float_t value, const string_t&) override { return Number(value); }
  bool string(string_t&) override { return String(false); }
  bool binary(binary_t&) override { return false; }
  bool start_object(std::size_t) override { return Open(JsonKind::kObject); }
  bool start_array(std::size_t) override { return Open(JsonKind::kArray); }
  bool end_object() override { return Close(); }
  bool end_array() override { return Close(); }

  bool key(string_t& name) override {
    Level& level = open_.back();
    level.key = name;
    String(true);
    if (!level.keys.insert(name).second) Fail(values_.back().begin, Path(), "stands twice in the same object");
    if (level.keys.size() > kMostMembers)
      Fail(values_.back().begin, Path(), "is one too many: an object has at most 10000 members");
    return true;
  }

  bool parse_error(std::size_t, const std::string& token, const Json::exception& error) override {
    Skip();
    const std::string what = error.what();
    const size_t colon = what.rfind(": ", what.find("; last read"));
    std::string reason = colon == std::string::npos ? what : what.substr(colon + 2);
    reason = reason.substr(0, std::min(reason.find("; last read"), reason.find("; expected")));
    if (what.find("out_of_range") != std::string::npos) reason = "a number beyond the range of double precision";
    const std::string read = token.empty() ? "the end of the text" : Shown(token);
    Fail(std::min(cursor_, text_.size()), Path(), "is not JSON: " + Shown(reason) + "; got " + read);
  }

 private:
  struct Level {
    std::uint32_t value;
    std::set<std::string> keys;
    std::string key;  // of the member that is being read
    int entry = 0;    // of the entry that is being read
  };

  [[noreturn]] void Fail(size_t byte, const std::string& path, const std::string& what) const {
    throw JsonError(PlaceIn(text_, byte), path, what);
  }

  std::string Path() const {
    std::string path;
    for (const Level& level : open_) {
      if (values_[level.value].kind == JsonKind::kArray) {
        path.append(1, '[').append(std::to_string(level.entry)).append(1, ']');
      } else if (!level.key.empty()) {
        path = Member(path, level.key);
      }
    }
    return path;
  }

  // Over what stands between values.
  void Skip() {
    while (cursor_ < text_.size() && std::string_view(" \t\r\n,:").find(text_[cursor_]) != std::string_view::npos)
      ++cursor_;
  }

  std::uint32_t Begin(JsonKind kind) {
    Skip();
    if (values_.size() >= JsonTree::kMostValues)
      Fail(cursor_, Path(), "is one too many: a file holds at most 2000000 values and keys");
    const auto number = static_cast<std::uint32_t>(values_.size());
    values_.push_back({kind, static_cast<std::uint32_t>(cursor_), 0, number + 1, 0});
    return number;
  }

  bool End(size_t bytes) {
    cursor_ += bytes;
    values_.back().end = static_cast<std::uint32_t>(cursor_);
    return true;
  }

  bool Finish(bool is_key) {
    if (!is_key && !open_.empty()) ++open_.back().entry;
    return true;
  }

  bool Word(JsonKind kind, size_t length) {
    Begin(kind);
    End(length);
    return Finish(false);
  }

  bool Number(double value) {
    Begin(JsonKind::kNumber);
    const size_t end = text_.find_first_not_of("+-.0123456789eE", cursor_);
    const size_t length = std::min(end, text_.size()) - cursor_;
    // The parser takes -0 for a whole number, which has no sign.
    const bool minus_zero = value == 0 && text_[cursor_] == '-';
    values_.back().number = minus_zero ? -0.0 : value;
    End(length);
    return Finish(false);
  }

  bool String(bool is_key) {
    Begin(JsonKind::kString);
    size_t end = cursor_ + 1;
    while (text_[end] != '"') end += text_[end] == '\\' ? 2 : 1;
    return End(end + 1 - cursor_) && Finish(is_key);
  }

  bool Open(JsonKind kind) {
    const std::uint32_t number = Begin(kind);
    if (static_cast<int>(open_.size()) == JsonTree::kMostDepth)
      Fail(cursor_, Path(), "is nested too deeply: at most " + std::to_string(JsonTree::kMostDepth) + " levels");
    ++cursor_;
    open_.push_back({number, {}, {}, 0});
    return true;
  }

  bool Close() {
    Skip();
    ++cursor_;
    JsonTree::Value& value = values_[open_.back().value];
    value.end = static_cast<std::uint32_t>(cursor_);
    value.next = static_cast<std::uint32_t>(values_.size());
    open_.pop_back();
    return Finish(false);
  }

  std::string_view text_;
  std::deque<JsonTree::Value>& values_;
  size_t cursor_ = 0;
  std::vector<Level> open_;
};

// The parser holds a string or number twice before anyone can look at it; so those that are too long are found before.
void RequireShortWords(std::string_view text) {
  for (size_t begin = 0; begin < text.size();) {
    const bool string = text[begin] == '"';
    size_t end = begin + 1;
    if (string) {
      while (end < text.size() && text[end] != '"') end += text[end] == '\\' ? 2 : 1;
      ++end;
    } else {
      end = std::min(text.find_first_of(" \t\r\n,:[]{}\"", begin), text.size());
      if (end == begin) ++end;
    }
    if (end - begin > (string ? kMostStringBytes : kMostWordBytes))
      throw JsonError(
          PlaceIn(text, begin), "",
          string ? "a string is too long: at most 100000 bytes" : "a number is too long: at most 1000 bytes");
    begin = end;
  }
}

}  // namespace

JsonTree::JsonTree(std::string_view text) : text_(text) {
  RequireShortWords(text);
  Reader reader(text, &values_);
  if (!Json::sax_parse(text.begin(), text.end(), &reader)) throw JsonError({}, "", "is not JSON");
}

std::string_view JsonTree::source(std::uint32_t value) const {
  return text_.substr(at(value).begin, at(value).end - at(value).begin);
}

std::string JsonTree::text(std::uint32_t value) const {
  const std::string_view written = source(value);
  if (written.find('\\') == std::string_view::npos) return std::string(written.substr(1, written.size() - 2));
  return Json::parse(written).get<std::string>();
}

JsonPlace JsonTree::place(std::uint32_t value) const { return PlaceIn(text_, at(value).begin); }

std::string JsonTree::path(std::uint32_t value) const {
  std::string path;
  for (std::uint32_t holder = 0; holder != value;) {
    const bool object = at(holder).kind == JsonKind::kObject;
    std::uint32_t child = holder + 1;
    for (int entry = 0; child < at(holder).next; ++entry) {
      const std::uint32_t item = object ? child + 1 : child;
      if (value < at(item).next) {
        path = object ? Member(path, text(child)) : path + "[" + std::to_string(entry) + "]";
        if (value == child) return path;  // a key stands for its member
        holder = item;
        break;
      }
      child = at(item).next;
    }
  }
  return path;
}

JsonPlace PlaceIn(std::string_view text, size_t byte) {
  const std::string_view before = text.substr(0, byte);
  const size_t line_end = before.rfind('\n');
  return {static_cast<int>(std::count(before.begin(), before.end(), '\n')) + 1,
          static_cast<int>(line_end == std::string_view::npos ? byte : byte - line_end - 1) + 1};
}

std::string JsonQuoted(const std::string& text) {
  return Json(text).dump(-1, ' ', false, Json::error_handler_t::replace);
}

std::string Shown(std::string_view text) {
  constexpr size_t kMost = 60;
  const std::string shown = Printable(std::string(text.substr(0, kMost)));
  return text.size() > kMost ? shown + "..." : shown;
}

}  // namespace islet
