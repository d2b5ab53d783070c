// Messages of a page: what is understood, what is refused and how, and that no text does harm.
#include "scenes/live/command.h"

#include <gtest/gtest.h>

#include <random>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "scenes/printable.h"

namespace islet {
namespace {

using Kind = LiveCommand::Kind;

TEST(LiveCommand, IsRead) {
  EXPECT_EQ(ParseCommand(R"({"do": "run"})").kind, Kind::kRun);
  EXPECT_EQ(ParseCommand(R"({"do": "pause"})").kind, Kind::kPause);
  EXPECT_EQ(ParseCommand(R"({"do": "step"})").kind, Kind::kStep);
  EXPECT_EQ(ParseCommand(R"({"do": "release"})").kind, Kind::kRelease);
  const LiveCommand ball =
      ParseCommand(R"({"do": "throw", "from": [1, 2.5, -3], "velocity": [0, 1e1, 0], "radius": 0.25, "density": 2})");
  EXPECT_EQ(ball.kind, Kind::kThrow);
  EXPECT_EQ(ball.from, Vector3(1, 2.5, -3));
  EXPECT_EQ(ball.vector, Vector3(0, 10, 0));
  EXPECT_EQ(ball.radius, 0.25);
  EXPECT_EQ(ball.density, 2);
  EXPECT_EQ(
      ParseCommand(R"({"do": "throw", "from": [0, 0, 0], "velocity": [0, 0, 0], "radius": 0.05, "density": 4091.7})")
          .density,
      4091.7);
  const LiveCommand drag = ParseCommand(R"({"do": "drag", "body": 7, "at": [0, 0, 0.5], "to": [4, 5, 6]})");
  EXPECT_EQ(drag.kind, Kind::kDrag);
  EXPECT_EQ(drag.body, 7);
  EXPECT_EQ(drag.from, Vector3(0, 0, 0.5));
  EXPECT_EQ(drag.vector, Vector3(4, 5, 6));
  EXPECT_EQ(ParseCommand(R"({"do": "gravity", "value": [0, 0, -1.6]})").vector, Vector3(0, 0, -1.6));
  EXPECT_EQ(ParseCommand(R"({"do": "friction", "value": 0.1})").value, 0.1);
}

TEST(LiveCommand, WhatIsWrongIsNamed) {
  const std::vector<std::pair<std::string, std::string>> bad{
      {"", "text"},
      {"run", "text"},
      {"[1]", "text"},
      {R"({"do": "run"} x)", "text"},
      {"{}", "do is missing"},
      {R"({"do": 3})", "do must be a string; got 3"},
      {R"({"do": "explode"})", "explode"},
      {R"({"do": "run", "fast": 1})", "fast"},
      {R"({"do": "throw"})", "from is missing"},
      {R"({"do": "throw", "from": [1, 2], "velocity": [0, 0, 0], "radius": 1, "density": 1})", "from must be three"},
      {R"({"do": "throw", "from": [1, 2, "3"], "velocity": [0, 0, 0], "radius": 1, "density": 1})", "from must be"},
      {R"({"do": "throw", "from": [1, 2, 3], "velocity": [0, 0, 1e9], "radius": 1, "density": 1})", "velocity must"},
      {R"({"do": "throw", "from": [1, 2, 3], "velocity": [0, 0, 0], "radius": 0, "density": 1})", "radius must be in"},
      {R"({"do": "throw", "from": [1, 2, 3], "velocity": [0, 0, 0], "radius": -1, "density": 1})", "got -1"},
      {R"({"do": "throw", "from": [1, 2, 3], "velocity": [0, 0, 0], "radius": 1, "density": null})", "density must"},
      {R"({"do": "throw", "from": [1, 2, 3], "velocity": [0, 0, 0], "radius": 1, "density": 1e7})",
       "[0.001, 1000000.0]"},
      {R"({"do": "throw", "from": [1, 2, 3], "velocity": [0, 0, 0], "radius": 1, "density": 0})", "density must be in"},
      {R"({"do": "drag", "body": -1, "at": [0, 0, 0], "to": [0, 0, 0]})", "body must be a whole"},
      {R"({"do": "drag", "body": 1.5, "at": [0, 0, 0], "to": [0, 0, 0]})", "got 1.5"},
      {R"({"do": "drag", "body": 99999999999999999999, "at": [0, 0, 0], "to": [0, 0, 0]})", "body must"},
      {R"({"do": "gravity", "value": [0, 0, -1e5]})", "value must be within"},
      {R"({"do": "gravity", "value": [0, 0, 1e999]})", "text"},
      {R"({"do": "friction", "value": -0.5})", "value must be in"},
      {R"({"do": "friction", "value": NaN})", "text"},
      {std::string(kLongestCommand + 1, ' '), "length must be at most 4096"},
      {std::string(kLongestCommand, '['), "text must be a JSON object"},
      {"{\"do\": \"\xff\xfe\"}", "text"},
      {std::string(59, ' ') + "\xc3\xa4", "text"},  // cut within a character
      {R"({"do": "run", "\u001b[2J": 1})", "?[2J"},
  };
  for (const auto& [text, part] : bad) {
    try {
      ParseCommand(text);
      ADD_FAILURE() << "taken: " << text.substr(0, 80);
    } catch (const std::invalid_argument& error) {
      EXPECT_NE(std::string(error.what()).find(part), std::string::npos) << error.what();
      EXPECT_LT(std::string(error.what()).size(), 200u);
      EXPECT_EQ(Printable(error.what()), error.what());  // also where it quotes what is no UTF-8
    }
  }
}

// What changes a good message at random is read or refused, and nothing else.
TEST(LiveCommand, NoTextDoesHarm) {
  std::mt19937 random(1);
  const std::string good =
      R"({"do": "throw", "from": [1, 2.5, -3], "velocity": [0, 1e1, 0], "radius": 0.25, "density": 2})";
  int refused = 0;
  for (int k = 0; k < 20000; ++k) {
    std::string text = good;
    for (unsigned n = random() % 4 + 1; n > 0; --n) {
      const size_t at = random() % text.size();
      switch (random() % 3) {
        case 0:
          text[at] = static_cast<char>(random() % 256);
          break;
        case 1:
          text.erase(at, random() % 8 + 1);
          break;
        default:
          text.insert(at, text.substr(random() % text.size(), random() % 8));
          break;
      }
      if (text.empty()) text.push_back('{');
    }
    try {
      const LiveCommand command = ParseCommand(text);
      EXPECT_TRUE(command.from.allFinite() && command.vector.allFinite() && command.radius > 0);
    } catch (const std::invalid_argument&) {
      ++refused;
    }
  }
  EXPECT_GT(refused, 10000);
}

}  // namespace
}  // namespace islet
