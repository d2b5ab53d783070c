// Documents that scene files may be and may not be, from documents.json, which the schema is held to as well.
#include "scenes/file/scene_reader.h"

#include <gtest/gtest.h>

#include <fstream>
#include <memory>
#include <nlohmann/json.hpp>
#include <regex>
#include <stdexcept>
#include <string>

#include "scenes/file/drives.h"
#include "scenes/file/probes.h"
#include "scenes/file/scene_maker.h"

namespace islet {
namespace {

using Json = nlohmann::json;

Json Documents() {
  return Json::parse(std::ifstream(std::string(ISLET_SOURCES) + "/tests/scenes/file/documents.json"));
}

std::string Base(const Json& documents) {
  std::string text;
  for (const Json& line : documents["base"]) text += line.get<std::string>() + "\n";
  return text;
}

std::string Changed(std::string text, const Json& change) {
  const std::string find = change["find"];
  const size_t at = text.find(find);
  EXPECT_NE(at, std::string::npos) << change["name"];
  return text.replace(at, find.size(), change["replace"].get<std::string>());
}

// Reads and makes all that a file says; the message of the error, or nothing.
std::string Problem(const std::string& text) {
  try {
    const SceneDescription description = ReadScene(std::make_shared<const Document>("a.json", text));
    Settings settings = description.settings;
    settings.threads = 1;
    const MadeScene made = MakeScene(description, settings, description.seed);
    const Drives drives(description, made);
    const Probes probes(description, made);
    return "";
  } catch (const std::invalid_argument& error) {
    return error.what();
  }
}

TEST(SceneReader, TakesGoodDocuments) {
  const Json documents = Documents();
  for (const Json& good : documents["good"]) EXPECT_EQ(Problem(Changed(Base(documents), good)), "") << good["name"];
}

TEST(SceneReader, NamesLinePathAndValueOfWhatIsBad) {
  const Json documents = Documents();
  ASSERT_GE(documents["bad"].size(), 40u);
  for (const Json& bad : documents["bad"]) {
    const std::string problem = Problem(Changed(Base(documents), bad));
    std::smatch parts;
    ASSERT_TRUE(std::regex_match(problem, parts, std::regex("a\\.json:(\\d+):(\\d+): (.*?): ([^]*)")))
        << bad["name"] << ": " << problem;
    EXPECT_EQ(parts[1], std::to_string(bad["line"].get<int>())) << bad["name"] << ": " << problem;
    EXPECT_EQ(parts[3], bad["path"].get<std::string>()) << bad["name"] << ": " << problem;
    const std::string says = parts[4];
    EXPECT_TRUE(std::regex_search(says, std::regex(bad["says"].get<std::string>()))) << bad["name"] << ": " << problem;
    EXPECT_EQ(says.find('\n'), std::string::npos) << problem;
  }
}

TEST(SceneReader, TellsTheColumn) {
  EXPECT_EQ(Problem("{\"version\": 1,\n  \"bodies\": [],  \"seed\": -4}"),
            "a.json:2:26: seed: must be a whole number from 0 to 2^64 - 1; got -4");
}

TEST(SceneReader, CutsLongValuesAndControlLettersInMessages) {
  const std::string problem =
      Problem("{\"version\": 1, \"bodies\": [], \"title\": 3, \"" + std::string(5000, 'x') + "\": 1}");
  EXPECT_LT(problem.size(), 400u);
  EXPECT_EQ(Problem("{\"version\": 1, \"bodies\": [], \"\\u001b[31m\": 1}").find('\x1b'), std::string::npos);
}

// What was read is what the file says.
TEST(SceneReader, ReadsNumbersToTheLastBit) {
  const SceneDescription scene = ReadScene(std::make_shared<const Document>(
      "a.json",
      "{\"version\": 1, \"gravity\": [0.1, -0.0, 4.9406564584124654e-324], \"bodies\": [{\"shape\": {\"type\": "
      "\"sphere\", \"radius\": 0.30000000000000004}, \"mass\": 1.7976931348623157e0, \"position\": [-0, 1e22, 7]}]}"));
  EXPECT_EQ(scene.settings.gravity.x(), 0.1);
  EXPECT_TRUE(std::signbit(scene.settings.gravity.y()));
  EXPECT_EQ(scene.settings.gravity.z(), 4.9406564584124654e-324);
  EXPECT_EQ(scene.bodies[0].definition.shape.radius(), 0.30000000000000004);
  EXPECT_EQ(scene.bodies[0].definition.mass, 1.7976931348623157);
  EXPECT_TRUE(std::signbit(scene.bodies[0].definition.position_W.x()));
  EXPECT_EQ(scene.bodies[0].definition.position_W.y(), 1e22);
}

SceneDescription ReadBodies(const std::string& bodies) {
  return ReadScene(std::make_shared<const Document>("a.json", "{\"version\": 1, \"bodies\": [" + bodies + "]}"));
}

TEST(SceneMaker, RepeatsInGridsAndStacks) {
  const SceneDescription scene = ReadBodies(
      "{\"shape\": {\"type\": \"sphere\", \"radius\": 0.5}, \"mass\": 1, \"position\": [1, 2, 3], \"grid\": "
      "{\"counts\": "
      "[2, 1, 2], \"spacing\": [10, 0, 20]}}, {\"shape\": {\"type\": \"sphere\", \"radius\": 0.1}, \"mass\": 1, "
      "\"position\": "
      "[1, 0, 0], \"stack\": {\"count\": 4, \"step\": [0, 0, 0.5], \"turn\": {\"axis\": [0, 0, 1], \"degrees\": 90}, "
      "\"about\": [0, 0, 0]}}");
  Settings settings;
  settings.threads = 1;
  const MadeScene made = MakeScene(scene, settings, 0);
  const Vector3 expected[] = {{1, 2, 3}, {11, 2, 3},  {1, 2, 23}, {11, 2, 23},
                              {1, 0, 0}, {0, 1, 0.5}, {-1, 0, 1}, {0, -1, 1.5}};
  ASSERT_EQ(made.world.bodies().size(), std::size(expected));
  for (size_t i = 0; i < std::size(expected); ++i)
    EXPECT_LT((made.world.bodies()[i].position_W - expected[i]).norm(), 1e-14) << i;
  EXPECT_EQ(made.info.bodies, 8);
  EXPECT_EQ(made.info.smallest_size, 0.2);
}

TEST(SceneMaker, SetsTheCentreOfMassOfAHullFromItsPoints) {
  const std::string hull =
      "\"shape\": {\"type\": \"convex_hull\", \"points\": [[0, 0, 0], [4, 0, 0], [0, 4, 0], [0, 0, 4]]}, \"mass\": 1, "
      "\"position\": [10, 0, 0], \"rotation\": {\"axis\": [0, 0, 1], \"degrees\": 90}";
  Settings settings;
  settings.threads = 1;
  const MadeScene made =
      MakeScene(ReadBodies("{" + hull + "}, {\"origin\": \"points\", \"sensor\": true, " + hull + "}"), settings, 0);
  EXPECT_LT((made.world.body(0).position_W - Vector3(10, 0, 0)).norm(), 1e-15);
  EXPECT_LT((made.world.body(1).position_W - Vector3(9, 1, 1)).norm(), 1e-14);
}

MadeScene Make(const std::string& region, std::uint64_t seed) {
  Settings settings;
  settings.threads = 1;
  return MakeScene(ReadBodies("{\"shape\": {\"type\": \"box\", \"half_extents\": [0.1, 0.1, 0.2]}, \"mass\": 1, "
                              "\"cloud\": {\"count\": 200, " +
                              region + "}}"),
                   settings, seed);
}

class Cloud : public testing::TestWithParam<const char*> {};

TEST_P(Cloud, IsTheSameForTheSameSeedInsideAndApart) {
  const MadeScene a = Make(GetParam(), 5), b = Make(GetParam(), 5), c = Make(GetParam(), 6);
  EXPECT_EQ(a.world.StateHash(), b.world.StateHash());
  EXPECT_NE(a.world.StateHash(), c.world.StateHash());
  const double radius = a.world.shape(0).radius();
  for (size_t i = 0; i < a.world.bodies().size(); ++i) {
    const Vector3& p = a.world.bodies()[i].position_W;
    if (std::string(GetParam()).starts_with("\"box\"")) {
      EXPECT_LE(p.cwiseAbs().maxCoeff(), 3 - radius);
    } else {
      EXPECT_LE((p - Vector3(1, 2, 3)).norm(), 3 - radius + 1e-12);
    }
    for (size_t j = 0; j < i; ++j) EXPECT_GE((a.world.bodies()[j].position_W - p).norm(), 2 * radius);
  }
}

INSTANTIATE_TEST_SUITE_P(Regions, Cloud,
                         testing::Values("\"box\": {\"lower\": [-3, -3, -3], \"upper\": [3, 3, 3]}",
                                         "\"ball\": {\"centre\": [1, 2, 3], \"radius\": 3}"));

// A seed of its own is all that decides; the first place as another program draws it.
TEST(SceneMaker, DrawsACloudTheSameWayEverywhere) {
  const MadeScene made = Make("\"seed\": 1, \"box\": {\"lower\": [-3, -3, -3], \"upper\": [3, 3, 3]}", 9);
  const MadeScene other = Make("\"seed\": 1, \"box\": {\"lower\": [-3, -3, -3], \"upper\": [3, 3, 3]}", 10);
  EXPECT_EQ(made.world.StateHash(), other.world.StateHash());
  EXPECT_NEAR(made.world.body(0).position_W.x(), 0.3667610719040866, 1e-12);
}

}  // namespace
}  // namespace islet
