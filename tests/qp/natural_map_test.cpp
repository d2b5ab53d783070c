#include "qp/natural_map.h"

#include <gtest/gtest.h>

#include <cmath>

#include "tests/support/random_problems.h"

namespace islet::testing {
namespace {

// By hand; the edge of the cone of friction 3/4 is (4, 3) / 5.
TEST(NaturalMap, NearestPointOfTheCone) {
  const struct {
    double friction;
    Vector3 from, to;
  } cases[] = {{0.75, {2, 1, 1}, {2, 1, 1}},   {0.75, {0, 5, 0}, {2.4, 1.8, 0}},
               {0.75, {-3, 0, -4}, {0, 0, 0}}, {0.75, {-2, 0, -4}, {0.64, 0, -0.48}},
               {0, {2, 0, 0}, {2, 0, 0}},      {0, {2, 1, 1}, {2, 0, 0}},
               {0, {-2, 1, 0}, {0, 0, 0}},     {0, {-2, 0, 0}, {0, 0, 0}},
               {0.75, {-2, 0, 0}, {0, 0, 0}},  {0.75, {0, 0, 0}, {0, 0, 0}},
               {0, {0, 0, 0}, {0, 0, 0}}};
  for (const auto& [friction, from, to] : cases)
    EXPECT_LT((qp::ProjectOnCircularCone(from, friction) - to).norm(), 1e-15) << friction << " " << from.transpose();
}

// What flies away from the ground breaks no law, whether it is rough or not, and moves along it or not; what approaches does: if it
// slides on rough ground by as much as (-0.2, -1), its velocity with the slip added, reversed, has along the cone's edge (2, 1).
TEST(NaturalMap, WhatOpensMeetsTheLaw) {
  const struct {
    double friction, aside, approaching;
  } cases[] = {{0, 0, 0.3}, {0, 1, 0.3}, {0.5, 0, 0.3}, {0.5, 1, 0.6 / std::sqrt(5)}};
  for (const auto& [friction, aside, approaching] : cases) {
    ProblemBuilder builder;
    builder.AddBox({0, 0, 0.5}, {0.5, 0.5, 0.5}, 2, {aside, 0, 0.3});
    builder.AddFace(-1, 0, Vector3::Zero(), 0.5, 0.5, friction);
    const std::vector<Vector3> nothing(4, Vector3::Zero());
    EXPECT_EQ(qp::CoulombMap(builder.problem, FreeVelocities(builder.problem), nothing).max, 0);
    builder.problem.bodies[0].velocity[2] = -0.3;
    const qp::NaturalMap map = qp::CoulombMap(builder.problem, FreeVelocities(builder.problem), nothing);
    EXPECT_NEAR(map.max, approaching, 1e-15);
    EXPECT_NEAR(map.rms, approaching, 1e-15);
  }
}

}  // namespace
}  // namespace islet::testing
