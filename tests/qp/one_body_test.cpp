// One body held by several contacts: the closed answer meets the law wherever it is given, and is given wherever all sticks.
#include "qp/one_body.h"

#include <algorithm>
#include <cmath>

#include <gtest/gtest.h>
#include <Eigen/Geometry>

#include "qp/island_solver.h"
#include "tests/support/no_alloc.h"
#include "tests/support/random_problems.h"
#include "tests/support/reference_qp.h"

namespace islet::testing {
namespace {

using qp::Cone;
using qp::Model;
using qp::Rung;

qp::Settings MakeSettings(const Problem& problem, Model model = Model::kCoulomb, Cone cone = Cone::kCircular) {
  qp::Settings settings;
  settings.model = model;
  settings.cone = cone;
  settings.tolerance = 1e-12;
  settings.coulomb_rounds = 30;
  settings.velocity_scale = VelocityScale(problem);
  return settings;
}

// By the closed form alone. False, and nothing written, where it refuses.
bool Closed(const Problem& problem, const qp::Settings& settings, qp::Solution* solution) {
  if (!qp::OneBody::Fits(problem)) return false;
  solution->impulses.assign(problem.contacts.size(), Vector3::Zero());
  solution->slips.assign(problem.contacts.size(), 0.0);
  solution->velocities = FreeVelocities(problem);
  qp::OneBody one_body;
  if (one_body.Solve(problem, settings, solution)) return true;
  EXPECT_EQ(solution->velocities, FreeVelocities(problem));
  for (const Vector3& j : solution->impulses) EXPECT_TRUE(j.isZero(0));
  for (const double s : solution->slips) EXPECT_EQ(s, 0);
  return false;
}

bool Closed(const Problem& problem) {
  qp::Solution solution;
  return Closed(problem, MakeSettings(problem), &solution);
}

// Largest violation of the law by its cases, and of momentum, over v_ref; impulses are measured as velocities of the body.
double Violation(const Problem& problem, const qp::Settings& settings, const qp::Solution& solution) {
  double worst = MomentumResidual(problem, solution.velocities, solution.impulses);
  for (int c = 0; c < problem.num_contacts(); ++c) {
    const ContactTerm& contact = problem.contacts[c];
    Vector3 u = qp::ContactVelocity(contact, solution.velocities.data());
    u[0] -= contact.target;
    const Vector3 j = solution.impulses[c] / problem.bodies[0].mass;
    double support = j.tail<2>().norm();  // of the cone's base in the direction of the impulse
    if (settings.cone == Cone::kOctagon) {
      support = 0;
      for (int k = 0; k < 8; ++k) {
        const double angle = k * M_PI / 4;  // of a facet's normal
        support = std::max(support, (std::cos(angle) * j[1] + std::sin(angle) * j[2]) / std::cos(M_PI / 8));
      }
    }
    worst = std::max({worst, support - contact.friction * j[0], -u[0]});
    if (settings.model != Model::kCoulomb) worst = std::max(worst, contact.friction * u.tail<2>().norm() - u[0]);
    if (!j.isZero(0)) worst = std::max(worst, contact.friction > 0 ? u.norm() : u[0]);
  }
  return worst / settings.velocity_scale;
}

enum class Kind { kFace, kEdge, kTwoWalls };

// A body of random shape over 2 to 8 points of its hull that touch what does not move; it falls, and turns a little.
Problem RandomBody(Random* random, Kind kind, double friction, double drift = 0) {
  ProblemBuilder builder;
  const double height = random->Uniform(0.1, 0.5);
  const Matrix3 turn = random->Rotation();
  builder.AddBody(turn * Vector3(random->Uniform(-0.2, 0.2), random->Uniform(-0.2, 0.2), height),
                  random->Uniform(0.2, 5), random->PositiveDefinite(0.05, 0.5));
  const int contacts = random->Integer(2, kind == Kind::kEdge ? 4 : 8);
  const double start = random->Uniform(0, 6);
  for (int k = 0; k < contacts; ++k) {
    Vector3 point, normal = Vector3::UnitZ();
    if (kind == Kind::kEdge) {
      point = {-1 + 2.0 * k / (contacts - 1), 0, 0};
    } else {
      const double angle = start + 2 * M_PI * k / contacts;
      point = {std::cos(angle), std::sin(angle), 0};
      if (kind == Kind::kTwoWalls) {
        normal = k % 2 ? Vector3(0.6, 0, 0.8) : Vector3(-0.6, 0, 0.8);
        point = {k % 2 ? -0.5 : 0.5, random->Uniform(-1, 1), height};
      }
    }
    builder.AddContact(k % 3 ? -1 : 0, k % 3 ? 0 : -1, turn * point, turn * (k % 3 ? normal : Vector3(-normal)),
                       friction);
  }
  qp::BodyTerm& body = builder.problem.bodies[0];
  const Vector3 moves = turn * random->Vector(drift);
  for (ContactTerm& c : builder.problem.contacts)
    c.drift = -(c.body_a < 0 ? c.jacobian_b : c.jacobian_a).leftCols<3>() * moves;
  body.velocity << moves + turn * (Vector3(0, 0, -random->Uniform(0.5, 1)) + random->Vector(0.1)), random->Vector(0.1);
  return builder.problem;
}

class OneBodyFamilies : public ::testing::TestWithParam<Kind> {};
INSTANTIATE_TEST_SUITE_P(All, OneBodyFamilies, ::testing::Values(Kind::kFace, Kind::kEdge, Kind::kTwoWalls));

TEST_P(OneBodyFamilies, MeetTheLawOfEveryModel) {
  Random random(5);
  int served = 0;
  for (int trial = 0; trial < 600; ++trial) {
    const Problem problem = RandomBody(&random, GetParam(), random.Uniform(0.3, 1), trial % 2);
    for (const Model model : {Model::kCoulomb, Model::kConvex, Model::kKinetic}) {
      for (const Cone cone : {Cone::kCircular, Cone::kOctagon}) {
        const qp::Settings settings = MakeSettings(problem, model, cone);
        qp::Solution solution;
        if (!Closed(problem, settings, &solution)) continue;
        ++served;
        EXPECT_LT(Violation(problem, settings, solution), 2e-10) << trial;
        for (int c = 0; c < problem.num_contacts(); ++c) {
          const Vector3 u = qp::ContactVelocity(problem.contacts[c], solution.velocities.data());
          const double slip = problem.contacts[c].friction * u.tail<2>().norm();
          if (model == Model::kCoulomb && cone == Cone::kOctagon) continue;
          EXPECT_NEAR(solution.slips[c], model == Model::kCoulomb ? slip : 0, 1e-12);
        }
      }
    }
  }
  EXPECT_GT(served, 2350);
}

// The velocities of the convex problem are unique, and where all contacts stick in it the formula must find them.
TEST_P(OneBodyFamilies, HaveTheVelocitiesOfTheReference) {
  Random random(6);
  int served = 0, missed = 0;
  for (int trial = 0; trial < 150; ++trial) {
    const Problem problem = RandomBody(&random, GetParam(), random.Uniform(0.3, 1.2), trial % 2);
    const ReferenceSolution reference = SolveReference(problem, Model::kConvex, Cone::kCircular);
    double moves = 0;
    for (const ContactTerm& c : problem.contacts)
      moves = std::max(moves, qp::ContactVelocity(c, reference.velocities.data()).norm());
    qp::Solution solution;
    if (!Closed(problem, MakeSettings(problem, Model::kConvex), &solution)) {
      missed += moves < 1e-7 * VelocityScale(problem);
      continue;
    }
    ++served;
    EXPECT_LT(VelocityDistance(problem, reference.velocities, solution.velocities), 1e-7 * VelocityScale(problem))
        << trial;
  }
  EXPECT_GE(served, 95);
  EXPECT_LE(missed, 1);
}

TEST_P(OneBodyFamilies, AgreeWithTheInteriorPoint) {
  Random random(7);
  int served = 0;
  for (int trial = 0; trial < 100; ++trial) {
    const Problem problem = RandomBody(&random, GetParam(), random.Uniform(0.5, 1));
    qp::Settings settings = MakeSettings(problem);
    qp::IslandSolver solver;
    qp::Solution full, ours;
    settings.ladder = qp::Ladder::Off();
    solver.Solve(problem, settings, &full);
    settings.ladder = qp::Ladder::Off().With(Rung::kClosedForm);
    solver.Solve(problem, settings, &ours);
    EXPECT_EQ(ours.status, qp::Status::kSolved);
    if (ours.rung != Rung::kClosedForm) {  // the same as without, but for a look
      EXPECT_EQ(ours.in_vain.times(Rung::kClosedForm), 1);
      EXPECT_EQ(ours.velocities, full.velocities);
      continue;
    }
    ++served;
    EXPECT_EQ(ours.iterations, 0);
    // Exact friction has several answers between two walls.
    if (GetParam() == Kind::kTwoWalls) continue;
    EXPECT_LT(VelocityDistance(problem, full.velocities, ours.velocities), 1e-5 * VelocityScale(problem)) << trial;
  }
  EXPECT_GE(served, 60);
}

TEST_P(OneBodyFamilies, AreDeterministicWhateverWasBeforeAndNeverAllocate) {
  Random random(8);
  qp::OneBody one_body;
  for (int trial = 0; trial < 50; ++trial) {
    const Problem problem = RandomBody(&random, GetParam(), 0.8);
    const qp::Settings settings = MakeSettings(problem);
    qp::Solution fresh, used;
    const bool closed = Closed(problem, settings, &fresh);
    used.impulses.assign(problem.contacts.size(), Vector3::Zero());
    used.slips.assign(problem.contacts.size(), 0.0);
    used.velocities = FreeVelocities(problem);
    const AllocationCounter counter;
    EXPECT_EQ(one_body.Solve(problem, settings, &used), closed);
    EXPECT_EQ(counter.count(), 0);
    EXPECT_EQ(used.velocities, fresh.velocities);
    EXPECT_EQ(used.impulses, fresh.impulses);
  }
}

// A brick of a kilogram that lies on four corners and falls at 1 m/s; its centre at `centre`.
Problem Brick(const Vector3& centre, const Vector3& velocity, double friction) {
  ProblemBuilder builder;
  builder.AddBox(centre, {0.5, 0.5, centre.z()}, 1, velocity);
  builder.AddFace(-1, 0, {0, 0, 0}, 0.5, 0.5, friction);
  return builder.problem;
}

TEST(OneBody, LetsTheCornersOfABrickShareItsWeight) {
  qp::Solution solution;
  const Problem brick = Brick({0, 0, 0.5}, {0, 0, -1}, 0.5);
  ASSERT_TRUE(Closed(brick, MakeSettings(brick), &solution));
  for (const Vector3& j : solution.impulses) EXPECT_LT((j - Vector3(0.25, 0, 0)).norm(), 1e-13);
  for (const double v : solution.velocities) EXPECT_NEAR(v, 0, 1e-13);
}

// In the corner of the face the shortest impulses would pull at the far side.
TEST(OneBody, HoldsUntilTheCentreOfMassLeavesTheFace) {
  for (const double inside : {1e-1, 1e-2, 1e-4, 1e-6}) {
    for (const Vector3& out : {Vector3(1, 0, 0), Vector3(1, 1, 0), Vector3(0.3, -1, 0)}) {
      EXPECT_TRUE(Closed(Brick((0.5 - inside) * out + Vector3(0, 0, 0.5), {0, 0, -1}, 0.5))) << inside;
      EXPECT_FALSE(Closed(Brick((0.5 + inside) * out + Vector3(0, 0, 0.5), {0, 0, -1}, 0.5))) << inside;
    }
  }
}

TEST(OneBody, SticksUntilFrictionIsNotEnough) {
  for (const double room : {1e-1, 1e-2, 1e-3}) {
    EXPECT_TRUE(Closed(Brick({0, 0, 0.01}, {0.3, 0.4, -1}, 0.5 * (1 + room)))) << room;
    EXPECT_FALSE(Closed(Brick({0, 0, 0.01}, {0.3, 0.4, -1}, 0.5 * (1 - room)))) << room;
  }
  EXPECT_FALSE(Closed(Brick({0, 0, 0.01}, {0.3, 0.4, -1}, 0.5 * (1 - 1e-9))));
  EXPECT_FALSE(Closed(Brick({0, 0, 2}, {0.3, 0.4, -1}, 0.9)));  // it tips before it slides
}

// The octagon bears less than the circle between its edges.
TEST(OneBody, KnowsTheOctagon) {
  const Problem along = Brick({0, 0, 0.01}, {0.48, 0, -1}, 0.5);
  EXPECT_TRUE(Closed(along));
  qp::Solution solution;
  EXPECT_FALSE(Closed(along, MakeSettings(along, Model::kCoulomb, Cone::kOctagon), &solution));
}

TEST(OneBody, WithoutFrictionGivesWayAlongTheWalls) {
  Problem brick = Brick({0.1, 0.2, 0.5}, {3, 2, -1}, 0);
  qp::Solution solution;
  for (const Model model : {Model::kCoulomb, Model::kConvex, Model::kKinetic}) {
    ASSERT_TRUE(Closed(brick, MakeSettings(brick, model), &solution));
    EXPECT_LT(Violation(brick, MakeSettings(brick, model), solution), 1e-10);
    EXPECT_NEAR(solution.velocities[0], 3, 1e-13);
    EXPECT_NEAR(solution.velocities[1], 2, 1e-13);
    EXPECT_NEAR(solution.velocities[2], 0, 1e-10);
  }
  brick.contacts[2].friction = 0.1;  // holds the whole brick, or slides
  EXPECT_FALSE(Closed(brick));
}

TEST(OneBody, BouncesStraightOff) {
  Problem brick = Brick({0, 0, 0.5}, {0.05, 0.02, -1}, 0.5);
  for (ContactTerm& c : brick.contacts) c.target = 0.4;
  qp::Solution solution;
  for (const Model model : {Model::kCoulomb, Model::kConvex}) {
    ASSERT_TRUE(Closed(brick, MakeSettings(brick, model), &solution));
    EXPECT_LT(Violation(brick, MakeSettings(brick, model), solution), 1e-10);
    EXPECT_NEAR(solution.velocities[2], 0.4, 1e-10);
    EXPECT_NEAR(solution.velocities[0], 0, 1e-10);
  }
  EXPECT_FALSE(Closed(brick, MakeSettings(brick, Model::kKinetic), &solution));
  brick.contacts[3].target = 0.5;  // four corners of a plane in which only three can have their way
  EXPECT_FALSE(Closed(brick));
}

// Two corners are a gap away that is not used up in the step: on the other two the brick begins to turn.
TEST(OneBody, TurnsAboutAnEdge) {
  Problem brick = Brick({0, 0, 0.5}, {0, 0, -1}, 0.9);
  for (int corner : {1, 3}) brick.contacts[corner].target = -2;  // those at x > 0
  for (const Model model : {Model::kCoulomb, Model::kConvex}) {
    const qp::Settings settings = MakeSettings(brick, model);
    qp::Solution solution;
    ASSERT_TRUE(Closed(brick, settings, &solution));
    EXPECT_LT(Violation(brick, settings, solution), 1e-10);
    EXPECT_NEAR(solution.velocities[4], 0.75, 1e-10);  // m v b / (I + m r^2) with b = 1/2, r^2 = 1/2, I = 1/6
    EXPECT_EQ(solution.impulses[1], Vector3(0, 0, 0));
  }
  for (int corner : {1, 3}) brick.contacts[corner].target = -0.5;  // and now it is: they are met, too
  qp::Solution solution;
  ASSERT_TRUE(Closed(brick, MakeSettings(brick), &solution));
  EXPECT_GT(solution.impulses[1][0], 0);
  EXPECT_NEAR(solution.velocities[4], 0.5, 1e-10);
}

// Two corners lift off at first, and only meet the floor because the others are held.
TEST(OneBody, FindsWhatWillPress) {
  Problem brick = Brick({0, 0, 0.5}, {0, 0, -1}, 0.9);
  brick.bodies[0].velocity[4] = -2.2;  // held at x < 0 it would turn at +0.2, and the corners at x > 0 go down
  for (const Model model : {Model::kCoulomb, Model::kConvex}) {
    const qp::Settings settings = MakeSettings(brick, model);
    qp::Solution solution;
    ASSERT_TRUE(Closed(brick, settings, &solution));
    EXPECT_LT(Violation(brick, settings, solution), 1e-10);
    EXPECT_GT(solution.impulses[1][0], 0);
  }
}

// Exact friction lets a brick slide off a wall that it leaves; the convex models let it rub.
TEST(OneBody, LeavesWhatSeparatesToItself) {
  const Problem brick = Brick({0, 0, 0.5}, {3, 0, 1}, 0.5);
  qp::Solution solution;
  ASSERT_TRUE(Closed(brick, MakeSettings(brick), &solution));
  EXPECT_EQ(solution.velocities, FreeVelocities(brick));
  EXPECT_FALSE(Closed(brick, MakeSettings(brick, Model::kConvex), &solution));
  const Problem faster = Brick({0, 0, 0.5}, {1, 0, 1}, 0.5);
  ASSERT_TRUE(Closed(faster, MakeSettings(faster, Model::kConvex), &solution));
  EXPECT_EQ(solution.slips, std::vector<double>(4, 0.0));
}

TEST(OneBody, RefusesWhatIsNotOfItsKind) {
  Problem brick = Brick({0, 0, 0.5}, {0, 0, -1}, 0.5);
  Problem more = brick;
  more.contacts.resize(qp::OneBody::kMostContacts, brick.contacts[0]);
  EXPECT_TRUE(Closed(more));
  more.contacts.push_back(brick.contacts[0]);
  EXPECT_FALSE(qp::OneBody::Fits(more));
  more = brick;
  more.contacts.resize(1);
  EXPECT_FALSE(qp::OneBody::Fits(more));
  more = brick;
  more.bodies.push_back(brick.bodies[0]);
  EXPECT_FALSE(qp::OneBody::Fits(more));
  brick.contacts[1].compliance = 1e-3;
  EXPECT_FALSE(Closed(brick));
}

}  // namespace
}  // namespace islet::testing
