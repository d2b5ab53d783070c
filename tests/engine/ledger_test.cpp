// The ledger sees what physics does not allow: each kind of wrong is done to a step by hand.
#include "engine/ledger.h"

#include <gtest/gtest.h>

#include <cmath>
#include <utility>
#include <vector>

#include "engine/rotation.h"
#include "engine/world.h"
#include "parallel/worker_pool.h"
#include "tests/support/worlds.h"

namespace islet {
namespace {

constexpr double kDt = 0.1;
const Vector3 kGravity(0, 0, -10);

class LedgerTest : public ::testing::Test {
 protected:
  // Body 0: a fixed plate 0.2 m thick about z = 0; body 1: a box of 1 kg that falls freely from z = 2.
  LedgerTest() {
    shapes = {Shape::Box({1, 1, 0.1}), Shape::Box({0.5, 0.4, 0.3})};
    Body plate, box;
    plate.kind = BodyKind::kFixed;
    plate.radius = shapes[0].radius();
    box.radius = shapes[1].radius();
    box.inertia_B = shapes[1].MassFromMass(1).inertia_B;
    box.position_W = {0, 0, 2};
    box.linear_velocity_W = {1, 0, 0};
    before = {plate, box};
    after = before;
    after[1].position_W += kDt * box.linear_velocity_W + 0.5 * kDt * kDt * kGravity;
    after[1].linear_velocity_W += kDt * kGravity;
  }
  Ledger Judge() { return keeper.Judge({kDt, kDt, kGravity, before, after, shapes, impulses, 0}); }

