#include "qp/problem.h"

#include <cmath>
#include <functional>
#include <limits>
#include <stdexcept>

#include <gtest/gtest.h>

#include "tests/support/random_problems.h"

namespace islet::testing {
namespace {

// A ball of radius 1 and mass 2 on the floor below it: normal +z, friction 0.5.
Problem BallOnFloor() {
  ProblemBuilder builder;
  builder.AddBody({0, 0, 1}, 2, 0.8 * Matrix3::Identity());
  builder.AddContact(-1, 0, Vector3::Zero(), Vector3::UnitZ(), 0.5);
  return builder.problem;
}

TEST(Problem, ContactVelocityByHand) {
  Problem problem = BallOnFloor();
  problem.contacts[0].drift = {0.25, 0, 0};
  std::vector<double> v = {0, 0, -3, 0, 0, 0};
  EXPECT_DOUBLE_EQ(qp::ContactVelocity(problem.contacts[0], v.data())[0], -2.75);
  v = {0, 0, 0, 0, 4, 0};  // spin about y moves the lowest point along -x
  const Vector3 u = qp::ContactVelocity(problem.contacts[0], v.data());
  EXPECT_DOUBLE_EQ(u[0], 0.25);
  EXPECT_NEAR(u.tail<2>().norm(), 4, 1e-15);
}

TEST(Problem, DelassusBlockOfABall) {
  // 1/m along the normal; 1/m + r^2/I along the tangents.
  const Problem problem = BallOnFloor();
  const Matrix3 expected = Vector3(0.5, 1.75, 1.75).asDiagonal();
  EXPECT_LT((qp::DelassusBlock(problem, problem.contacts[0]) - expected).norm(), 1e-15);
}

TEST(Problem, ImpulsesChangeContactVelocitiesByTheDelassusBlock) {
  Random random(3);
  for (const NamedProblem& island : RandomIslands(5, 20, 1e3, false)) {
    SCOPED_TRACE(island.name);
    for (const ContactTerm& contact : island.problem.contacts) {
      std::vector<double> v = FreeVelocities(island.problem);
      const Vector3 before = qp::ContactVelocity(contact, v.data()), j = random.Vector(1);
      qp::ApplyImpulse(island.problem, contact, j, v.data());
      const Vector3 change = qp::ContactVelocity(contact, v.data()) - before;
      EXPECT_LT((change - qp::DelassusBlock(island.problem, contact) * j).norm(), 1e-11 * (1 + change.norm()));
    }
  }
}

TEST(Problem, ImpulsesBetweenTwoBodiesKeepMomentum) {
  Random random(4);
  const Problem problem = RandomChain(&random, 2, 0.5, 0.5, 100);
  const std::vector<double> before = FreeVelocities(problem);
  std::vector<double> after = before;
  qp::ApplyImpulse(problem, problem.contacts[1], random.Vector(1), after.data());
  Vector3 change = Vector3::Zero();
  for (int i = 0; i < 2; ++i)
    for (int k = 0; k < 3; ++k) change[k] += problem.bodies[i].mass * (after[6 * i + k] - before[6 * i + k]);
  EXPECT_LT(change.norm(), 1e-14);
}

TEST(Problem, ValidateNamesWhatIsWrong) {
  constexpr double kNaN = std::numeric_limits<double>::quiet_NaN(), kInfinity = std::numeric_limits<double>::infinity();
  struct Case {
    const char* field;
    std::function<void(Problem*)> spoil;
  };
  const Case cases[] = {
      {"mass", [](Problem* p) { p->bodies[0].mass = 0; }},
      {"mass", [](Problem* p) { p->bodies[0].mass = -1; }},
      {"mass", [=](Problem* p) { p->bodies[0].mass = kInfinity; }},
      {"mass", [=](Problem* p) { p->bodies[0].mass = kNaN; }},
      {"velocity", [=](Problem* p) { p->bodies[0].velocity[4] = kNaN; }},
      {"inertia", [=](Problem* p) { p->bodies[0].inertia(1, 1) = kInfinity; }},
      {"inverse_inertia", [=](Problem* p) { p->bodies[0].inverse_inertia(0, 2) = kNaN; }},
      {"body_a", [](Problem* p) { p->contacts[0].body_a = -2; }},
      {"body_a", [](Problem* p) { p->contacts[0].body_a = 1; }},
      {"body_b", [](Problem* p) { p->contacts[0].body_b = 1; }},
      {"body_b", [](Problem* p) { p->contacts[0].body_b = -1; }},  // nothing movable on either side
      {"friction", [](Problem* p) { p->contacts[0].friction = -0.1; }},
      {"friction", [=](Problem* p) { p->contacts[0].friction = kInfinity; }},
      {"target", [=](Problem* p) { p->contacts[0].target = kNaN; }},
      {"compliance", [](Problem* p) { p->contacts[0].compliance = -1e-9; }},
      {"compliance", [=](Problem* p) { p->contacts[0].compliance = kInfinity; }},
      {"drift", [=](Problem* p) { p->contacts[0].drift[2] = kInfinity; }},
      {"jacobian_b", [=](Problem* p) { p->contacts[0].jacobian_b(2, 5) = kNaN; }},
  };
  EXPECT_NO_THROW(BallOnFloor().Validate());
  for (const Case& spoiled : cases) {
    SCOPED_TRACE(spoiled.field);
    Problem problem = BallOnFloor();
    spoiled.spoil(&problem);
    try {
      problem.Validate();
      ADD_FAILURE() << "accepted";
    } catch (const std::invalid_argument& error) {
      EXPECT_NE(std::string(error.what()).find(spoiled.field), std::string::npos) << error.what();
    }
  }
}

}  // namespace
}  // namespace islet::testing
