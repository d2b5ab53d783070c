// JSON text -> a flat list of its values, each with the place where it stands, so that whoever finds a value wrong can say where.
//
//   in:  UTF-8 text                       out: JsonTree; it refers to the text, which must outlive it
//   errors: JsonError with line, column and path: what is not JSON, numbers beyond a double, a key twice in one object, more than
//           kMostDepth levels, more than kMostValues values, more than 10,000 members of an object, strings of more than 100,000 bytes
//   cost: time and memory in proportion to the text, 24 bytes a value; nothing recurses
//   threads: pure
#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <stdexcept>
#include <string>
#include <string_view>

namespace islet {

struct JsonPlace {
  int line = 1, column = 1;  // from 1; columns count bytes
};

class JsonError : public std::runtime_error {
 public:
  JsonError(JsonPlace where, std::string in, const std::string& what)
      : std::runtime_error(what), place(where), path(std::move(in)) {}
  JsonPlace place;
  std::string path;  // `bodies[3].shape.radius`; empty: the whole document
};

enum class JsonKind : std::uint8_t { kNull, kFalse, kTrue, kNumber, kString, kArray, kObject };

class JsonTree {
 public:
  static constexpr int kMostDepth = 32;
  static constexpr size_t kMostValues = 2'000'000;

  struct Value {
    JsonKind kind = JsonKind::kNull;
    std::uint32_t begin = 0;  // [bytes] of its first letter
    std::uint32_t end = 0;    // [bytes] behind its last letter
    std::uint32_t next = 0;   // the number of what follows it and all that it holds
    double number = 0;        // of a number
  };

  explicit JsonTree(std::string_view text);

  // Values are numbered as they stand; 0 is the document. In an object a member is two values: its key, a string, and what it has.
  const Value& at(std::uint32_t value) const { return values_[value]; }
  std::string_view source(std::uint32_t value) const;  // as it is written
  std::string text(std::uint32_t value) const;         // of a string
  JsonPlace place(std::uint32_t value) const;          // takes time in proportion to the text before it
  std::string path(std::uint32_t value) const;         // takes time in proportion to the values before it

 private:
  std::string_view text_;
  std::deque<Value> values_;  // which never moves, so that growing takes no second copy
};

JsonPlace PlaceIn(std::string_view text, size_t byte);

std::string JsonQuoted(const std::string& text);  // as a JSON string; what is not UTF-8 is replaced

// As messages show it: at most 60 letters, nothing that a terminal would obey.
std::string Shown(std::string_view text);

}  // namespace islet
