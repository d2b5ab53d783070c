// Drives against answers that are known, and the samples.
#include "scenes/file/drives.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <map>
#include <memory>
#include <numbers>
#include <sstream>
#include <string>
#include <vector>

#include "scenes/file/probes.h"
#include "scenes/file/scene_reader.h"

namespace islet {
namespace {

constexpr double kPi = std::numbers::pi;

struct Play {
  explicit Play(std::shared_ptr<const Document> document)
      : description(ReadScene(std::move(document))), made(Make(description)), drives(description, made) {}
  explicit Play(const std::string& text) : Play(std::make_shared<const Document>("a.json", text)) {}

  static MadeScene Make(const SceneDescription& description) {
    Settings settings = description.settings;
    settings.threads = 1;
    return MakeScene(description, settings, description.seed);
  }
  StepReport Step() {
    drives.Apply(frames++ * description.dt, description.dt, &made.world);
    return made.world.Step(description.dt);
  }
  const Body& body(int number) const { return made.world.body(number); }

  SceneDescription description;
  MadeScene made;
  Drives drives;
  int frames = 0;
};

const std::string kBall = "{\"name\": \"ball\", \"shape\": {\"type\": \"sphere\", \"radius\": 0.1}, \"mass\": 2}";

TEST(Drives, VelocityThatIsNotNamedStaysTheBodys) {
  Play play(
      "{\"version\": 1, \"bodies\": [{\"name\": \"wheel\", \"shape\": {\"type\": \"sphere\", \"radius\": 0.1}, "
      "\"kind\": \"kinematic\", "
      "\"velocity\": [1, 0, 0], \"angular_velocity\": [0, 3, 0]}], \"drives\": [{\"body\": \"wheel\", "
      "\"angular_velocity\": [0, 0, 2]}]}");
  play.Step();
  EXPECT_EQ(play.body(0).linear_velocity_W, Vector3(1, 0, 0));
  EXPECT_EQ(play.body(0).angular_velocity_W, Vector3(0, 0, 2));
}

// m x'' = A sin(w t + p): x' = A / (m w) (cos p - cos(w t + p)), x = A / (m w) (t cos p - (sin(w t + p) - sin p) / w).
TEST(Drives, SineForceMovesAFreeBodyAsTheIntegralSays) {
  double error[2];
  for (int fine : {0, 1}) {
    const double dt = fine ? 0.005 : 0.01;
    Play play(
        "{\"version\": 1, \"gravity\": [0, 0, 0], \"time\": {\"dt\": " + std::to_string(dt) + "}, \"bodies\": [" +
        kBall +
        "], \"drives\": [{\"body\": \"ball\", \"force\": [{\"sine\": {\"amplitude\": 3, \"frequency\": 0.5, \"phase\": "
        "0.4}}, 0, 0], \"torque\": [0, 0, 0.01]}]}");
    const double w = kPi, p = 0.4, a = 3.0 / 2 / w;
    error[fine] = 0;
    while (play.made.world.time() < 3 - 1e-9) {
      play.Step();
      const double t = play.made.world.time();
      EXPECT_NEAR(play.body(0).linear_velocity_W.x(), a * (std::cos(p) - std::cos(w * t + p)), 0.5 * dt * dt);
      const double x = a * (t * std::cos(p) - (std::sin(w * t + p) - std::sin(p)) / w);
      error[fine] = std::max(error[fine], std::abs(play.body(0).position_W.x() - x));
    }
    // Inertia 0.4 m r^2 = 0.008 kg m^2.
    EXPECT_NEAR(play.body(0).angular_velocity_W.z(), 0.01 / 0.008 * 3, 1e-12);
  }
  EXPECT_LT(error[0], 0.03);
  EXPECT_LT(error[1], 0.55 * error[0]) << "the step is at least of first order";
}

TEST(Drives, TableForceIsStraightBetweenItsRows) {
  Play play("{\"version\": 1, \"gravity\": [0, 0, 0], \"time\": {\"dt\": 0.01}, \"bodies\": [" + kBall +
            "], \"drives\": [{\"body\": 0, \"force\": [{\"table\": [[0.5, 0], [1.5, 4], [1.7, -2]]}, 0, 0]}]}");
  const auto at = [&](double time) {
    while (play.made.world.time() < time - 1e-9) play.Step();
    return 2 * play.body(0).linear_velocity_W.x();  // momentum
  };
  EXPECT_EQ(at(0.5), 0);
  EXPECT_NEAR(at(1.0), 0.5, 1e-12);
  EXPECT_NEAR(at(1.5), 2, 1e-12);
  EXPECT_NEAR(at(1.7), 2 + 0.2, 1e-12);
  EXPECT_NEAR(at(2.7), 2.2 - 2, 1e-12);
}

// A constant force of the body stays beside what a drive does.
TEST(Drives, ForceComesBesideThatOfTheBody) {
  Play play(
      "{\"version\": 1, \"gravity\": [0, 0, 0], \"bodies\": [{\"shape\": {\"type\": \"sphere\", \"radius\": 1}, "
      "\"mass\": 1, "
      "\"force\": [0, 2, 0]}], \"drives\": [{\"body\": 0, \"force\": [1, 0, 0]}]}");
  for (int i = 0; i < 30; ++i) play.Step();
  EXPECT_NEAR(play.body(0).linear_velocity_W.x(), 1, 1e-12);
  EXPECT_NEAR(play.body(0).linear_velocity_W.y(), 2, 1e-12);
}

TEST(Drives, GravityFollowsItsTable) {
  Play play("{\"version\": 1, \"time\": {\"dt\": 0.01}, \"bodies\": [" + kBall +
            "], \"drives\": [{\"gravity\": [0, 0, {\"table\": [[0, 0], [2, -10]]}]}]}");
  for (int i = 0; i < 200; ++i) play.Step();
  EXPECT_NEAR(play.body(0).linear_velocity_W.z(), -10, 1e-10);
}

// A turntable meets its pose at the end of every step, and takes along what lies on it: at 1 rad/s and 0.5 m it needs a friction of
// 0.5 / 9.81.
TEST(Drives, TurntableMeetsItsPosesAndTakesItsLoadAlong) {
  Play play(
      "{\"version\": 1, \"time\": {\"dt\": 0.01}, \"bodies\": [{\"name\": \"table\", \"shape\": {\"type\": "
      "\"cylinder\", "
      "\"radius\": 1, \"half_length\": 0.1}, \"kind\": \"kinematic\", \"position\": [0.2, 0, -0.1]}, {\"name\": "
      "\"cube\", "
      "\"shape\": {\"type\": \"box\", \"size\": [0.1, 0.1, 0.1]}, \"mass\": 1, \"position\": [0.5, 0, 0.05]}], "
      "\"drives\": "
      "[{\"body\": \"table\", \"turn\": {\"axis\": [0, 0, 2], \"centre\": [0, 0, 0], \"angle\": {\"table\": [[0, 0], "
      "[1, 0.5], "
      "[3, 2.5]]}}}]}");
  for (int i = 0; i < 400; ++i) {
    EXPECT_FALSE(play.Step().Failed());
    const double t = play.made.world.time();
    const double angle = t < 1 ? 0.5 * t : std::min(2.5, 0.5 + (t - 1));
    const Body& table = play.body(0);
    EXPECT_NEAR(table.position_W.x(), 0.2 * std::cos(angle), 1e-9) << t;
    EXPECT_NEAR(table.position_W.y(), 0.2 * std::sin(angle), 1e-9) << t;
    EXPECT_NEAR(table.rotation_WB.z(), std::sin(0.5 * angle), 1e-9) << t;
  }
  EXPECT_TRUE(play.body(0).linear_velocity_W.isZero(0)) << "it stands to the last bit once its table ends";
  EXPECT_TRUE(play.body(1).frozen);
  const Vector3 cube = play.body(1).position_W;
  // Where the table's rate jumps by w the cube slides by (w r)^2 / (2 mu g): twice back by 0.5 rad/s, once on by 1 rad/s.
  const double slide = (std::pow(1.0, 2) - 2 * std::pow(0.5, 2)) * 0.5 / (2 * 0.5 * 9.81);  // [rad]
  EXPECT_NEAR(std::atan2(cube.y(), cube.x()), 2.5 + slide, 5e-3);
  EXPECT_NEAR(std::hypot(cube.x(), cube.y()), 0.5, 1e-2);
}

// More than half a turn in a step, and whole ones, go round the way that the table says.
TEST(Drives, FansTurnAsFastAsTheirTableSays) {
  for (const double speed : {10.0, 104.72, 60 * M_PI, 400.0}) {
    std::ostringstream text;
    text.precision(17);
    text << "{\"version\": 1, \"time\": {\"dt\": " << 1.0 / 30
         << "}, \"bodies\": [{\"name\": \"fan\", \"kind\": \"kinematic\", \"position\": [1, 2, 3], \"shape\": "
            "{\"type\": "
            "\"box\", \"size\": [1, 1, 1]}}], \"drives\": [{\"body\": \"fan\", \"turn\": {\"axis\": [0, 0, 1], "
            "\"angle\": "
            "{\"table\": [[0, 0], [10, "
         << 10 * speed << "]]}}}]}";
    Play play(text.str());
    for (int i = 0; i < 5; ++i) {
      play.Step();
      EXPECT_NEAR(play.body(0).angular_velocity_W.z(), speed, 1e-9 * speed);
      EXPECT_LT((play.body(0).position_W - Vector3(1, 2, 3)).norm(), 1e-12);
    }
  }
}

TEST(Drives, VelocitiesOfKinematicBodiesAreSummedUp) {
  Play play(
      "{\"version\": 1, \"time\": {\"dt\": 0.01}, \"bodies\": [{\"shape\": {\"type\": \"box\", \"size\": [1, 1, 1]}, "
      "\"kind\": "
      "\"kinematic\"}], \"drives\": [{\"body\": 0, \"velocity\": [{\"table\": [[0, 0], [1, 2]]}, 0, 1], "
      "\"angular_velocity\": [0, 0, 0.5]}]}");
  for (int i = 0; i < 100; ++i) play.Step();
  EXPECT_NEAR(play.body(0).position_W.x(), 1, 1e-12);
  EXPECT_NEAR(play.body(0).position_W.z(), 1, 1e-12);
  EXPECT_NEAR(play.body(0).rotation_WB.z(), std::sin(0.25), 1e-12);
}

TEST(Probes, WriteARowAFrameWithTheForceOfContacts) {
  Play play(
      "{\"version\": 1, \"time\": {\"dt\": 0.01}, \"bodies\": [{\"name\": \"floor\", \"shape\": {\"type\": "
      "\"half_space\"}, \"kind\": \"fixed\"}, {\"name\": \"ball\", \"shape\": {\"type\": \"sphere\", \"radius\": 0.5}, "
      "\"mass\": 2, \"position\": [0, 0, 0.5]}], \"probes\": [{\"body\": \"ball\", \"write\": [\"force\"]}, {\"body\": "
      "0, "
      "\"write\": [\"rotation\"]}]}");
  Probes probes(play.description, play.made);
  probes.Add(play.made.world, 0, 0.01);
  play.Step();
  probes.Add(play.made.world, 1, 0.01);
  const std::string head =
      "frame,time,ball.force.x,ball.force.y,ball.force.z,body[0].rotation.w,body[0].rotation.x,body[0].rotation.y,"
      "body[0].rotation.z\n0,0,0,0,0,1,0,0,0\n";
  ASSERT_EQ(probes.text().substr(0, head.size()), head);
  double number = 0, time = 0, x = 1, y = 1, z = 0;
  ASSERT_EQ(std::sscanf(probes.text().c_str() + head.size(), "%lf,%lf,%lf,%lf,%lf,1,0,0,0", &number, &time, &x, &y, &z),
            5);
  EXPECT_EQ(number, 1);
  EXPECT_EQ(time, 0.01);
  EXPECT_NEAR(std::hypot(x, y), 0, 1e-9);
  EXPECT_NEAR(z, 2 * 9.81, 1e-9);
}

TEST(Samples, AreTwelveAndTheirFirstStepsAreClean) {
  int count = 0;
  for (const auto& file : std::filesystem::directory_iterator(std::string(ISLET_SOURCES) + "/scenes/samples")) {
    if (file.path().extension() != ".json") continue;
    ++count;
    const std::string path = file.path().string();
    Play play(std::make_shared<const Document>(path, ReadSceneText(path)));
    for (const std::string* text : {&play.description.title, &play.description.about, &play.description.expected})
      EXPECT_FALSE(text->empty()) << path;
    for (int frame = 0; frame < 20; ++frame) EXPECT_FALSE(play.Step().Failed()) << path << ", frame " << frame;
  }
  EXPECT_EQ(count, 12);
}

// What the quick ones say of themselves under "expected" is what is seen, to their end and without a failed step.
struct Sample {
  explicit Sample(const std::string& name) : path(std::string(ISLET_SOURCES) + "/scenes/samples/" + name) {
    Play play(std::make_shared<const Document>(path, ReadSceneText(path)));
    const std::vector<Body> start(play.made.world.bodies().begin(), play.made.world.bodies().end());
    awake = 1;
    for (int frame = 0; frame * play.description.dt < play.description.end - 1e-9; ++frame) {
      const StepReport report = play.Step();
      EXPECT_FALSE(report.Failed()) << name << ", frame " << frame + 1;
      awake = report.awake;
      seconds = play.made.world.time();
      highest.resize(start.size(), -1e9);
      for (size_t i = 0; i < start.size(); ++i)
        highest[i] = std::max(highest[i], play.made.world.bodies()[i].position_W.z());
      if (awake == 0 && play.description.stop_at_rest) break;
    }
    for (size_t i = 0; i < start.size(); ++i) {
      const Body& body = play.made.world.bodies()[i];
      end.push_back(body);
      if (body.kind != BodyKind::kDynamic) continue;
      travel = std::max(travel, (body.position_W - start[i].position_W).norm());
      passed += play.made.info.passed_z && body.position_W.z() < *play.made.info.passed_z;
      const auto& bounds = play.made.info.bounds;
      escaped += bounds && ((body.position_W.array() < bounds->lower.array()).any() ||
                            (body.position_W.array() > bounds->upper.array()).any());
    }
    named = play.made.named;
  }
  const Body& At(const std::string& body, int which = 0) const { return end[named.at(body)[which]]; }

