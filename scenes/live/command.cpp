#include "scenes/live/command.h"

#include <array>
#include <cmath>
#include <nlohmann/json.hpp>
#include <set>
#include <stdexcept>
#include <string>
#include <utility>

#include "scenes/printable.h"

namespace islet {
namespace {

using Json = nlohmann::json;

constexpr double kFarthest = 1e6;      // [m], [m/s]
constexpr double kMostGravity = 1e3;   // [m/s^2]
constexpr double kMostFriction = 1e4;  // as World takes it
constexpr size_t kShown = 60;          // characters of a message that an error quotes

[[noreturn]] void Reject(const std::string& field, const std::string& value, const std::string& rule) {
  throw std::invalid_argument(Printable("message: " + field + " " + rule + "; got " + value.substr(0, kShown)));
}

std::string Text(const Json& value) { return value.dump(-1, ' ', true, Json::error_handler_t::replace); }

const Json& Field(const Json& message, const char* name) {
  const auto found = message.find(name);
  if (found == message.end()) Reject(name, Text(message), "is missing");
  return *found;
}

double Number(const Json& message, const char* name, double low, double high) {
  const Json& value = Field(message, name);
  if (!value.is_number()) Reject(name, Text(value), "must be a number");
  const double number = value.get<double>();
  if (!(number >= low && number <= high))
    Reject(name, Text(value), "must be in [" + Text(Json(low)) + ", " + Text(Json(high)) + "]");
  return number;
}

Vector3 Vector(const Json& message, const char* name, double most) {
  const Json& value = Field(message, name);
  if (!value.is_array() || value.size() != 3) Reject(name, Text(value), "must be three numbers");
  Vector3 vector;
  for (int k = 0; k < 3; ++k) {
    if (!value[k].is_number()) Reject(name, Text(value), "must be three numbers");
    vector[k] = value[k].get<double>();
    if (!(std::abs(vector[k]) <= most)) Reject(name, Text(value), "must be within " + Text(Json(most)));
  }
  return vector;
}

int Whole(const Json& message, const char* name) {
  const Json& value = Field(message, name);
  if (!value.is_number_integer() || value < 0 || value > 1'000'000'000)
    Reject(name, Text(value), "must be a whole number >= 0");
  return value.get<int>();
}

void AllowOnly(const Json& message, const std::set<std::string>& names) {
  for (const auto& [name, value] : message.items())
    if (name != "do" && !names.contains(name))
      Reject(name, Text(value), "is no field of \"" + message["do"].get<std::string>() + "\"");
}

}  // namespace

LiveCommand ParseCommand(std::string_view text) {
  if (text.size() > kLongestCommand)
    Reject("length", std::to_string(text.size()), "must be at most " + std::to_string(kLongestCommand));
  const Json message = Json::parse(text, nullptr, /*allow_exceptions=*/false);
  if (!message.is_object()) Reject("text", std::string(text), "must be a JSON object");
  const Json& what = Field(message, "do");
  if (!what.is_string()) Reject("do", Text(what), "must be a string");
  using Kind = LiveCommand::Kind;
  const std::string name = what.get<std::string>();
  LiveCommand command;
  if (name == "run" || name == "pause" || name == "step" || name == "release") {
    AllowOnly(message, {});
    command.kind = name == "run"     ? Kind::kRun
                   : name == "pause" ? Kind::kPause
                   : name == "step"  ? Kind::kStep
                                     : Kind::kRelease;
  } else if (name == "throw") {
    AllowOnly(message, {"from", "velocity", "radius", "density"});
    command.kind = Kind::kThrow;
    command.from = Vector(message, "from", kFarthest);
    command.vector = Vector(message, "velocity", kFarthest);
    command.radius = Number(message, "radius", kSmallestBall, kLargestBall);
    command.density = Number(message, "density", kLightestBall, kHeaviestBall);
  } else if (name == "drag") {
    AllowOnly(message, {"body", "at", "to"});
    command.kind = Kind::kDrag;
    command.body = Whole(message, "body");
    command.from = Vector(message, "at", kFarthest);
    command.vector = Vector(message, "to", kFarthest);
  } else if (name == "gravity") {
    AllowOnly(message, {"value"});
    command.kind = Kind::kGravity;
    command.vector = Vector(message, "value", kMostGravity);
  } else if (name == "friction") {
    AllowOnly(message, {"value"});
    command.kind = Kind::kFriction;
    command.value = Number(message, "value", 0, kMostFriction);
  } else {
    Reject("do", Text(what), "must be run, pause, step, throw, drag, release, gravity or friction");
  }
  return command;
}

}  // namespace islet