  parallel::WorkerPool pool{1};
  LedgerKeeper keeper{&pool};
  std::vector<Shape> shapes;
  std::vector<Body> before, after;
  std::vector<LedgerImpulse> impulses;
};

TEST_F(LedgerTest, FreeFallIsClean) {
  const Ledger ledger = Judge();
  EXPECT_TRUE(ledger.Clean());
  EXPECT_LT(ledger.displacement_without_velocity.value, 1e-12);
  EXPECT_LT(ledger.energy_created.value, 1e-14);
}

// What rounding leaves of a height is more than what a step of a microsecond has at hand, and of a lever more than a momentum may miss.
TEST(Ledger, RoundingIsNoFault) {
  for (const auto& [dt, away] : {std::pair{1e-6, 0.0}, {1e-9, 0.0}, {1.0 / 60, 1e6}}) {
    World world;
    world.Add({.shape = Shape::HalfSpace(), .kind = BodyKind::kFixed});
    world.Add({.shape = Shape::Box({0.5, 0.3, 0.2}), .position_W = {away, 0, away > 0 ? 0.25 : 5}});
    world.Add({.shape = Shape::Box({0.5, 0.3, 0.2}), .position_W = {away, 2, away > 0 ? 0.3 : 7}});
    for (int i = 0; i < 30; ++i) {
      const StepReport report = world.Step(dt);
      EXPECT_FALSE(report.Failed()) << dt << " " << i << ": " << report.ledger.energy_created.value << " "
                                    << report.ledger.angular_momentum_unexplained.value;
    }
  }
}

TEST_F(LedgerTest, SpreadImpulseOnTheWayIsExplained) {
  LedgerImpulse push;
  push.contact.body_a = 0, push.contact.body_b = 1;
  push.impulse_W = {0, 0, 0.5};
  push.contact.point_W = 0.5 * (before[1].position_W + after[1].position_W) + Vector3(0, 0, 0.5 * kDt * 0.25);
  push.duration = kDt;
  impulses = {push};
  after[1].linear_velocity_W += push.impulse_W;
  after[1].position_W += 0.5 * kDt * push.impulse_W;
  const Ledger ledger = Judge();
  EXPECT_LT(ledger.momentum_unexplained.value, 1e-14);
  EXPECT_LT(ledger.angular_momentum_unexplained.value, 1e-12);
  EXPECT_LT(ledger.displacement_without_velocity.value, 1e-12);
}

// A needle of aspect 1000 turns about its momentum, and about its own axis.
TEST_F(LedgerTest, KnowsHowANeedleTurns) {
  shapes[1] = Shape::Box({0.5, 0.0005, 0.0005});
  Body &needle = before[1], &turned = after[1];
  needle.inertia_B = turned.inertia_B = shapes[1].MassFromMass(1).inertia_B;
  needle.radius = turned.radius = shapes[1].radius();
  needle.rotation_WB = Exp(Vector3(0.3, -0.2, 0.5));
  needle.angular_velocity_W = needle.rotation_WB * Vector3(30, 4, 5);
  const Vector3 momentum = needle.AngularMomentumW();
  const double across = needle.inertia_B(1, 1);
  const Vector3 own = kDt * (30 - needle.inertia_B(0, 0) * 30 / across) * Vector3::UnitX();
  turned.rotation_WB = Exp(kDt / across * momentum) * needle.rotation_WB * Exp(own);
  const Vector3 spin_B = needle.inertia_B.inverse() * (turned.rotation_WB.conjugate() * momentum);
  turned.angular_velocity_W = turned.rotation_WB * spin_B;
  EXPECT_LT(Judge().displacement_without_velocity.value, 1e-9);  // its moments differ by 1e6, so do roundings
  EXPECT_TRUE(Judge().Clean());
}

// The moments of a short push are rounded by more than it is long: 1e-16 of the step in 1e-9 of it.
TEST_F(LedgerTest, AShortPushLosesNothing) {
  LedgerImpulse push;
  push.contact.body_a = 0, push.contact.body_b = 1;
  push.impulse_W = {0, 0, 5};
  push.time = 0.7 * kDt;
  push.duration = 1e-9 * kDt;
  push.contact.point_W =
      before[1].position_W + push.time * before[1].linear_velocity_W + 0.5 * push.time * push.time * kGravity;
  impulses = {push};
  after[1].linear_velocity_W += push.impulse_W;
  after[1].position_W += 0.3 * kDt * push.impulse_W;
  EXPECT_LT(Judge().momentum_unexplained.value, 1e-14);
  EXPECT_LT(Judge().displacement_without_velocity.value, 1e-9);
}

TEST_F(LedgerTest, SeesEveryKindOfWrong) {
  after[1].linear_velocity_W.x() += 1e-3;
  EXPECT_GT(Judge().momentum_unexplained.value, 1e-4);
  EXPECT_GT(Judge().energy_created.value, 1e-4);
  EXPECT_EQ(Judge().momentum_unexplained.body, 1);
  after[1].linear_velocity_W.x() -= 1e-3;

  after[1].angular_velocity_W.y() = 1e-3;
  EXPECT_GT(Judge().angular_momentum_unexplained.value, 1e-6);
  after[1].angular_velocity_W.setZero();

  after[1].position_W.z() += 1e-3;  // lifted for nothing
  EXPECT_NEAR(Judge().displacement_without_velocity.value, 1e-3, 1e-9);
  EXPECT_NEAR(keeper.energy_gain(), 1e-2, 1e-9);
  EXPECT_FALSE(Judge().Clean());
}

// What is frozen is held by what is reported of its contacts: over the step they carry its weight and what pushes it, wherever in the
// step that push falls.
TEST_F(LedgerTest, WhatIsFrozenMustBeHeld) {
  before[1].position_W = {0, 0, 0.4};
  before[1].linear_velocity_W.setZero();
  before[1].frozen = true;
  after = before;
  const auto at = [](const Vector3& point_W, const Vector3& impulse_W, double time, double duration) {
    LedgerImpulse push;
    push.contact.body_a = 0, push.contact.body_b = 1;
    push.contact.point_W = point_W;
    push.impulse_W = impulse_W;
    push.time = time;
    push.duration = duration;
    return push;
  };
  EXPECT_NEAR(Judge().momentum_unexplained.value, 1, 1e-14);  // no impulse carries its weight
  impulses = {at({0.4, 0, 0.1}, {0, 0, 0.5}, 0, kDt), at({-0.4, 0, 0.1}, {0, 0, 0.5}, 0, kDt)};
  EXPECT_TRUE(Judge().Clean());
  EXPECT_EQ(Judge().displacement_without_velocity.value, 0);
  impulses.push_back(
      at({0.4, 0, 0.5}, {0, 0, -0.1}, 0.6 * kDt, 0));  // a blow from above, as if the box stood on nothing else
  EXPECT_NEAR(Judge().momentum_unexplained.value, 0.1 / 1.1, 1e-12);
  impulses[0].impulse_W.z() += 0.1;  // below the blow, spread over the step
  EXPECT_TRUE(Judge().Clean());
  impulses[0].impulse_W.z() -= 0.1, impulses[1].impulse_W.z() += 0.1;  // beside it
  EXPECT_LT(Judge().momentum_unexplained.value, 1e-14);
  EXPECT_GT(Judge().angular_momentum_unexplained.value, 0.05);
  // A blow from the side, late in the step, held by friction and by more weight on the far foot all the step: nothing moves in between.
  impulses = {at({0.4, 0, 0.1}, {0.1, 0, 0.45}, 0, kDt), at({-0.4, 0, 0.1}, {0, 0, 0.55}, 0, kDt),
              at({0.5, 0, 0.5}, {-0.1, 0, 0}, 0.6 * kDt, 0)};
  EXPECT_TRUE(Judge().Clean());
  EXPECT_EQ(Judge().displacement_without_velocity.value, 0);
}

// One that woke, fell and was stopped is judged by its course, though it is frozen at both ends.
TEST_F(LedgerTest, WhatWokeAndFrozeAgainHasACourse) {
  before[1].linear_velocity_W.setZero();
  before[1].frozen = true;
  after[1] = before[1];
  after[1].position_W += 0.5 * kDt * kDt * kGravity;
  LedgerImpulse stop;
  stop.contact.body_a = 0, stop.contact.body_b = 1;
  stop.contact.point_W = after[1].position_W;
  stop.impulse_W = -kDt * kGravity;
  stop.time = kDt;
  impulses = {stop};
  EXPECT_TRUE(Judge().Clean());
  EXPECT_LT(Judge().displacement_without_velocity.value, 1e-12);
  after[1].position_W += Vector3(1e-3, 0, 0);
  EXPECT_NEAR(Judge().displacement_without_velocity.value, 1e-3, 1e-12);
}

TEST_F(LedgerTest, SeesABodyGoThrough) {
  before[1].position_W.z() = 1;
  before[1].linear_velocity_W = {0, 0, -20};
  after[1] = before[1];
  after[1].position_W += kDt * before[1].linear_velocity_W + 0.5 * kDt * kDt * kGravity;
  after[1].linear_velocity_W += kDt * kGravity;
  EXPECT_EQ(Judge().sides_changed, 1);
  before[1].position_W.x() = after[1].position_W.x() = 1.6;  // past the plate's edge
  EXPECT_EQ(Judge().sides_changed, 0);
}

// It stays beside a sphere, and beside a plate, that turn by half a turn and more in the step; as these see it, it goes round them.
TEST_F(LedgerTest, APartnersTurnIsNoWayThroughIt) {
  before[0].kind = after[0].kind = BodyKind::kKinematic;
  before[0].angular_velocity_W = after[0].angular_velocity_W = {0, 31, 0};
  before[1].linear_velocity_W = Vector3::Zero();
  before[1].position_W = {1.5, 0, 0.1};
  after[1] = before[1];
  after[1].position_W += 0.5 * kDt * kDt * kGravity;
  after[1].linear_velocity_W = kDt * kGravity;
  after[0].rotation_WB = Quaternion(Eigen::AngleAxisd(3.1, Vector3::UnitY()));
  EXPECT_EQ(Judge().sides_changed, 0);
  shapes[0] = Shape::Sphere(1);
  before[0].radius = after[0].radius = 1;
  EXPECT_EQ(Judge().sides_changed, 0);
}

// A plate that turns by less than a look sees a straight way bend by 0.15 m. What goes past its edge does not go through it, and what
// goes through it beside its edge does.
TEST_F(LedgerTest, AWayBendsBetweenTwoLooks) {
  shapes[0] = Shape::Box({1, 1, 0.001});
  before[0].kind = after[0].kind = BodyKind::kKinematic;
  for (const double turn : {-0.15, 0.15}) {
    before[0].angular_velocity_W = after[0].angular_velocity_W = turn / kDt * Vector3::UnitX();
    before[0].rotation_WB = Exp(-0.5 * turn * Vector3::UnitX());
    after[0].rotation_WB = before[0].rotation_WB.conjugate();
    for (const double y : {0.85, 1.05}) {
      before[1].position_W = {0, y, 2};
      before[1].linear_velocity_W = {0, 0, -40};
      after[1] = before[1];
      after[1].position_W += kDt * before[1].linear_velocity_W + 0.5 * kDt * kDt * kGravity;
      after[1].linear_velocity_W += kDt * kGravity;
      EXPECT_EQ(Judge().sides_changed, y < 1) << turn << " " << y;
    }
  }
}

// Past the corner of a plate that turns. By 1e9 rad in a step nobody can follow it: that ends, and is not taken for clean.
TEST_F(LedgerTest, AWayThatCannotBeFollowedIsNotClean) {
  before[0].kind = after[0].kind = BodyKind::kKinematic;
  before[1].position_W = {1.3, 0, 1};
  before[1].linear_velocity_W = {0, 0, -20};
  after[1] = before[1];
  after[1].position_W += kDt * before[1].linear_velocity_W + 0.5 * kDt * kDt * kGravity;
  after[1].linear_velocity_W += kDt * kGravity;
  for (const double rate : {31.0, 1e10}) {
    before[0].angular_velocity_W = after[0].angular_velocity_W = {0, rate, 0};
    after[0].rotation_WB = Exp(kDt * before[0].angular_velocity_W);
    EXPECT_EQ(Judge().sides_changed, rate > 31) << rate;
  }
}

// A wall that moves does work: the body may gain what it did, and no more.
TEST_F(LedgerTest, CountsTheWorkOfMovingWalls) {
  before[0].kind = after[0].kind = BodyKind::kKinematic;
  before[0].linear_velocity_W = after[0].linear_velocity_W = {0, 0, 2};
  after[0].position_W.z() += kDt * 2;
  before[1].linear_velocity_W = Vector3::Zero();
  LedgerImpulse blow;  // elastic: the body leaves with twice the wall's speed
  blow.contact.body_a = 0, blow.contact.body_b = 1;
  blow.contact.point_W = before[1].position_W;
  blow.impulse_W = {0, 0, 4};
  impulses = {blow};
  after[1] = before[1];
  after[1].linear_velocity_W = Vector3(0, 0, 4) + kDt * kGravity;
  after[1].position_W += kDt * Vector3(0, 0, 4) + 0.5 * kDt * kDt * kGravity;
  const Ledger ledger = Judge();
  EXPECT_LT(ledger.energy_created.value, 1e-12);
  EXPECT_LT(ledger.momentum_unexplained.value, 1e-14);
}

// What solves may create is told by the solves of the body's own group. Two boxes are struck by the plate far from each other; the first one
// leaves faster than it came.
TEST_F(LedgerTest, RoughSolvesElsewhereExcuseNothing) {
  shapes.push_back(shapes[1]);
  before[1].linear_velocity_W = {0, 0, -2};
  before.push_back(before[1]);
  before[2].position_W.x() = 50;
  after = before;
  for (const int i : {1, 2}) {
    LedgerImpulse blow;
    blow.contact.body_a = 0, blow.contact.body_b = i;
    blow.contact.point_W = before[i].position_W;
    blow.impulse_W = {0, 0, i == 1 ? 4.1 : 2};
    impulses.push_back(blow);
    const Vector3 struck = before[i].linear_velocity_W + blow.impulse_W;
    after[i].linear_velocity_W = struck + kDt * kGravity;
    after[i].position_W += kDt * struck + 0.5 * kDt * kDt * kGravity;
  }
  EXPECT_GT(Judge().energy_created.value, 1e-2);
  EXPECT_EQ(Judge().energy_created.body, 1);
  impulses[1].accuracy = 1;
  EXPECT_GT(Judge().energy_created.value, 1e-2);
  impulses[0].accuracy = 1;
  EXPECT_LT(Judge().energy_created.value, 1e-12);
}

// A plate falls through a ball beside its own centre: whichever of the two cannot move.
TEST_F(LedgerTest, WhatFallsThroughAWallBesideItsCentreIsTold) {
  shapes = {Shape::Sphere(0.1), Shape::Box({1, 1, 0.05})};
  for (const int wall : {0, 1}) {
    for (const int i : {0, 1}) {
      Body& b = before[i];
      b = Body();
      b.kind = i == wall ? BodyKind::kFixed : BodyKind::kDynamic;
      b.radius = shapes[i].radius();
      b.inertia_B = shapes[i].MassFromMass(1).inertia_B;
      b.position_W = i == 0 ? Vector3(0.7, 0, 0) : Vector3::Zero();
      if (i == wall) continue;
      b.position_W.z() += i == 0 ? -2 : 2;
      b.linear_velocity_W = {0, 0, i == 0 ? 40.0 : -40.0};
    }
    after = before;
    const Vector3 start = before[1 - wall].linear_velocity_W;
    after[1 - wall].linear_velocity_W += kDt * kGravity;
    after[1 - wall].position_W += kDt * start + 0.5 * kDt * kDt * kGravity;
    EXPECT_GE(Judge().sides_changed, 1) << wall;
  }
}

// A bat that turns passes over a ball at rest in a crowd, which looks where bodies are when a step ends. Its own centre rests as well: the
// ball's goes through it as the bat sees it.
TEST(Ledger, TellsOfABatThatTurnsThroughABall) {
  int hit = 0, told = 0;
  for (int phase = 0; phase < 24; ++phase) {
    constexpr double kTurn = 0.5;  // [rad] a step
    const double place = 0.5 + 0.09 * phase;
    Settings settings = testing::AsCrowd(testing::Awake());
    settings.gravity.setZero();
    World world(settings);
    BodyDefinition bat{
        .shape = Shape::Box({1, 0.02, 0.1}), .kind = BodyKind::kKinematic, .friction = 0, .restitution = 1};
    bat.angular_velocity_W = {0, 0, kTurn / kDt};
    world.Add(bat);
    const int ball = world.Add({.shape = Shape::Sphere(0.05),
                                .mass = 1,
                                .position_W = {0.8 * std::cos(place), 0.8 * std::sin(place), 0},
                                .friction = 0,
                                .restitution = 1});
    bool failed = false;
    for (int step = 0; step < static_cast<int>(place / kTurn) + 3; ++step) failed = world.Step(kDt).Failed() || failed;
    const bool moves = world.body(ball).linear_velocity_W.norm() > 0.1;
    EXPECT_TRUE(moves || failed) << phase;
    hit += moves;
    told += failed;
  }
  EXPECT_GT(hit, 0);
  EXPECT_GT(told, 0);
}

// What is no number is not clean, wherever it stands.
TEST_F(LedgerTest, NoNumberIsNotClean) {
  const std::vector<Body> good = after;
  EXPECT_TRUE(Judge().Clean());
  for (int what = 0; what < 4; ++what) {
    after = good;
    double* const at[] = {after[1].position_W.data(), after[1].rotation_WB.coeffs().data(),
                          after[1].linear_velocity_W.data(), after[1].angular_velocity_W.data()};
    *at[what] = NAN;
    EXPECT_FALSE(Judge().Clean()) << what;
  }
}

}  // namespace
}  // namespace islet