  std::string path;
  int awake = 0, passed = 0, escaped = 0;
  double seconds = 0, travel = 0;
  std::vector<double> highest;  // [m] per body
  std::vector<Body> end;
  std::map<std::string, std::vector<int>> named;
};

TEST(Samples, StandWhereTheySayTheyStand) {
  for (const char* name : {"arch.json", "cards.json"}) {
    const Sample sample(name);
    EXPECT_EQ(sample.awake, 0) << name;
    EXPECT_LT(sample.travel, 1e-4) << name;
  }
}

TEST(Samples, LidGoesTwiceAsFarAsItsBalls) {
  const Sample sample("lid.json");
  EXPECT_NEAR(sample.seconds, 1, 1e-9);
  EXPECT_NEAR(sample.At("lid").position_W.x(), 0.4, 1e-4);
  EXPECT_NEAR(sample.At("ball", 4).position_W.x(), 0.2, 1e-4);
}

TEST(Samples, DiceStayOnTheTable) {
  const Sample sample("dice.json");
  EXPECT_EQ(sample.awake, 0);
  EXPECT_EQ(sample.escaped, 0);
  EXPECT_LT(sample.seconds, 2);
}

TEST(Samples, SeesawThrowsItsCube) {
  const Sample sample("seesaw.json");
  EXPECT_EQ(sample.awake, 0);
  EXPECT_GT(sample.highest[sample.named.at("cube")[0]], 2);
  EXPECT_LT(sample.At("cube").position_W.z(), 1);
}

TEST(Samples, ConveyorEmptiesItself) {
  const Sample sample("conveyor.json");
  EXPECT_EQ(sample.passed, 8);
  EXPECT_LT(sample.seconds, 8);
}

TEST(Samples, BowlingIsAStrike) { EXPECT_EQ(Sample("bowling.json").passed, 11); }

}  // namespace
}  // namespace islet
