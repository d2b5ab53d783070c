// What a live page is sent: the page itself, its head, and frames that are read like those of a page that was written.
#include "scenes/viewer/live_page.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <sstream>
#include <stdexcept>

#include "tests/scenes/viewer/page_reader.h"
#include "tests/support/worlds.h"

namespace islet {
namespace {

constexpr double kPositionStep = 1.0 / 8192;

World StackOfTwo() {
  World world(testing::Awake());
  world.Add(testing::Floor());
  world.Add(testing::Cube({0, 0, 0.5}));
  world.Add(testing::Cube({0.1, 0, 1.5}));
  return world;
}

FilmHead Head(const World& world) { return HeadOf(world, 1.0 / 60, "two", "islet run two", std::nullopt); }

// The two blocks of a line, where those of a written page are.
std::string AsPage(const std::string& line) {
  std::istringstream pieces(line);
  std::string bodies, contacts;
  pieces >> bodies >> contacts;
  return "<script type=\"text/plain\" id=\"bodies0\">" + bodies +
         "</script><script type=\"text/plain\" id=\"contacts0\">" + contacts + "</script>";
}

TEST(LivePage, IsThePageWithoutAFilm) {
  const std::string page = LivePage();
  EXPECT_NE(page.find("<script type=\"text/plain\" id=\"live\"></script>"), std::string::npos);
  EXPECT_EQ(page.find("islet:data"), std::string::npos);
  EXPECT_EQ(page.find("<script type=\"application/json\" id=\"head\">"), std::string::npos);
}

TEST(LivePage, EachFrameIsReadAlone) {
  World world = StackOfTwo();
  const nlohmann::json head = nlohmann::json::parse(LiveHead(Head(world), kPositionStep));
  EXPECT_EQ(head["start"], "live");
  for (int step = 1; step <= 3; ++step) {
    const StepReport report = world.Step(1.0 / 60);
    const FilmFrame frame = FrameOf(world, report, step, 0.25, 0);
    const std::string line = LiveFrame(Head(world), frame, kPositionStep);
    EXPECT_EQ(line.find_first_of("\r\n"), std::string::npos);  // of an event of the stream
    const std::vector<page_reader::Frame> read = page_reader::ReadChunk(AsPage(line), head, 0);
    ASSERT_EQ(read.size(), 1u);
    ASSERT_EQ(read[0].poses.size(), 3u);
    for (int i = 0; i < 3; ++i)
      for (int k = 0; k < 3; ++k) EXPECT_NEAR(read[0].poses[i][k], world.body(i).position_W[k], kPositionStep);
    EXPECT_EQ(read[0].contacts.size(), frame.contacts.size());
    EXPECT_EQ(read[0].contacts_all, frame.contacts.size());

    const std::string bytes = page_reader::FromBase64(line.substr(line.rfind(' ') + 1));
    ASSERT_EQ(bytes.size(), 8 * head["numbers"].size());
    double number, time, seconds;
    std::memcpy(&number, bytes.data(), 8);
    std::memcpy(&time, bytes.data() + 8, 8);
    std::memcpy(&seconds, bytes.data() + 8 * 7, 8);
    EXPECT_EQ(head["numbers"][7], "step_seconds");
    EXPECT_EQ(number, step);
    EXPECT_EQ(time, world.time());
    EXPECT_EQ(seconds, 0.25);
  }
}

TEST(LivePage, ABodyThatIsAddedIsInHeadAndFrame) {
  World world = StackOfTwo();
  world.Step(1.0 / 60);
  world.Add({.shape = Shape::Sphere(0.25), .position_W = {-3, 0, 1}});
  const nlohmann::json head = nlohmann::json::parse(LiveHead(Head(world), kPositionStep));
  EXPECT_EQ(head["bodies"]["kind"].size(), 4u);
  EXPECT_EQ(head["shapes"][head["bodies"]["shape"][3].get<size_t>()]["kind"], "sphere");
  const std::string line = LiveFrame(Head(world), FrameOf(world, {}, 1, 0, 0), kPositionStep);
  EXPECT_NEAR(page_reader::ReadChunk(AsPage(line), head, 0)[0].poses[3][0], -3, kPositionStep);
}

TEST(LivePage, WhatIsNoPlaceIsRefused) {
  const World world = StackOfTwo();
  FilmFrame frame = FrameOf(world, {}, 5, 0, 0);
  frame.poses[1][0] = std::numeric_limits<float>::quiet_NaN();
  EXPECT_THROW(LiveFrame(Head(world), frame, kPositionStep), std::invalid_argument);
}

}  // namespace
}  // namespace islet
