// Bodies whose geometry a function answers: they move as those that islet knows.
#include <cmath>

#include <gtest/gtest.h>

#include "engine/world.h"
#include "tests/support/worlds.h"

namespace islet {
namespace {

using testing::AsCrowd;
using testing::Awake;
using testing::Floor;

// A ball of radius r that knows half-spaces and other such balls.
Shape OwnBall(double r) {
  CustomShape ball;
  ball.half_extents.setConstant(r);
  ball.size = 2 * r;
  ball.volume = 4.0 / 3 * M_PI * r * r * r;
  ball.inertia_per_mass = 0.4 * r * r * Matrix3::Identity();
  ball.collide = [r](const CustomQuery& q, std::vector<Contact>* contacts) {
    Contact c;
    if (q.other->kind() == ShapeKind::kHalfSpace) {
      const Vector3 up = q.other_rotation_WB.col(2);
      c.normal_W = -up;
      c.gap = up.dot(q.position_W - q.other_position_W) - r;
      c.point_W = q.position_W - (r + 0.5 * c.gap) * up;
    } else {
      const Vector3 between = q.other_position_W - q.position_W;
      c.normal_W = between.normalized();
      c.gap = between.norm() - r - q.other->half_extents().x();
      c.point_W = q.position_W + (r + 0.5 * c.gap) * c.normal_W;
    }
    if (c.gap <= q.reach) contacts->push_back(c);
  };
  return Shape::Custom(ball);
}

// Balls thrown together on a floor end where spheres do.
TEST(CustomShape, MovesAsWhatIsletKnows) {
  for (const bool crowd : {false, true}) {
    World known(crowd ? AsCrowd(Awake()) : Awake()), own(crowd ? AsCrowd(Awake()) : Awake());
    for (World* world : {&known, &own}) {
      world->Add(Floor(0.5, 0.5));
      for (int i = 0; i < 4; ++i) {
        BodyDefinition ball = testing::Ball({0.7 * i, 0.05 * i, 0.4 + 0.2 * i}, 0.3, 0.5, 0.5);
        if (world == &own) ball.shape = OwnBall(0.3);
        ball.linear_velocity_W = {2 - 1.0 * i, 0, 0};
        world->Add(ball);
      }
      for (int frame = 0; frame < 30; ++frame) EXPECT_FALSE(world->Step(1.0 / 60).Failed()) << frame;
    }
    for (int i = 1; i <= 4; ++i) {
      EXPECT_LT((known.body(i).position_W - own.body(i).position_W).norm(), 2e-3) << i << crowd;
      EXPECT_GT(own.body(i).position_W.z(), 0.3 - 1e-3);
    }
  }
}

TEST(CustomShape, WhatItThrowsLeavesTheWorldAsItWas) {
  CustomShape bad;
  bad.half_extents.setConstant(0.5);
  bad.size = 1, bad.volume = 1, bad.inertia_per_mass = Matrix3::Identity();
  bad.collide = [](const CustomQuery&, std::vector<Contact>* contacts) {
    Contact c;
    c.gap = NAN;
    contacts->push_back(c);
  };
  World world(Awake());
  world.Add(Floor());
  world.Add({.shape = Shape::Custom(bad), .mass = 1, .position_W = {0, 0, 0.6}});
  EXPECT_THROW(world.Step(1.0 / 60), std::invalid_argument);
  EXPECT_EQ(world.body(1).position_W.z(), 0.6);
  EXPECT_EQ(world.time(), 0);
  EXPECT_THROW(world.Save().ToBytes(), std::invalid_argument);
}

TEST(CustomShape, RefusesWhatIsNoShape) {
  CustomShape empty;
  EXPECT_THROW(Shape::Custom(empty), std::invalid_argument);
  empty.half_extents.setConstant(1);
  empty.size = empty.volume = 1;
  empty.inertia_per_mass.setIdentity();
  EXPECT_THROW(Shape::Custom(empty), std::invalid_argument);  // no function
}

}  // namespace
}  // namespace islet
