#include "engine/response/island_problem.h"

#include <random>
#include <vector>

#include <gtest/gtest.h>

#include "tests/support/no_alloc.h"

namespace islet {
namespace {

Body MakeBody(const Vector3& position, const Vector3& linear = Vector3::Zero(),
              const Vector3& angular = Vector3::Zero()) {
  Body body;
  body.mass = 2;
  body.inertia_B = Vector3(1, 2, 2.5).asDiagonal();
  body.position_W = position;
  body.linear_velocity_W = linear;
  body.angular_velocity_W = angular;
  return body;
}

struct Scene {
  std::vector<Body> bodies;
  std::vector<Contact> contacts;
  std::vector<Matrix3> frames;
  ContactFrames view() {
    frames.clear();
    for (const Contact& c : contacts) frames.push_back(ContactFrame(c.normal_W));
    return {contacts, frames};
  }
};

// Upward normal: the frame is (z, x, y). Lever (1, 0, -1) of body 1, at (0, 0, 1).
TEST(IslandGatherer, JacobianByHand) {
  Scene s;
  s.bodies = {MakeBody(Vector3::Zero()), MakeBody({0, 0, 1})};
  s.bodies[0].kind = BodyKind::kFixed;
  s.contacts = {{.body_a = 0, .body_b = 1, .point_W = {1, 0, 0}, .normal_W = Vector3::UnitZ(), .friction = 0.3}};
  qp::Problem problem;
  IslandGatherer().Gather(s.bodies, s.view(), std::vector<int>{1}, std::vector<int>{0}, &problem);
  ASSERT_EQ(problem.num_bodies(), 1);
  ASSERT_EQ(problem.num_contacts(), 1);
  const qp::ContactTerm& c = problem.contacts[0];
  EXPECT_EQ(c.body_a, -1);
  EXPECT_EQ(c.body_b, 0);
  qp::Jacobian expected;          // v + omega x r: z: vz - omega_y; x: vx - omega_y; y: vy + omega_z + omega_x
  expected << 0, 0, 1, 0, -1, 0,  //
      1, 0, 0, 0, -1, 0,          //
      0, 1, 0, 1, 0, 1;
  EXPECT_NEAR((c.jacobian_b - expected).norm(), 0, 1e-15);
  EXPECT_TRUE(c.jacobian_a.isZero(0));
  EXPECT_TRUE(c.drift.isZero(0));
  EXPECT_EQ(c.friction, 0.3);
  EXPECT_EQ(c.target, 0);
  EXPECT_EQ(c.compliance, 0);
  EXPECT_EQ(problem.bodies[0].mass, 2);
  EXPECT_NO_THROW(problem.Validate());
}

TEST(IslandGatherer, KinematicMotionIsDriftFrozenAndFixedAreNot) {
  Scene s;
  s.bodies = {MakeBody(Vector3::Zero(), {0, 0, 3}, {0, 0, 1}), MakeBody({0, 0, 1}), MakeBody({0, 0, 2}, {7, 7, 7}),
              MakeBody({0, 5, 0}, {1, 2, 3})};
  s.bodies[0].kind = BodyKind::kKinematic;
  s.bodies[2].frozen = true;
  s.bodies[3].kind = BodyKind::kKinematic;
  s.contacts = {{.body_a = 0, .body_b = 1, .point_W = {1, 0, 0.5}, .normal_W = Vector3::UnitZ()},
                {.body_a = 1, .body_b = 2, .point_W = {0, 0, 1.5}, .normal_W = Vector3::UnitZ()},
                {.body_a = 1, .body_b = 3, .point_W = {0, 2, 1}, .normal_W = Vector3::UnitY()}};
  qp::Problem problem;
  IslandGatherer().Gather(s.bodies, s.view(), std::vector<int>{1}, std::vector<int>{0, 1, 2}, &problem);
  // body_a moves up at 3 and turns: the point (1, 0, .) goes along y at 1. Relative to a: minus that.
  EXPECT_NEAR((problem.contacts[0].drift - Vector3(-3, 0, -1)).norm(), 0, 1e-15);
  EXPECT_TRUE(problem.contacts[1].drift.isZero(0));
  EXPECT_EQ(problem.contacts[1].body_a, 0);
  EXPECT_EQ(problem.contacts[1].body_b, -1);
  EXPECT_NEAR((problem.contacts[2].drift - s.frames[2].transpose() * Vector3(1, 2, 3)).norm(), 0, 1e-15);
}

TEST(IslandGatherer, RandomWorldAgreesWithBodyAndContact) {
  std::mt19937 rng(1);
  std::uniform_real_distribution<double> uniform(-1, 1);
  const auto vector = [&] { return Vector3(uniform(rng), uniform(rng), uniform(rng)); };
  Scene s;
  for (int i = 0; i < 12; ++i) {
    Body body = MakeBody(vector(), vector(), vector());
    body.rotation_WB = Quaternion(uniform(rng), uniform(rng), uniform(rng), uniform(rng)).normalized();
    if (i % 4 == 0) body.kind = i % 8 ? BodyKind::kKinematic : BodyKind::kFixed;
    if (body.kind == BodyKind::kFixed) body.linear_velocity_W = body.angular_velocity_W = Vector3::Zero();
    s.bodies.push_back(body);
  }
  for (int a = 0; a < 12; ++a)
    for (int b = a + 1; b < 12; ++b)
      if ((a % 4 || b % 4) && uniform(rng) > 0)
        s.contacts.push_back(
            {.body_a = a, .body_b = b, .point_W = vector(), .normal_W = vector().normalized(), .friction = 0.5});
  std::vector<int> members, numbers;
  for (int i = 0; i < 12; ++i)
    if (i % 4) members.push_back(i);
  for (size_t c = 0; c < s.contacts.size(); ++c) numbers.push_back(static_cast<int>(c));
  qp::Problem problem;
  IslandGatherer gatherer;
  gatherer.Gather(s.bodies, s.view(), members, numbers, &problem);
  EXPECT_NO_THROW(problem.Validate());
  qp::Solution solution;
  for (const qp::BodyTerm& body : problem.bodies)
    solution.velocities.insert(solution.velocities.end(), body.velocity.data(), body.velocity.data() + 6);
  std::vector<Body> pushed = s.bodies;
  for (size_t c = 0; c < numbers.size(); ++c) {
    const Contact& contact = s.contacts[c];
    const Vector3 expected =
        s.frames[c].transpose() * RelativeVelocity(contact, s.bodies[contact.body_a], s.bodies[contact.body_b]);
    std::vector<double> before;
    for (const qp::BodyTerm& body : problem.bodies)
      before.insert(before.end(), body.velocity.data(), body.velocity.data() + 6);
    EXPECT_NEAR((qp::ContactVelocity(problem.contacts[c], before.data()) - expected).norm(), 0, 1e-13);
    // Impulses move the problem's bodies as they move those of the world.
    const Vector3 impulse = vector();
    qp::ApplyImpulse(problem, problem.contacts[c], impulse, solution.velocities.data());
    for (const auto& [number, sign] : {std::pair{contact.body_a, -1.0}, std::pair{contact.body_b, 1.0}})
      if (pushed[number].Moves()) pushed[number].ApplyImpulse(sign * (s.frames[c] * impulse), contact.point_W);
  }
  std::vector<Body> scattered = s.bodies;
  IslandGatherer::ScatterVelocities(solution, members, scattered);
  for (size_t i = 0; i < scattered.size(); ++i) {
    EXPECT_NEAR((scattered[i].linear_velocity_W - pushed[i].linear_velocity_W).norm(), 0, 1e-12) << i;
    EXPECT_NEAR((scattered[i].angular_velocity_W - pushed[i].angular_velocity_W).norm(), 0, 1e-12) << i;
    if (i % 4 == 0) {
      EXPECT_EQ(scattered[i].linear_velocity_W, s.bodies[i].linear_velocity_W);
    }
  }
}

// The table of places must be clean after each island.
TEST(IslandGatherer, IslandsOneAfterTheOther) {
  Scene s;
  for (int i = 0; i < 4; ++i) s.bodies.push_back(MakeBody({0, 0, static_cast<double>(i)}));
  s.contacts = {{.body_a = 0, .body_b = 1}, {.body_a = 2, .body_b = 3}};
  IslandGatherer gatherer;
  qp::Problem problem;
  gatherer.Gather(s.bodies, s.view(), std::vector<int>{0, 1}, std::vector<int>{0}, &problem);
  EXPECT_EQ(problem.contacts[0].body_b, 1);
  gatherer.Gather(s.bodies, s.view(), std::vector<int>{3}, std::vector<int>{1}, &problem);
  EXPECT_EQ(problem.contacts[0].body_a, -1);
  EXPECT_EQ(problem.contacts[0].body_b, 0);
  EXPECT_EQ(problem.num_bodies(), 1);
  const testing::AllocationCounter counter;
  gatherer.Gather(s.bodies, {s.contacts, s.frames}, std::vector<int>(), std::vector<int>(), &problem);
  EXPECT_EQ(problem.num_contacts(), 0);
  EXPECT_EQ(counter.count(), 0);
}

}  // namespace
}  // namespace islet
