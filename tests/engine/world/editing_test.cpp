// Bodies that come, go and change while a world runs.
#include <algorithm>
#include <atomic>
#include <cmath>
#include <functional>
#include <stdexcept>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "engine/world.h"
#include "tests/support/worlds.h"

namespace islet {
namespace {

using testing::AsCrowd;
using testing::Awake;
using testing::Cube;
using testing::Floor;
using testing::kGravity;
using testing::StepTimes;

constexpr double kDt = 1.0 / 60;

Settings OneThread() {
  Settings settings;
  settings.threads = 1;
  return settings;
}

// What is thrown names all of these.
template <typename Error>
void ExpectThrown(const std::function<void()>& act, const std::string& part) {
  try {
    act();
    ADD_FAILURE() << "nothing was thrown";
  } catch (const Error& error) {
    EXPECT_NE(std::string(error.what()).find(part), std::string::npos) << error.what();
  }
}

TEST(Editing, NumbersAreUsedAgainAndIdsAreNot) {
  World world(OneThread());
  world.Add(Floor());
  BodyDefinition cube = Cube({0, 0, 0.5});
  cube.user_data = 17;
  const int first = world.Add(cube);
  const BodyId id = world.id(first);
  StepTimes(&world, 2);
  EXPECT_TRUE(world.Lives(id));
  EXPECT_EQ(world.user_data(first), 17u);
  world.Remove(first);
  EXPECT_FALSE(world.Lives(id));
  EXPECT_EQ(world.Add(Cube({5, 0, 0.5})), 2) << "a step must run without it first";
  StepTimes(&world, 1);
  EXPECT_EQ(world.Add(Cube({10, 0, 0.5})), first);
  EXPECT_FALSE(world.Lives(id));
  EXPECT_TRUE(world.Lives(world.id(first)));
  EXPECT_EQ(world.user_data(first), 0u);
  EXPECT_FALSE(world.Lives({-1, 0}));
  EXPECT_FALSE(world.Lives({99, 0}));
}

// Ten live bodies take as many numbers after thousands have come and gone.
TEST(Editing, AWorldDoesNotGrowByWhatIsGone) {
  World world(OneThread());
  world.Add(Floor());
  std::vector<int> live;
  for (int i = 0; i < 10; ++i) live.push_back(world.Add(Cube({3.0 * i, 0, 0.5})));
  for (int round = 0; round < 500; ++round) {
    const int gone = round % 10;
    const Vector3 place = world.body(live[gone]).position_W;
    world.Remove(live[gone]);
    StepTimes(&world, 1);
    live[gone] = world.Add(Cube(place));
  }
  EXPECT_LE(world.bodies().size(), 12u);
}

// Nothing of who had the number before is left: not its contacts, not the impulses they remember, not how long it stood still.
TEST(Editing, ANumberUsedAgainRemembersNothing) {
  for (const bool crowd : {false, true})
    for (const bool rests : {false, true}) {
      const Settings settings = crowd ? AsCrowd(OneThread()) : OneThread();
      World fresh(settings), used(settings);
      for (World* world : {&fresh, &used}) world->Add(Floor());
      const int old = used.Add(Cube({0, 0, 0.5}));
      const int other = used.Add(Cube({0, 0, 1.5}));
      StepTimes(&used, 60);
      used.Remove(old);
      used.Remove(other);
      StepTimes(&used, 1);
      const BodyDefinition ball{
          .shape = Shape::Sphere(0.5), .mass = 7, .position_W = {0, 0, 0.6}, .linear_velocity_W = {1, 0, 0}};
      const BodyDefinition next = rests ? Cube({0, 0, 0.5}) : ball;
      ASSERT_EQ(used.Add(next), old);
      ASSERT_EQ(fresh.Add(next), 1);
      for (int i = 0; i < 90; ++i) {
        StepTimes(&fresh, 1);
        StepTimes(&used, 1);
        ASSERT_EQ(fresh.body(1).position_W, used.body(old).position_W) << i;
        ASSERT_EQ(fresh.body(1).frozen, used.body(old).frozen) << i;
      }
    }
}

TEST(Editing, KindsChange) {
  for (const bool crowd : {false, true}) {
    World world(crowd ? AsCrowd(OneThread()) : OneThread());
    world.Add(Floor());
    const int shelf =
        world.Add({.shape = Shape::Box({1, 1, 0.1}), .kind = BodyKind::kFixed, .density = 3, .position_W = {0, 0, 2}});
    const int cube = world.Add(Cube({0, 0, 2.6}));
    StepTimes(&world, 60);
    EXPECT_NEAR(world.body(cube).position_W.z(), 2.6, 1e-6);
    world.SetKind(shelf, BodyKind::kDynamic);
    EXPECT_NEAR(world.body(shelf).mass, 3 * 0.8, 1e-12);
    StepTimes(&world, 120);
    EXPECT_NEAR(world.body(shelf).position_W.z(), 0.1, 1e-3);
    EXPECT_NEAR(world.body(cube).position_W.z(), 0.7, 1e-3);
    world.SetKind(cube, BodyKind::kFixed);
    world.Remove(shelf);
    StepTimes(&world, 30);
    EXPECT_NEAR(world.body(cube).position_W.z(), 0.7, 1e-3);
    EXPECT_TRUE(world.body(cube).linear_velocity_W.isZero(0));
  }
}

TEST(Editing, MassAndMaterialChange) {
  World world(OneThread());
  world.Add(Floor(0.5, 0, 0.4));  // tan 0.4 = 0.42: it sticks
  const double c = std::cos(0.4), s = std::sin(0.4);
  BodyDefinition cube = Cube({0.5 * s, 0, 0.5 * c});
  cube.rotation_WB = testing::Turn(0.4, Vector3::UnitY());
  const int number = world.Add(cube);
  StepTimes(&world, 60);
  const Vector3 at = world.body(number).position_W;
  EXPECT_NEAR(at.x(), 0.5 * s, 1e-4);
  world.SetMass(number, 4);
  EXPECT_NEAR(world.body(number).inertia_B(0, 0), 4.0 / 6, 1e-12);
  StepTimes(&world, 5);
  EXPECT_NEAR(world.ImpulseOn(number).z(), 4 * kGravity * kDt, 1e-6);
  world.SetMaterial(number, 0.05, 0);
  StepTimes(&world, 60);
  const double friction = MixFriction(0.5, 0.05), along = kGravity * (s - friction * c);
  EXPECT_NEAR((world.body(number).position_W - at).norm(), 0.5 * along, 2e-2 * along);
}

// A resting stack loses what it stands on, in every way that a world can take it away.
TEST(Editing, WhatNoLongerTouchesFallsThrough) {
  for (const bool crowd : {false, true})
    for (int way = 0; way < 2; ++way) {
      World world(crowd ? AsCrowd(OneThread()) : OneThread());
      world.Add(Floor());
      const int table =
          world.Add({.shape = Shape::Box({2, 2, 0.1}), .kind = BodyKind::kFixed, .position_W = {0, 0, 3}});
      const int lower = world.Add(Cube({0, 0, 3.6})), upper = world.Add(Cube({0, 0, 4.6}));
      StepTimes(&world, 60);
      ASSERT_TRUE(world.body(lower).frozen);
      if (way == 0) world.SetLayers(table, 2, 2);
      if (way == 1) world.SetCollision(table, lower, false);
      for (int i = 0; i < 150; ++i) {
        const StepReport report = world.Step(kDt);
        EXPECT_FALSE(report.Failed()) << crowd << way << i;
      }
      EXPECT_NEAR(world.body(lower).position_W.z(), 0.5, 1e-3) << crowd << way;
      EXPECT_NEAR(world.body(upper).position_W.z(), way == 0 ? 1.5 : 3.6, 1e-3) << crowd << way;
    }
}

// Two balls that have nothing to do with each other pass, and the ledger has nothing against it.
TEST(Editing, WhatIsSetApartPasses) {
  for (const bool crowd : {false, true}) {
    Settings settings = crowd ? AsCrowd(Awake()) : Awake();
    settings.gravity.setZero();
    World world(settings);
    const int a = world.Add({.shape = Shape::Sphere(0.5), .linear_velocity_W = {3, 0, 0}});
    const int b = world.Add({.shape = Shape::Sphere(0.5), .position_W = {2, 0, 0}});
    world.SetCollision(b, a, false);
    StepTimes(&world, 90);
    EXPECT_EQ(world.body(a).linear_velocity_W, Vector3(3, 0, 0));
    EXPECT_EQ(world.body(b).linear_velocity_W, Vector3(0, 0, 0));
    world.SetCollision(a, b, true);
    world.Teleport(a, {0, 0, 0}, Quaternion::Identity());
    StepTimes(&world, 60);
    EXPECT_GT(world.body(b).linear_velocity_W.x(), 1);
  }
}

// Thrown up through a platform that holds from above only: it lands there, stays, and rests.
TEST(Editing, APlatformMayHoldFromAboveOnly) {
  for (const bool crowd : {false, true}) {
    World world(crowd ? AsCrowd(OneThread()) : OneThread());
    world.Add(Floor());
    const int platform =
        world.Add({.shape = Shape::Box({2, 2, 0.05}), .kind = BodyKind::kFixed, .position_W = {0, 0, 1}});
    const int cube =
        world.Add({.shape = Shape::Box({0.25, 0.25, 0.25}), .position_W = {0, 0, 0.5}, .linear_velocity_W = {0, 0, 6}});
    const int beside = world.Add({.shape = Shape::Box({0.25, 0.25, 0.25}), .position_W = {1, 0, 0.25}});
    world.SetCollisionCallback([=](int a, int, const Body&, const Body& b) {
      return a != platform || b.position_W.z() - 0.25 >= 1.05 - 1e-3;
    });
    for (int i = 0; i < 90; ++i) {
      const StepReport report = world.Step(kDt);
      EXPECT_FALSE(report.Failed()) << crowd << i;
      EXPECT_EQ(report.ledger.sides_changed, 0) << crowd << i;
    }
    EXPECT_NEAR(world.body(cube).position_W.z(), 1.3, 1e-4) << crowd;
    EXPECT_TRUE(world.body(cube).frozen) << crowd;
    EXPECT_NEAR(world.body(beside).position_W.z(), 0.25, 1e-4) << crowd;
    world.SetCollisionCallback({});  // and now it is a wall like any other
    world.SetVelocity(beside, {0, 0, 6}, {0, 0, 0});
    double highest = 0;
    for (int i = 0; i < 30; ++i) {
      world.Step(kDt);
      highest = std::max(highest, world.body(beside).position_W.z());
    }
    EXPECT_NEAR(highest, 0.7, 1e-2) << crowd;
  }
}

// It is asked of what a step found, whatever moves meanwhile: the answer cannot depend on who asks when.
TEST(Editing, CollisionCallbacksSeeTheStartOfTheStep) {
  for (const bool crowd : {false, true}) {
    World world(crowd ? AsCrowd(Awake()) : Awake());
    world.Add(Floor());
    const int a = world.Add(Cube({0, 0, 0.6})), b = world.Add(Cube({0.3, 0, 2}));
    std::atomic<int> asked = 0, wrong = 0;
    std::vector<Body> start;
    world.SetCollisionCallback([&](int i, int k, const Body& x, const Body& y) {
      ++asked;
      if (i >= k || x.position_W != start[i].position_W || y.linear_velocity_W != start[k].linear_velocity_W) ++wrong;
      return true;
    });
    for (int i = 0; i < 40; ++i) {
      start.assign(world.bodies().begin(), world.bodies().end());
      world.Step(kDt);
    }
    EXPECT_GT(asked, 40) << crowd;
    EXPECT_EQ(wrong, 0) << crowd;
    EXPECT_NEAR(world.body(b).position_W.z() - world.body(a).position_W.z(), 1, 1e-3) << crowd;
  }
}

// Also where the step is cut into parts: 60 m/s past what is 0.3 m away.
TEST(Editing, CollisionCallbacksSeeTheStartOfACutStep) {
  Settings settings = Awake();
  settings.group_bodies = 1;
  World world(settings);
  world.SetGravity({0, 0, 0});
  world.Add({.shape = Shape::Sphere(0.1), .linear_velocity_W = {60, 0, 0}});
  world.Add({.shape = Shape::Sphere(0.1), .position_W = {0.5, 0, 0}});
  std::atomic<int> asked = 0, wrong = 0;
  world.SetCollisionCallback([&](int, int, const Body& x, const Body& y) {
    ++asked;
    wrong += x.position_W != Vector3::Zero() || y.linear_velocity_W != Vector3::Zero();
    return true;
  });
  const std::int64_t pieces = world.Step(1.0 / 60).pieces;
  EXPECT_GT(world.body(1).linear_velocity_W.x(), 10) << pieces;
  EXPECT_GT(asked, 2);
  EXPECT_EQ(wrong, 0);
}

// A crate rests on a slope, and a snapshot of that goes to a world in which a callback makes everything ice.
TEST(Editing, WhoRestoresAsksItsOwnCallbacks) {
  for (const bool crowd : {false, true})
    for (const bool slips : {false, true}) {
      World world(crowd ? AsCrowd(OneThread()) : OneThread());
      world.Add(Floor(0.5, 0, 0.4));
      BodyDefinition cube = testing::CubeOnIncline(0.4, 0.5);
      const int number = world.Add(cube);
      StepTimes(&world, 60);
      ASSERT_TRUE(world.body(number).frozen);
      const WorldSnapshot saved = world.Save();
      World other(crowd ? AsCrowd(OneThread()) : OneThread());
      if (slips) other.SetMaterialCallback([](const Contact&, const Body&, const Body&) { return Material{0, 0}; });
      other.Restore(saved);
      EXPECT_EQ(other.body(number).frozen, !slips);
      StepTimes(&other, 30);
      const double along = slips ? kGravity * std::sin(0.4) * 30 * kDt : 0;
      EXPECT_NEAR(other.body(number).linear_velocity_W.norm(), along, 1e-6) << crowd;
    }
}

// Of what rests under a heavy press the friction goes: what it held is 2.5e-6 of what the block carries, and it slides.
TEST(Editing, FrictionThatGoesUnderALoadShows) {
  World world(AsCrowd(OneThread()));
  const int floor = world.Add(Floor(0.5, 0));
  const int block = world.Add(Cube({0, 0, 0.5}, 0.5));
  BodyDefinition press = Cube({0, 0, 1.5}, 0);
  press.mass = 1e3;
  world.Add(press);
  world.SetForce(block, {0.05, 0, 0}, Vector3::Zero());
  StepTimes(&world, 60);
  ASSERT_TRUE(world.body(block).frozen);
  world.SetMaterial(floor, 0, 0);
  StepTimes(&world, 1);
  EXPECT_NEAR(world.body(block).linear_velocity_W.x(), 0.05 * kDt, 0.02 * kDt);
}

TEST(Editing, WhatIsNoMassIsRefusedWhenItIsToMove) {
  CustomShape custom;
  custom.half_extents = {1, 1, 1};
  custom.size = 2;
  custom.volume = 8;
  custom.inertia_per_mass = Vector3(1, 1, 10).asDiagonal();
  custom.collide = [](const CustomQuery&, std::vector<Contact>*) {};
  World world(OneThread());
  const int body = world.Add({.shape = Shape::Custom(custom), .kind = BodyKind::kFixed});
  ExpectThrown<std::invalid_argument>([&] { world.SetKind(body, BodyKind::kDynamic); }, "inertia");
  EXPECT_EQ(world.body(body).kind, BodyKind::kFixed);
}

// A step that is refused for a newcomer leaves what touches; who only asks for overlaps is shown them.
TEST(Editing, ARefusedStepLeavesTheContacts) {
  World world(OneThread());
  world.Add(Floor());
  world.Add(Cube({0, 0, 0.5}));
  StepTimes(&world, 5);
  const size_t touching = world.contacts().size();
  world.Add(Cube({0.5, 0, 0.5}));
  ExpectThrown<std::invalid_argument>([&] { world.Step(kDt); }, "bodies 1 and 2");
  EXPECT_EQ(world.contacts().size(), touching);
  ExpectThrown<std::invalid_argument>([&] { world.CheckInitialOverlap(); }, "bodies 1 and 2");
  EXPECT_GT(world.contacts().size(), touching);
}

// A crowd's cubes that rest, too, in steps longer than freezing waits for.
TEST(Editing, WithoutMemoryNothingFreezes) {
  for (const bool crowd : {false, true}) {
    Settings settings = crowd ? AsCrowd(OneThread()) : OneThread();
    settings.stateless = true;
    World world(settings);
    world.Add(Floor());
    world.Add(Cube({0, 0, 0.5}));
    for (int i = 0; i < 10; ++i) {
      world.Step(0.11);
      EXPECT_FALSE(world.body(1).frozen) << i;
    }
  }
}

TEST(Editing, KinematicBodiesAreMovedToPoses) {
  World world(OneThread());
  world.Add(Floor());
  const int lift =
      world.Add({.shape = Shape::Box({1, 1, 0.1}), .kind = BodyKind::kKinematic, .position_W = {0, 0, 0.2}});
  const int cube = world.Add(Cube({0, 0, 0.8}));
  for (int i = 1; i <= 60; ++i) {
    const double t = i * kDt;
    const Quaternion rotation = testing::Turn(0.5 * t, Vector3::UnitZ());
    world.MoveTo(lift, {0, 0, 0.2 + 0.3 * t * t}, rotation, kDt);
    StepTimes(&world, 1);
    EXPECT_LT((world.body(lift).position_W - Vector3(0, 0, 0.2 + 0.3 * t * t)).norm(), 1e-12);
    EXPECT_LT((world.body(lift).rotation_WB.coeffs() - rotation.coeffs()).norm(), 1e-12);
  }
  EXPECT_NEAR(world.body(cube).position_W.z(), 1.1, 2e-3);
  ExpectThrown<std::invalid_argument>([&] { world.MoveTo(cube, {0, 0, 0}, Quaternion::Identity(), kDt); }, "kinematic");
  ExpectThrown<std::invalid_argument>([&] { world.MoveTo(lift, {0, 0, 0}, Quaternion::Identity(), 0); }, "dt");
}

// What a callback throws reaches the caller, and the world goes on as if the step had not been tried.
TEST(Editing, ACallbackMayThrow) {
  for (const Settings& settings : {Awake(), AsCrowd(Awake()), OneThread()}) {
    World calm(settings), shaken(settings);
    bool throws = false, of_pairs = false;
    shaken.SetCollisionCallback([&](int, int, const Body&, const Body&) {
      if (throws && of_pairs) throw std::runtime_error("no such material");
      return true;
    });
    shaken.SetMaterialCallback([&](const Contact& c, const Body&, const Body&) -> Material {
      if (throws && !of_pairs) throw std::runtime_error("no such material");
      return {c.friction, c.restitution};
    });
    calm.SetMaterialCallback([](const Contact& c, const Body&, const Body&) -> Material {
      return {c.friction, c.restitution};
    });
    for (World* world : {&calm, &shaken}) {
      world->Add(Floor());
      for (int i = 0; i < 4; ++i) world->Add(Cube({0.1 * i, 0, 0.7 + 1.2 * i}));
      for (int i = 0; i < 4; ++i) world->Add(Cube({3, 3.0 * i, 0.5 + 0.1 * i}));  // these freeze one by one
    }
    for (int i = 0; i < 70; ++i) {
      const std::uint64_t hash = shaken.StateHash();
      const std::vector<std::byte> bytes = shaken.Save().ToBytes();
      const double time = shaken.time();
      const auto bodies = shaken.bodies();
      const bool rests = std::all_of(bodies.begin() + 1, bodies.end(), [](const Body& b) { return b.frozen; });
      throws = i > 20 && !rests;  // the lowest has landed
      of_pairs = i % 4 == 0;
      if (throws) {
        ExpectThrown<std::runtime_error>([&] { shaken.Step(kDt); }, "no such material");
        EXPECT_EQ(shaken.StateHash(), hash) << i;
        EXPECT_TRUE(shaken.Save().ToBytes() == bytes) << i;
        EXPECT_EQ(shaken.time(), time);
        throws = false;
      }
      StepTimes(&shaken, 1);
      StepTimes(&calm, 1);
      ASSERT_EQ(shaken.StateHash(), calm.StateHash()) << i;
    }
  }
}

TEST(Editing, AWorldInAStepIsLeftAlone) {
  World world(OneThread());
  world.Add(Floor());
  const int cube = world.Add(Cube({0, 0, 0.6}));
  std::function<void()> act;
  world.SetMaterialCallback([&](const Contact& c, const Body&, const Body&) -> Material {
    act();
    return {c.friction, c.restitution};
  });
  const std::vector<std::function<void()>> misuses{[&] { world.Step(kDt); },
                                                   [&] {
                                                     world.Add(Cube({9, 9, 9}));
                                                   },
                                                   [&] { world.Remove(cube); },
                                                   [&] {
                                                     world.SetForce(cube, {1, 0, 0}, {0, 0, 0});
                                                   },
                                                   [&] {
                                                     world.CastRay({0, 0, 9}, {0, 0, -9});
                                                   },
                                                   [&] {
                                                     world.SetGravity({0, 0, 0});
                                                   },
                                                   [&] { world.Restore(world.Save()); }};
  const std::uint64_t hash = world.StateHash();
  for (const auto& misuse : misuses) {
    act = misuse;
    ExpectThrown<std::logic_error>(
        [&] {
          for (int i = 0; i < 30; ++i) world.Step(kDt);
        },
        "in a step");
  }
  act = [] {};
  EXPECT_NE(hash, 0u);
  StepTimes(&world, 60);
  EXPECT_NEAR(world.body(cube).position_W.z(), 0.5, 1e-3);
}

TEST(Editing, NumbersBeyondReasonAreRefused) {
  World world(OneThread());
  const int cube = world.Add(Cube({0, 0, 0.5}));
  ExpectThrown<std::invalid_argument>([&] { world.SetForce(cube, {1e300, 0, 0}, {0, 0, 0}); }, "1e+300");
  ExpectThrown<std::invalid_argument>([&] { world.SetVelocity(cube, {0, 0, 0}, {0, -1e200, 0}); }, "angular velocity");
  ExpectThrown<std::invalid_argument>([&] { world.SetMass(cube, 1e300); }, "mass");
  ExpectThrown<std::invalid_argument>([&] { world.SetMass(cube, 1, Vector3(1, 1, 3).asDiagonal()); }, "inertia");
  ExpectThrown<std::invalid_argument>([&] { world.SetMaterial(cube, -1, 0); }, "friction");
  ExpectThrown<std::invalid_argument>([&] { world.SetCollision(cube, cube, false); }, "itself");
  ExpectThrown<std::invalid_argument>([&] { world.SetCollision(cube, 5, false); }, "5");
  ExpectThrown<std::invalid_argument>([&] { world.SetGravity({0, 0, 1e300}); }, "gravity");
  ExpectThrown<std::invalid_argument>([&] { world.id(3); }, "3");
}

TEST(Editing, WhatACallbackReturnsIsChecked) {
  for (const bool crowd : {false, true})
    for (const Material bad :
         {Material{-1, 0}, Material{NAN, 0}, Material{0.5, 2}, Material{0.5, NAN}, Material{INFINITY, 0}}) {
      World world(crowd ? AsCrowd(OneThread()) : OneThread());
      world.Add(Floor());
      world.Add(Cube({0, 0, 0.5}));
      world.SetMaterialCallback([&](const Contact&, const Body&, const Body&) { return bad; });
      ExpectThrown<std::invalid_argument>([&] { world.Step(kDt); }, "bodies 0 and 1");
    }
}

TEST(Editing, ACallbackOfTheOverlapCheckLeavesTheWorldAlone) {
  World world(OneThread());
  world.Add(Floor());
  world.Add(Cube({0, 0, 0.5}));
  world.SetMaterialCallback([&](const Contact& c, const Body&, const Body&) -> Material {
    world.Add(Cube({5, 5, 5}));
    return {c.friction, c.restitution};
  });
  ExpectThrown<std::logic_error>([&] { world.CheckInitialOverlap(); }, "in a step");
  EXPECT_EQ(world.bodies().size(), 2u);
}

TEST(Editing, MassesBeyondReasonAreRefused) {
  World world(OneThread());
  const int cube = world.Add(Cube({0, 0, 5}));
  ExpectThrown<std::invalid_argument>([&] { world.SetMass(cube, 1e-300); }, "1e-300");
  ExpectThrown<std::invalid_argument>([&] { world.SetMass(cube, 1, 1e-300 * Matrix3::Identity()); }, "inertia");
  ExpectThrown<std::invalid_argument>([&] { world.SetMass(cube, 1, 1e300 * Matrix3::Identity()); }, "inertia");
  EXPECT_EQ(world.body(cube).mass, 1);
  BodyDefinition wall = Cube({0, 0, 0});
  wall.kind = BodyKind::kFixed;
  wall.inertia_B = -Matrix3::Identity();
  ExpectThrown<std::invalid_argument>([&] { world.Add(wall); }, "body 1: inertia");
  for (const BodyKind kind : {BodyKind::kDynamic, BodyKind::kFixed, BodyKind::kKinematic}) {
    ExpectThrown<std::invalid_argument>([&] { world.Add({.shape = Shape::Sphere(1), .kind = kind, .mass = NAN}); },
                                        "body 1: mass = nan");
    ExpectThrown<std::invalid_argument>([&] { world.Add({.shape = Shape::Sphere(1), .kind = kind, .density = -1}); },
                                        "body 1: density = -1");
  }
  ExpectThrown<std::invalid_argument>([&] { world.Add({.shape = Shape::Sphere(1e-100)}); }, "body 1: mass");
  ExpectThrown<std::invalid_argument>([&] { world.Add({.shape = Shape::Sphere(1), .kind = static_cast<BodyKind>(7)}); },
                                      "kind");
  ExpectThrown<std::invalid_argument>([&] { world.body(9); }, "9");
  ExpectThrown<std::invalid_argument>([&] { world.shape(-1); }, "-1");
}

}  // namespace
}  // namespace islet
