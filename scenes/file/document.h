// A scene file as it was read, and its values with the questions that a reader asks: is it a number, is it in range, which keys
// does it have. Each answer that is not wanted is an error that names file, line, column, path and value.
//
//   in:  a file of at most kMostFileBytes, or a text      out: Document, Field, Fields
//   errors: std::invalid_argument: `FILE:12:20: bodies[3].shape.radius: must be a positive number; got -1`
//   threads: const use from any thread; a Field refers to its Document
#pragma once

#include <cstddef>
#include <cstdint>
#include <initializer_list>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "engine/linear_algebra.h"
#include "scenes/file/json_tree.h"

namespace islet {

inline constexpr size_t kMostFileBytes = 32u << 20;

// The text of a scene file.
std::string ReadSceneText(const std::string& path);

// Of at most so many bytes; `what` names it in messages: "a scene file".
std::string ReadWholeFile(const std::string& path, size_t most_bytes, const std::string& what);

class Field;

class Document {
 public:
  Document(std::string name, std::string text);  // name: what messages call it
  Document(const Document&) = delete;            // fields refer to it
  Document& operator=(const Document&) = delete;

  const std::string& name() const { return name_; }
  std::string folder() const;  // of the file, "" or with a slash at the end
  const JsonTree& tree() const { return *tree_; }
  Field root() const;

 private:
  std::string name_, text_;
  std::optional<JsonTree> tree_;
};

// One value of a document.
class Field {
 public:
  Field(const Document* document, std::uint32_t value) : document_(document), value_(value) {}

  JsonKind kind() const { return at().kind; }
  std::string Label() const;  // `FILE:12:20: bodies[3]`

  [[noreturn]] void Fail(const std::string& rule) const;   // adds the value
  [[noreturn]] void Refuse(const std::string& why) const;  // does not

  double Number() const;                         // any that is finite
  double Number(double low, double high) const;  // both included
  double Positive(double most = 1e30) const;     // [1e-30, most]
  std::int64_t Whole(std::int64_t low, std::int64_t high) const;
  std::uint64_t Seed() const;  // any whole number of 64 bits
  bool Bool() const;
  std::string Text(size_t most = 10'000) const;
  size_t Choice(std::span<const char* const> names) const;    // which of them it is
  std::vector<Field> Items(size_t least, size_t most) const;  // of an array
  Vector3 Vector() const;                                     // three numbers
  Vector3 UnitVector() const;                                 // a direction of any length but 0, made one of length 1

 private:
  const JsonTree::Value& at() const { return document_->tree().at(value_); }

  const Document* document_;
  std::uint32_t value_;
  friend class Fields;
};

// An object, of which all keys must be known.
class Fields {
 public:
  explicit Fields(const Field& object);  // whose keys are names that the user made up: any are known
  Fields(const Field& object, std::span<const char* const> known);
  Fields(const Field& object, std::initializer_list<const char*> known)
      : Fields(object, std::span<const char* const>(known.begin(), known.size())) {}

  const Field& object() const { return object_; }
  std::optional<Field> Get(std::string_view key) const;
  Field Need(std::string_view key) const;
  // The one of these keys that is there; an error if there is none, or another beside it.
  std::string_view One(std::initializer_list<const char*> keys) const;
  const std::vector<std::pair<std::string, Field>>& members() const { return members_; }

 private:
  Field object_;
  std::vector<std::pair<std::string, Field>> members_;
};

}  // namespace islet
