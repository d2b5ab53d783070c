#include "engine/contact_suite.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <random>
#include <stdexcept>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "parallel/worker_pool.h"
#include "tests/support/worlds.h"

namespace islet {
namespace {

using testing::kGravity;

constexpr double kDt = 1.0 / 60;
constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

Body Wall() {
  Body wall;
  wall.kind = BodyKind::kFixed;
  return wall;
}

Body UnitCube(const Vector3& position) {
  Body cube;
  cube.inertia_B = Matrix3::Identity() / 6;
  cube.radius = std::sqrt(0.75);
  cube.position_W = position;
  return cube;
}

void AddFace(int a, int b, const Vector3& centre, double friction, double restitution, std::vector<Contact>* contacts) {
  std::uint32_t feature = 0;
  for (const double x : {-0.5, 0.5})
    for (const double y : {-0.5, 0.5})
      contacts->push_back({.body_a = a,
                           .body_b = b,
                           .point_W = centre + Vector3(x, y, 0),
                           .normal_W = Vector3::UnitZ(),
                           .friction = friction,
                           .restitution = restitution,
                           .feature = feature++});
}

struct Suite {
  explicit Suite(const Settings& settings = {}, int threads = 1) : pool(threads), suite(settings, &pool) {}
  StepReport Resolve(double dt = kDt) {
    StepReport report;
    suite.Resolve(dt, bodies, contacts, &report);
    return report;
  }
  parallel::WorkerPool pool;
  ContactSuite suite;
  std::vector<Body> bodies;
  std::vector<Contact> contacts;
};

// A step is refused by a message that names what is wrong and whose it is.
void ExpectRefused(Suite* s, const std::string& text, const std::string& whose) {
  try {
    s->Resolve();
    ADD_FAILURE() << text << " was accepted";
  } catch (const std::invalid_argument& error) {
    EXPECT_NE(std::string(error.what()).find(text), std::string::npos) << error.what();
    EXPECT_NE(std::string(error.what()).find(whose), std::string::npos) << error.what();
  }
}

Settings NeverFreeze() {
  Settings settings;
  settings.freezing = Freezing::kOff;
  return settings;
}

// What asks for the impulses of before.
Settings WithoutColumns() {
  Settings settings = NeverFreeze();
  settings.ladder = settings.ladder.Without(qp::Rung::kColumn);
  return settings;
}

// One on the other, on a wall.
void AddTwoCubes(Suite* s) {
  s->bodies = {Wall(), UnitCube({0, 0, 0.5}), UnitCube({0.2, 0.1, 1.5})};
  AddFace(0, 1, Vector3::Zero(), 0.5, 0, &s->contacts);
  AddFace(1, 2, {0.1, 0, 1}, 0.5, 0, &s->contacts);
}

TEST(ContactSuite, FreeBodyGetsGravityAndForce) {
  Suite s;
  s.bodies = {UnitCube(Vector3::Zero())};
  s.bodies[0].force_W = {3, 0, 0};
  s.bodies[0].torque_W = {0, 0, 1};
  const StepReport report = s.Resolve();
  EXPECT_NEAR((s.bodies[0].linear_velocity_W - kDt * Vector3(3, 0, -kGravity)).norm(), 0, 1e-15);
  EXPECT_NEAR((s.bodies[0].angular_velocity_W - kDt * Vector3(0, 0, 6)).norm(), 0, 1e-15);
  EXPECT_EQ(report.contacts, 0);
  EXPECT_EQ(report.awake, 1);
  EXPECT_EQ(s.suite.velocities_before_gravity()[0].linear_W, Vector3::Zero());
}

TEST(ContactSuite, NoBodiesNoContacts) {
  Suite s;
  EXPECT_EQ(s.Resolve().contacts, 0);
}

TEST(ContactSuite, CubeOnAFloorByHand) {
  Suite s;
  s.bodies = {Wall(), UnitCube({0, 0, 0.5})};
  AddFace(0, 1, Vector3::Zero(), 0.5, 0.2, &s.contacts);
  const StepReport report = s.Resolve();
  EXPECT_LT(s.bodies[1].linear_velocity_W.norm(), 1e-7);
  Vector3 sum = Vector3::Zero();
  for (const Vector3& j : s.suite.impulses()) sum += j;
  EXPECT_NEAR((sum - Vector3(0, 0, kGravity * kDt)).norm(), 0, 1e-6);
  EXPECT_EQ(report.contacts, 4);
  EXPECT_EQ(report.active_contacts, 4);
  ASSERT_EQ(report.islands.size(), 1u);
  EXPECT_EQ(report.islands[0].first_body, 1);
  EXPECT_EQ(report.islands[0].bodies, 1);
  EXPECT_EQ(report.islands[0].collision_status, QpStatus::kNone);
  EXPECT_EQ(report.islands[0].static_status, QpStatus::kSolved);
  EXPECT_EQ(report.bounces, 0);
}

// Drop at 2 m/s, e = 0.5: leaves the collisions at +1, then gravity of one step.
TEST(ContactSuite, BallBouncesBeforeGravityActs) {
  Suite s;
  s.bodies = {Wall(), UnitCube({0, 0, 0.5})};
  s.bodies[1].linear_velocity_W = {0, 0, -2};
  s.contacts = {{.body_a = 0, .body_b = 1, .normal_W = Vector3::UnitZ(), .friction = 0.5, .restitution = 0.5}};
  const StepReport report = s.Resolve();
  EXPECT_EQ(report.bounces, 1);
  EXPECT_NEAR(s.suite.velocities_before_gravity()[1].linear_W.z(), 1, 1e-12);
  EXPECT_NEAR(s.bodies[1].linear_velocity_W.z(), 1 - kGravity * kDt, 1e-12);
  EXPECT_NEAR(s.suite.impulses()[0].z(), 3, 1e-12);
}

// Nothing holds them up, and they touch only at the end of the step: 1 mm is what they may close in it.
TEST(ContactSuite, BodiesInMidAirCloseAnOpenContactAndNoMore) {
  Suite s;
  s.bodies = {UnitCube({0, 0, 5}), UnitCube({1.001, 0, 5})};
  s.bodies[0].linear_velocity_W = {1, 0, 0};
  s.contacts = {{.body_a = 0,
                 .body_b = 1,
                 .point_W = {0.5, 0, 5},
                 .normal_W = Vector3::UnitX(),
                 .gap = 1e-3,
                 .touches = false,
                 .restitution = 0}};
  s.Resolve();
  EXPECT_NEAR(s.bodies[1].linear_velocity_W.x() - s.bodies[0].linear_velocity_W.x(), -1e-3 / kDt, 1e-9);
  EXPECT_NEAR(s.bodies[1].linear_velocity_W.x() + s.bodies[0].linear_velocity_W.x(), 1, 1e-12);
}

// Cubes that rise together, and that gravity brings back within the step: the trapezoidal rule would lift the first by what the
// wall's impulse has no business to do, and the others off it, although each is held by the one below. Numbered from the ground or
// from the top.
TEST(ContactSuite, WhatRidesOnWhatIsCaughtIsCaught) {
  for (const bool upwards : {true, false}) {
    Suite s(NeverFreeze());
    s.bodies.assign(5, Wall());
    for (int i = 1; i <= 4; ++i) {
      const int number = upwards ? i : 4 - i, below = upwards ? i - 1 : 5 - i;
      s.bodies[number] = UnitCube({0, 0, i - 0.5});
      s.bodies[number].linear_velocity_W = {0, 0, i < 4 ? 0.05 : 0.3};  // free fall adds 0.16 m/s
      const size_t first = s.contacts.size();
      AddFace(std::min(below, number), std::max(below, number), {0, 0, i - 1.0}, 0.5, 0, &s.contacts);
      for (size_t c = first; c < s.contacts.size(); ++c)
        if (!upwards) s.contacts[c].normal_W = -Vector3::UnitZ();
    }
    std::sort(s.contacts.begin(), s.contacts.end(), Earlier);
    s.Resolve();
    for (int i = 1; i <= 3; ++i) {
      const int number = upwards ? i : 4 - i;
      EXPECT_LT((s.suite.velocities_before_gravity()[number].linear_W - s.bodies[number].linear_velocity_W).norm(),
                1e-14)
          << i;
    }
    EXPECT_EQ(s.suite.velocities_before_gravity()[upwards ? 4 : 0].linear_W.z(), 0.3);
  }
}

// The sum of all impulses is the change of momentum, in every setting.
TEST(ContactSuite, ImpulsesExplainTheVelocities) {
  std::mt19937 rng(3);
  std::uniform_real_distribution<double> uniform(-1, 1);
  for (const Model model : {Model::kKinetic, Model::kConvex, Model::kCoulomb}) {
    for (const int bounce_limit : {0, 2, kAutoBounceLimit}) {
      Settings settings;
      settings.model = model;
      settings.bounce_limit = bounce_limit;
      Suite s(settings);
      s.bodies = {Wall()};
      for (int i = 1; i <= 6; ++i) {
        s.bodies.push_back(UnitCube({0, 0, i - 0.5}));
        s.bodies[i].linear_velocity_W = Vector3(uniform(rng), uniform(rng), uniform(rng));
        s.bodies[i].angular_velocity_W = Vector3(uniform(rng), uniform(rng), uniform(rng));
        AddFace(i - 1, i, {0, 0, i - 1.0}, 0.5, 0.3, &s.contacts);
      }
      std::vector<Body> expected = s.bodies;
      const StepReport report = s.Resolve();
      EXPECT_EQ(report.collision_qp.failed + report.static_qp.failed, 0);
      for (Body& b : expected)
        if (b.Moves()) b.linear_velocity_W.z() -= kGravity * kDt;
      for (size_t c = 0; c < s.contacts.size(); ++c) {
        const Contact& contact = s.contacts[c];
        if (contact.body_a > 0) expected[contact.body_a].ApplyImpulse(-s.suite.impulses()[c], contact.point_W);
        expected[contact.body_b].ApplyImpulse(s.suite.impulses()[c], contact.point_W);
      }
      for (size_t i = 1; i < expected.size(); ++i) {
        EXPECT_LT((expected[i].linear_velocity_W - s.bodies[i].linear_velocity_W).norm(), 1e-9) << i;
        EXPECT_LT((expected[i].angular_velocity_W - s.bodies[i].angular_velocity_W).norm(), 1e-9) << i;
      }
      for (const Contact& c : s.contacts) EXPECT_GT(NormalVelocity(c, s.bodies[c.body_a], s.bodies[c.body_b]), -1e-4);
      EXPECT_LT(report.certificate.momentum, 1e-9);
    }
  }
}

// Islands do not see each other: two stacks apart move as each alone.
TEST(ContactSuite, IslandsAreIndependentBitForBit) {
  const auto add_stack = [](Suite* s, double x) {
    const int first = static_cast<int>(s->bodies.size());
    s->bodies.push_back(Wall());
    for (int i = 1; i <= 3; ++i) {
      s->bodies.push_back(UnitCube({x, 0, i - 0.5}));
      s->bodies.back().linear_velocity_W = {0.3 * i, 0.1, -0.2};
      AddFace(first + i - 1, first + i, {x, 0, i - 1.0}, 0.5, 0.3, &s->contacts);
    }
  };
  Suite both, alone;
  add_stack(&both, 7);
  add_stack(&both, 0);
  add_stack(&alone, 0);
  both.bodies[2].linear_velocity_W.y() = 5;
  EXPECT_EQ(both.Resolve().islands.size(), 2u);
  alone.Resolve();
  for (int i = 1; i <= 3; ++i) {
    EXPECT_EQ(both.bodies[4 + i].linear_velocity_W, alone.bodies[i].linear_velocity_W);
    EXPECT_EQ(both.bodies[4 + i].angular_velocity_W, alone.bodies[i].angular_velocity_W);
  }
}

TEST(ContactSuite, SameBitsOnAnyNumberOfThreads) {
  std::vector<Vector3> first;
  for (const int threads : {1, 2, 4, 8}) {
    Suite s({}, threads);
    std::mt19937 rng(9);
    std::uniform_real_distribution<double> uniform(-1, 1);
    for (int stack = 0; stack < 60; ++stack) {
      const int base = static_cast<int>(s.bodies.size());
      s.bodies.push_back(Wall());
      for (int i = 1; i <= 1 + stack % 5; ++i) {
        s.bodies.push_back(UnitCube({2.0 * stack, 0, i - 0.5}));
        s.bodies.back().linear_velocity_W = Vector3(uniform(rng), uniform(rng), uniform(rng));
        AddFace(base + i - 1, base + i, {2.0 * stack, 0, i - 1.0}, 0.5, 0.3, &s.contacts);
      }
    }
    s.Resolve();
    std::vector<Vector3> velocities;
    for (const Body& b : s.bodies)
      velocities.push_back(b.linear_velocity_W), velocities.push_back(b.angular_velocity_W);
    if (first.empty()) first = velocities;
    EXPECT_EQ(velocities, first) << threads;
  }
}

// A rocking cube may touch with the same corners under other numbers: what pressed there goes on to press.
TEST(ContactSuite, LoadsPassToTheNearestContactOfTheSameBodies) {
  Suite s(WithoutColumns());
  AddTwoCubes(&s);
  s.Resolve();
  const std::vector<Vector3> before(s.suite.impulses().begin(), s.suite.impulses().end());
  for (Contact& contact : s.contacts) contact.feature += 10;
  s.contacts[3].point_W.x() -= 1e-11;
  const StepReport report = s.Resolve();
  EXPECT_EQ(report.ladder.rungs[static_cast<int>(qp::Rung::kHeld)].problems, 1);
  for (size_t c = 0; c < before.size(); ++c) EXPECT_LT((s.suite.impulses()[c] - before[c]).norm(), 1e-9) << c;
}

// Callers who do not number the points of a face have them told apart by their order.
TEST(ContactSuite, ContactsOfTheSameNumberKeepTheirLoads) {
  Suite s(WithoutColumns());
  AddTwoCubes(&s);
  for (Contact& contact : s.contacts) contact.feature = 0;
  for (int frame = 0; frame < 5; ++frame) {
    const StepReport report = s.Resolve();
    if (frame > 0) {
      EXPECT_EQ(report.ladder.rungs[static_cast<int>(qp::Rung::kHeld)].problems, 1) << frame;
    }
  }
}

TEST(ContactSuite, BodiesMayBeGoneInTheNextFrame) {
  Suite s;
  s.bodies = {Wall(), UnitCube({0, 0, 0.5}), UnitCube({0, 0, 1.5}), UnitCube({5, 0, 0.5})};
  AddFace(0, 1, Vector3::Zero(), 0.5, 0, &s.contacts);
  AddFace(0, 3, {5, 0, 0}, 0.5, 0, &s.contacts);
  AddFace(1, 2, {0, 0, 1}, 0.5, 0, &s.contacts);
  s.Resolve();
  s.bodies.pop_back();
  s.bodies.shrink_to_fit();
  s.contacts.erase(s.contacts.begin() + 4, s.contacts.begin() + 8);
  EXPECT_EQ(s.Resolve().awake, 2);
  for (const Vector3& impulse : s.suite.impulses()) EXPECT_NEAR(impulse.head<2>().norm(), 0, 1e-9);
}

// Used as a plug-in: the caller integrates, contacts stay where they are, the bodies freeze and keep their impulses.
TEST(ContactSuite, FreezesWithoutAWorldAndKeepsTheImpulses) {
  Suite s;
  s.bodies = {Wall(), UnitCube({0, 0, 0.5}), UnitCube({0, 0, 1.5})};
  AddFace(0, 1, {0, 0, 0}, 0.5, 0, &s.contacts);
  AddFace(1, 2, {0, 0, 1}, 0.5, 0, &s.contacts);
  int newly = 0;
  for (int i = 0; i < 15; ++i) newly += s.Resolve().newly_frozen;
  EXPECT_EQ(newly, 2);
  EXPECT_TRUE(s.bodies[1].frozen && s.bodies[2].frozen);
  const StepReport report = s.Resolve();
  EXPECT_EQ(report.frozen, 2);
  EXPECT_EQ(report.static_qp.solved, 0) << "nothing has changed: nothing to solve";
  double floor = 0;
  for (int c = 0; c < 4; ++c) floor += s.suite.impulses()[c].z();
  EXPECT_NEAR(floor, 2 * kGravity * kDt, 1e-5);
  // The lower contacts go: both must fall at once, although the upper ones still hold.
  s.contacts.erase(s.contacts.begin(), s.contacts.begin() + 4);
  EXPECT_EQ(s.Resolve().woken, 2);
  for (const int i : {1, 2}) EXPECT_NEAR(s.bodies[i].linear_velocity_W.z(), -kGravity * kDt, 1e-9);
}

TEST(ContactSuite, PaperFreezesByItsCounterAndOnlyInColdVolumes) {
  for (const bool cold : {false, true}) {
    Settings settings = Settings::Paper();
    settings.freeze_count = 3;
    if (!cold) settings.cold_volumes = {{{5, 5, 5}, {6, 6, 6}}};
    Suite s(settings);
    s.bodies = {Wall(), UnitCube({0, 0, 0.5})};
    AddFace(0, 1, {0, 0, 0}, 0.5, 0, &s.contacts);
    int frames = 0;
    while (frames < 20 && !s.bodies[1].frozen) s.Resolve(), ++frames;
    EXPECT_EQ(frames, cold ? 4 : 20);
  }
}

TEST(ContactSuite, FreezingOffNeverFreezes) {
  Suite s(NeverFreeze());
  s.bodies = {Wall(), UnitCube({0, 0, 0.5})};
  AddFace(0, 1, {0, 0, 0}, 0.5, 0, &s.contacts);
  for (int i = 0; i < 30; ++i) s.Resolve();
  EXPECT_FALSE(s.bodies[1].frozen);
}

TEST(ContactSuite, BadInputIsNamed) {
  struct Case {
    const char* text;
    void (*spoil)(std::vector<Contact>*);
  };
  const Case cases[] = {
      {"body_a = -1", [](std::vector<Contact>* c) { (*c)[1].body_a = -1; }},
      {"body_b = 2", [](std::vector<Contact>* c) { (*c)[1].body_b = 2; }},
      {"body_b = 0", [](std::vector<Contact>* c) { (*c)[1].body_b = 0; }},
      {"point", [](std::vector<Contact>* c) { (*c)[1].point_W.y() = kNan; }},
      {"normal", [](std::vector<Contact>* c) { (*c)[1].normal_W *= 2; }},
      {"normal", [](std::vector<Contact>* c) { (*c)[1].normal_W.x() = kNan; }},
      {"friction = -", [](std::vector<Contact>* c) { (*c)[1].friction = -1; }},
      {"friction = 1", [](std::vector<Contact>* c) { (*c)[1].friction = 1e5; }},
      {"friction = nan", [](std::vector<Contact>* c) { (*c)[1].friction = kNan; }},
      {"restitution = 1.5", [](std::vector<Contact>* c) { (*c)[1].restitution = 1.5; }},
      {"restitution = nan", [](std::vector<Contact>* c) { (*c)[1].restitution = kNan; }},
      {"gap = nan", [](std::vector<Contact>* c) { (*c)[1].gap = kNan; }},
      {"gap = -inf", [](std::vector<Contact>* c) { (*c)[1].gap = -INFINITY; }},
      {"order", [](std::vector<Contact>* c) { std::swap((*c)[0], (*c)[1]); }},
  };
  for (const Case& bad : cases) {
    Suite s;
    s.bodies = {Wall(), UnitCube({0, 0, 0.5})};
    AddFace(0, 1, {0, 0, 0}, 0.5, 0, &s.contacts);
    bad.spoil(&s.contacts);
    ExpectRefused(&s, bad.text, "contact 1");
    EXPECT_EQ(s.bodies[1].linear_velocity_W, Vector3::Zero()) << "a refused step changes nothing";
  }
  struct BodyCase {
    const char* text;
    void (*spoil)(Body*);
  };
  const BodyCase bodies[] = {
      {"mass = 0", [](Body* b) { b->mass = 0; }},
      {"mass = inf", [](Body* b) { b->mass = INFINITY; }},
      {"inertia", [](Body* b) { b->inertia_B(1, 1) = -1; }},
      {"inertia", [](Body* b) { b->inertia_B(1, 0) = 1e-3; }},
      {"inertia", [](Body* b) { b->inertia_B(2, 2) = kNan; }},
      {"rotation = 2", [](Body* b) { b->rotation_WB.w() = 2; }},
      {"position = (0, nan, 0.5)", [](Body* b) { b->position_W.y() = kNan; }},
      {"linear velocity", [](Body* b) { b->linear_velocity_W.z() = INFINITY; }},
      {"linear velocity", [](Body* b) { b->linear_velocity_W.z() = 1e200; }},
      {"angular velocity", [](Body* b) { b->angular_velocity_W.z() = kNan; }},
      {"force", [](Body* b) { b->force_W.x() = kNan; }},
      {"torque", [](Body* b) { b->torque_W.x() = kNan; }},
      {"radius = -1", [](Body* b) { b->radius = -1; }},
      {"fixed", [](Body* b) { b->kind = BodyKind::kFixed, b->linear_velocity_W.x() = 1; }},
  };
  for (const BodyCase& bad : bodies) {
    Suite s;
    s.bodies = {Wall(), UnitCube({0, 0, 0.5})};
    AddFace(0, 1, {0, 0, 0}, 0.5, 0, &s.contacts);
    bad.spoil(&s.bodies[1]);
    ExpectRefused(&s, bad.text, "body 1");
  }
  Suite s;
  for (const double dt : {0.0, -1.0, kNan, std::numeric_limits<double>::infinity()})
    EXPECT_THROW(s.Resolve(dt), std::invalid_argument);
  EXPECT_THROW(s.suite.SetGravity({0, kNan, 0}), std::invalid_argument);
  Settings settings;
  settings.tolerance = -1;
  EXPECT_THROW(ContactSuite(settings, &s.pool), std::invalid_argument);
}

// A caller who keeps one report for all steps reads each step, not their sum.
TEST(ContactSuite, AReportStartsAfresh) {
  Suite s(NeverFreeze());
  s.bodies = {Wall(), UnitCube({0, 0, 0.5})};
  AddFace(0, 1, {0, 0, 0}, 0.5, 0, &s.contacts);
  StepReport report;
  for (int i = 0; i < 3; ++i) {
    s.suite.Resolve(kDt, s.bodies, s.contacts, &report);
    EXPECT_EQ(report.contacts, 4);
    EXPECT_EQ(report.awake, 1);
    EXPECT_EQ(report.islands.size(), 1u);
    EXPECT_EQ(report.static_qp.solved, 1);
  }
}

// A cube sunk into the floor and a second one into it: each rises by what closes below it, and nobody turns.
TEST(ContactSuite, ProjectionUndoesOverlaps) {
  Suite s;
  s.bodies = {Wall(), UnitCube({0, 0, 0.49}), UnitCube({0, 0, 1.47})};
  AddFace(0, 1, {0, 0, 0}, 0.5, 0.3, &s.contacts);
  for (Contact& c : s.contacts) c.gap = -0.01;
  AddFace(1, 2, {0, 0, 0.98}, 0.5, 0.3, &s.contacts);
  for (size_t c = 4; c < 8; ++c) s.contacts[c].gap = -0.02;
  const std::vector<Body> before = s.bodies;
  EXPECT_LT(s.suite.Project(s.bodies, s.contacts), 1e-8);
  const std::span<const Twist> w = s.suite.displacements();
  EXPECT_EQ(w[0].linear_W, Vector3::Zero());
  EXPECT_LT((w[1].linear_W - Vector3(0, 0, 0.01)).norm(), 1e-8);
  EXPECT_LT((w[2].linear_W - Vector3(0, 0, 0.03)).norm(), 1e-8);
  EXPECT_LT(w[1].angular_W.norm() + w[2].angular_W.norm(), 1e-8);
  EXPECT_EQ(s.bodies[2].position_W, before[2].position_W) << "poses are the caller's";
  // Open contacts stay open: a lid 5 mm above the upper cube leaves no room, and says so.
  s.bodies.push_back(Wall());
  AddFace(2, 3, {0, 0, 1.97}, 0.5, 0.3, &s.contacts);
  for (size_t c = 8; c < 12; ++c) s.contacts[c].gap = 0.005;
  EXPECT_GT(s.suite.Project(s.bodies, s.contacts), 1e-3);
  for (size_t c = 8; c < 12; ++c) s.contacts[c].gap = 0.05;
  EXPECT_LT(s.suite.Project(s.bodies, s.contacts), 1e-8);
}

// Between walls that leave no room the cube gives way to both. By hand it moves by 0.04 / (8 + c), where each of the eight contacts gives way by
// c < 0.5 m/(N s): 5 mm, which leaves 15 on either side, less c / 8 of it. The bound is that part.
TEST(ContactSuite, ProjectionSharesWhatHasNoRoom) {
  Suite s;
  s.bodies = {Wall(), UnitCube({0, 0, 0.5}), Wall()};
  AddFace(0, 1, {0, 0, 0.02}, 0.5, 0, &s.contacts);
  AddFace(1, 2, {0, 0, 0.99}, 0.5, 0, &s.contacts);
  for (size_t c = 0; c < 8; ++c) s.contacts[c].gap = c < 4 ? -0.02 : -0.01;
  EXPECT_NEAR(s.suite.Project(s.bodies, s.contacts), 0.015, 3e-4);
  EXPECT_LT((s.suite.displacements()[1].linear_W - Vector3(0, 0, 0.005)).norm(), 3e-4);
}

// Two free bodies part by their masses, and their common centre stays.
TEST(ContactSuite, ProjectionKeepsTheCentreOfMass) {
  Suite s;
  s.bodies = {UnitCube({0, 0, 0}), UnitCube({0, 0, 0.9})};
  s.bodies[1].mass = 3;
  s.bodies[1].inertia_B *= 3;
  AddFace(0, 1, {0, 0, 0.45}, 0.5, 0, &s.contacts);
  for (Contact& c : s.contacts) c.gap = -0.1;
  EXPECT_LT(s.suite.Project(s.bodies, s.contacts), 1e-7);
  EXPECT_NEAR(s.suite.displacements()[0].linear_W.z(), -0.075, 1e-7);
  EXPECT_NEAR(s.suite.displacements()[1].linear_W.z(), 0.025, 1e-7);
  s.bodies[1].mass = kNan;
  EXPECT_THROW(s.suite.Project(s.bodies, s.contacts), std::invalid_argument);
}

// A frozen cube that is thrown up flies; one that stands on a belt goes along when that starts.
TEST(ContactSuite, WhatIsDisturbedWakes) {
  for (const Freezing freezing : {Freezing::kCertified, Freezing::kPaper}) {
    Settings settings;
    settings.freezing = freezing;
    Suite s(settings);
    s.bodies = {Wall(), UnitCube({0, 0, 0.5})};
    AddFace(0, 1, {0, 0, 0}, 0.5, 0, &s.contacts);
    for (int i = 0; i < 60; ++i) s.Resolve();
    ASSERT_TRUE(s.bodies[1].frozen);
    s.bodies[1].linear_velocity_W = {0, 0, 2};
    const StepReport report = s.Resolve();
    EXPECT_FALSE(s.bodies[1].frozen);
    EXPECT_EQ(report.woken, 1);
    EXPECT_NEAR(s.bodies[1].linear_velocity_W.z(), 2 - kGravity * kDt, 1e-12);
  }
  Suite s;
  s.bodies = {Wall(), UnitCube({0, 0, 0.5})};
  AddFace(0, 1, {0, 0, 0}, 0.5, 0, &s.contacts);
  for (int i = 0; i < 60; ++i) s.Resolve();
  ASSERT_TRUE(s.bodies[1].frozen);
  for (Contact& c : s.contacts) c.surface_W = {-1, 0, 0};
  s.Resolve();
  EXPECT_NEAR(s.bodies[1].linear_velocity_W.x(), 0.5 * kGravity * kDt, 1e-6);
}

// What a press of 1e4 times its weight holds by no friction gives way to a force of 1.5 N, which is 7.5e-6 of all that acts on it.
TEST(ContactSuite, AHeavyLoadHidesNoForce) {
  Suite s;
  s.bodies = {Wall(), UnitCube({0, 0, 0.5}), UnitCube({0, 0, 1.5})};
  s.bodies[2].mass = 1e4;
  s.bodies[2].inertia_B *= 1e4;
  AddFace(0, 1, {0, 0, 0}, 0, 0, &s.contacts);
  AddFace(1, 2, {0, 0, 1}, 0, 0, &s.contacts);
  for (int i = 0; i < 60; ++i) s.Resolve();
  ASSERT_TRUE(s.bodies[1].frozen && s.bodies[2].frozen);
  s.bodies[1].force_W = {1.5, 0, 0};
  s.Resolve();
  EXPECT_NEAR(s.bodies[1].linear_velocity_W.x(), 1.5 * kDt, 1e-9);
}

// A cube slides along a tilted plane at 10 m/s, without gravity: that it closes by 1e-15 m/s is rounding, and no problem.
TEST(ContactSuite, RoundingOfASlideIsNoApproach) {
  for (int k = 1; k < 40; ++k) {
    const Quaternion tilt = testing::Turn(0.07 * k, {1, 2, 0.3});
    Settings settings = NeverFreeze();
    settings.gravity.setZero();
    Suite s(settings);
    s.bodies = {Wall(), UnitCube(tilt * Vector3(0, 0, 0.5))};
    s.bodies[1].rotation_WB = tilt;
    s.bodies[1].linear_velocity_W = tilt * Vector3(6, 8, 0);
    AddFace(0, 1, Vector3::Zero(), 0.5, 0, &s.contacts);
    for (Contact& c : s.contacts) c.point_W = tilt * c.point_W, c.normal_W = tilt * c.normal_W;
    const StepReport report = s.Resolve();
    EXPECT_EQ(report.collision_qp.missed + report.static_qp.missed, 0) << k;
    EXPECT_LT((s.bodies[1].linear_velocity_W - tilt * Vector3(6, 8, 0)).norm(), 1e-13) << k;
  }
}

TEST(ContactSuite, ContactsOfNobodyAreRefused) {
  Suite s;
  AddTwoCubes(&s);
  s.bodies[1].removed = true;
  ExpectRefused(&s, "removed", "contact 0");
}

// An open contact that is closed at the end of each step holds a cube along its normal alone: pushed along a smooth floor it goes a t^2 / 2.
TEST(ContactSuite, OpenContactsHoldAlongTheirNormalAlone) {
  for (const bool touches : {true, false}) {
    Suite s(NeverFreeze());
    s.bodies = {Wall(), UnitCube({0, 0, 0.5})};
    s.bodies[1].force_W = {1, 0, 0};
    for (int i = 0; i < 100; ++i) {
      s.contacts.clear();
      AddFace(0, 1, {s.bodies[1].position_W.x(), 0, 0}, 0, 0, &s.contacts);
      for (Contact& c : s.contacts) c.touches = touches;
      s.Resolve();
      s.suite.Move(s.bodies);
    }
    const double t = 100 * kDt;
    EXPECT_NEAR(s.bodies[1].position_W.x(), 0.5 * t * t, 1e-9) << touches;
    EXPECT_NEAR(s.bodies[1].position_W.z(), 0.5, 1e-6) << touches;
    EXPECT_NEAR(s.bodies[1].linear_velocity_W.x(), t, 1e-9) << touches;
  }
}

// What would bounce within the step does so at its start; what would not get there flies on.
TEST(ContactSuite, WhatBouncesWithinTheStepHasItsBlowNow) {
  for (const double gap : {0.01, 1.0}) {
    Suite s;
    s.bodies = {Wall(), UnitCube({0, 0, 0.5 + gap})};
    s.bodies[1].linear_velocity_W = {0, 0, -4};
    s.contacts = {{.body_a = 0,
                   .body_b = 1,
                   .normal_W = Vector3::UnitZ(),
                   .gap = gap,
                   .touches = false,
                   .friction = 0.5,
                   .restitution = 0.5}};
    s.Resolve();
    EXPECT_NEAR(s.suite.velocities_before_gravity()[1].linear_W.z(), gap < 0.1 ? 2 : -4, 1e-12);
    s.suite.Move(s.bodies);
    EXPECT_GT(s.bodies[1].position_W.z(), 0.5);
  }
}

// A body without contacts goes along its parabola, and its angular momentum stays.
TEST(ContactSuite, MoveIsFreeFlight) {
  Suite s;
  s.bodies = {UnitCube({0, 0, 0})};
  Body& b = s.bodies[0];
  b.inertia_B = Vector3(1, 2, 3).asDiagonal();
  b.linear_velocity_W = {1, 2, 3};
  b.angular_velocity_W = {0.1, 4, 0.2};  // about the unstable axis
  const Vector3 momentum = b.AngularMomentumW();
  for (int i = 0; i < 100; ++i) s.Resolve(), s.suite.Move(s.bodies);
  const double t = 100 * kDt;
  EXPECT_LT((b.position_W - (t * Vector3(1, 2, 3) - Vector3(0, 0, 0.5 * kGravity * t * t))).norm(), 1e-10);
  EXPECT_LT((b.AngularMomentumW() - momentum).norm(), 1e-11);
  EXPECT_GT((b.rotation_WB * Vector3::UnitY() - Vector3::UnitY()).norm(), 0.1);
  s.bodies.push_back(b);
  EXPECT_THROW(s.suite.Move(s.bodies), std::invalid_argument);
}

TEST(ContactSuite, ProjectionTellsOfWhatDoesNotMove) {
  Suite s;
  s.bodies = {Wall(), UnitCube({0, 0, 0.45})};
  s.bodies[1].frozen = true;
  AddFace(0, 1, {0, 0, 0}, 0.5, 0, &s.contacts);
  for (Contact& c : s.contacts) c.gap = -0.05;
  EXPECT_EQ(s.suite.Project(s.bodies, s.contacts), 0.05);
}

// A step that is resolved again from a kept copy is the same, bit for bit.
TEST(ContactSuite, MemoryIsKeptAsACopy) {
  Suite s;
  AddTwoCubes(&s);
  s.bodies[2].linear_velocity_W = {0.3, 0, -0.2};
  for (int i = 0; i < 3; ++i) s.Resolve();
  const std::shared_ptr<const SuiteMemory> memory = s.suite.CopyMemory();
  const std::vector<Body> start = s.bodies;
  s.Resolve();
  const std::vector<Body> first = s.bodies;
  s.bodies = start;
  s.suite.SetMemory(*memory);
  s.Resolve();
  for (int i = 1; i < 3; ++i) EXPECT_EQ(s.bodies[i].linear_velocity_W, first[i].linear_velocity_W) << i;
}

}  // namespace
}  // namespace islet
