#include "qp/compounds.h"

#include <algorithm>
#include <cmath>
#include <functional>

#include <gtest/gtest.h>
#include <Eigen/Dense>

#include "qp/body_algebra.h"
#include "qp/island_solver.h"
#include "tests/support/no_alloc.h"
#include "tests/support/random_problems.h"

namespace islet::testing {
namespace {

using qp::Rung;

constexpr double kFall = 0.3;  // [m/s] what gravity adds in a step

// Bodies of a kilogram or so at rest, pulled down for one step.
struct Pile {
  Problem problem;
  std::vector<Vector3> positions;
};

Pile Finish(ProblemBuilder builder) {
  for (qp::BodyTerm& body : builder.problem.bodies) body.velocity << 0, 0, -kFall, 0, 0, 0;
  return {builder.problem, builder.positions};
}

Pile Tower(Random* random, int boxes, double friction = 0.5, double floor_friction = 0.5) {
  ProblemBuilder builder;
  for (int i = 0; i < boxes; ++i) {
    const double x = random->Uniform(-0.05, 0.05), y = random->Uniform(-0.05, 0.05);
    builder.AddBox({x, y, 0.5 + i}, {0.5, 0.5, 0.5}, random->Uniform(0.5, 2));
    builder.AddFace(i - 1, i, {x, y, 1.0 * i}, 0.45, 0.45, i > 0 ? friction : floor_friction);
  }
  return Finish(builder);
}

// Bricks in bond: each rests on halves of two below, odd rows have one less.
Pile Wall(int wide, int high) {
  ProblemBuilder builder;
  int first = 0;  // of the row below
  for (int row = 0; row < high; ++row) {
    const int odd = row % 2, here = builder.problem.num_bodies();
    for (int k = 0; k < wide - odd; ++k) {
      const double x = 2.0 * k + odd;
      const int me = builder.AddBox({x, 0, 0.5 + row}, {1, 0.5, 0.5}, 1);
      if (row == 0) builder.AddFace(-1, me, {x, 0, 0}, 1, 0.5, 0.5);
      for (int side = 0; row > 0 && side < 2; ++side) {
        const int below = k + side + odd - 1;
        if (below < 0 || below >= wide - 1 + odd) continue;
        builder.AddFace(first + below, me, {x - 0.5 + side, 0, 1.0 * row}, 0.5, 0.5, 0.5);
      }
    }
    first = here;
  }
  return Finish(builder);
}

qp::Settings MakeSettings(const Problem& problem, bool ladder = true) {
  qp::Settings settings;
  settings.velocity_scale = VelocityScale(problem);
  settings.tolerance = 1e-12;
  settings.coulomb_rounds = 30;
  if (!ladder) settings.ladder = qp::Ladder::Off().With(Rung::kSweeps);
  return settings;
}

qp::Solution Full(const Problem& problem) {
  qp::IslandSolver solver;
  qp::Solution solution;
  solver.Solve(problem, MakeSettings(problem, false), &solution);
  return solution;
}

qp::Solution Climb(const Problem& problem, const std::vector<Vector3>& start) {
  qp::IslandSolver solver;
  qp::Solution solution;
  solver.Solve(problem, MakeSettings(problem), &solution, start);
  return solution;
}

// The wall below begins to move with this velocity.
void MoveFloor(const Vector3& velocity, Problem* problem) {
  for (ContactTerm& contact : problem->contacts)
    if (contact.body_a < 0) contact.drift -= contact.jacobian_b.leftCols<3>() * velocity;
}

// Coulomb's law read off the numbers, contact by contact: [m/s] what approaches, what pulls or presses though open, impulses
// outside their cones, friction that does not oppose the slip.
double WorstViolation(const Problem& problem, const qp::Solution& solution) {
  double worst = MomentumResidual(problem, solution.velocities, solution.impulses);
  for (int c = 0; c < problem.num_contacts(); ++c) {
    const ContactTerm& contact = problem.contacts[c];
    const Vector3 u = qp::ContactVelocity(contact, solution.velocities.data());
    const Vector3 j = qp::DelassusBlock(problem, contact).trace() / 3 * solution.impulses[c];  // as a velocity
    const double slip = u.tail<2>().norm(), open = u[0] - contact.target;
    worst = std::max({worst, -open, -j[0], j.tail<2>().norm() - contact.friction * j[0], std::min(open, j[0])});
    if (slip > 0)
      worst = std::max(worst, std::min(slip, (contact.friction * j[0] / slip * u.tail<2>() + j.tail<2>()).norm()));
  }
  return worst;
}

// Towers and walls in motion are hard for the full method: where it misses the law itself, ours must be the better answer.
// Returns whether the two could be compared.
bool ExpectSameAnswer(const Problem& problem, const qp::Solution& solution) {
  const double scale = VelocityScale(problem), bound = 3e-6 * scale;
  const qp::Solution full = Full(problem);
  if (solution.rung == Rung::kCompound) {
    EXPECT_LE(WorstViolation(problem, solution), bound);
  }
  if (WorstViolation(problem, full) > bound) return false;
  EXPECT_LE(VelocityDistance(problem, full.velocities, solution.velocities), 2e-5 * scale)
      << qp::kRungNames[static_cast<int>(solution.rung)];
  return true;
}

TEST(Compounds, TheReducedProblemIsThatOfRigidlyJoinedBodies) {
  Random random(1);
  for (const Pile& pile : {Tower(&random, 7), Wall(3, 4)}) {
    const std::vector<Vector3> start = Full(pile.problem).impulses;
    std::vector<double> after;
    qp::VelocitiesAfter(pile.problem, start, &after);
    qp::Compounds compounds;
    ASSERT_TRUE(compounds.Find(pile.problem, start, after, kFall));
    const Problem& reduced = compounds.reduced();
    ASSERT_EQ(reduced.num_bodies(), 1);
    Vector3 centre = Vector3::Zero();
    double mass = 0;
    for (int i = 0; i < pile.problem.num_bodies(); ++i) {
      mass += pile.problem.bodies[i].mass;
      centre += pile.problem.bodies[i].mass * pile.positions[i];
    }
    centre /= mass;
    const Vector3 linear = random.Vector(1), angular = random.Vector(1);
    std::vector<double> joined(linear.begin(), linear.end()), single;
    joined.insert(joined.end(), angular.begin(), angular.end());
    for (const Vector3& position : pile.positions) {
      const Vector3 v = linear + angular.cross(position - centre);
      single.insert(single.end(), v.begin(), v.end());
      single.insert(single.end(), angular.begin(), angular.end());
    }
    EXPECT_NEAR(KineticEnergy(reduced, joined), KineticEnergy(pile.problem, single), 1e-12 * mass);
    EXPECT_LT((reduced.bodies[0].velocity - (Vector6() << 0, 0, -kFall, 0, 0, 0).finished()).norm(), 1e-13);
    EXPECT_LT((reduced.bodies[0].inertia * reduced.bodies[0].inverse_inertia - Matrix3::Identity()).norm(), 1e-12);
    size_t outer = 0;
    for (const ContactTerm& contact : pile.problem.contacts) {
      if (contact.body_a >= 0) continue;
      const ContactTerm& moved = reduced.contacts[outer++];
      EXPECT_LT((qp::ContactVelocity(moved, joined.data()) - qp::ContactVelocity(contact, single.data())).norm(),
                1e-13);
    }
    EXPECT_EQ(outer, reduced.contacts.size());
  }
}

// Platforms that accelerate in any direction, gravity that turns, pushes on single bodies: what the impulses of before do not
// hold any more, but what still moves as one.
TEST(Compounds, AgreeWithTheFullMethodInMovingFrames) {
  Random random(2);
  int compounds = 0, compared = 0;
  for (int trial = 0; trial < 60; ++trial) {
    const Pile pile = trial % 3 == 0 ? Wall(random.Integer(2, 4), random.Integer(3, 5))
                                     : Tower(&random, random.Integer(2, trial % 2 == 0 ? 5 : 20));
    Problem problem = pile.problem;
    const std::vector<Vector3> start = Full(problem).impulses;
    const int boxes = problem.num_bodies();
    const double push = kFall / boxes;
    MoveFloor(0.3 * push * random.Vector(1) + Vector3(0, 0, random.Uniform(-0.2, 1)), &problem);
    problem.bodies[random.Integer(0, boxes - 1)].velocity.head<3>() += 0.2 * push * random.Vector(1);
    for (qp::BodyTerm& body : problem.bodies) body.velocity.head<3>() += 0.2 * push * Vector3(1, -1, 0);
    const qp::Solution solution = Climb(problem, start);
    compared += ExpectSameAnswer(problem, solution);
    compounds += solution.rung == Rung::kCompound;
  }
  EXPECT_GE(compounds, 50);
  EXPECT_GE(compared, 40);
}

// One step after the floor is gone no impulse is left of those that held.
TEST(Compounds, FallTogether) {
  Random random(3);
  for (const Pile& pile : {Tower(&random, 6), Wall(3, 3)}) {
    const std::vector<Vector3> impulses = Full(pile.problem).impulses;
    Problem problem;
    problem.bodies = pile.problem.bodies;
    std::vector<Vector3> start;
    for (int c = 0; c < pile.problem.num_contacts(); ++c) {
      if (pile.problem.contacts[c].body_a < 0) continue;
      problem.contacts.push_back(pile.problem.contacts[c]);
      start.push_back(impulses[c]);
    }
    const qp::Solution solution = Climb(problem, start);
    EXPECT_LT(VelocityDistance(problem, FreeVelocities(problem), solution.velocities), 1e-5 * kFall);
  }
}

// A wall of bricks comes down flat on the floor, ten times faster than a step of gravity.
TEST(Compounds, AWallComesDownAsOne) {
  const Pile pile = Wall(4, 4);
  Problem problem = pile.problem;
  for (qp::BodyTerm& body : problem.bodies) body.velocity[2] = -10 * kFall;
  const qp::Solution solution = Climb(problem, Full(pile.problem).impulses);
  EXPECT_EQ(solution.rung, Rung::kCompound);
  ExpectSameAnswer(problem, solution);
  EXPECT_LT(VelocityDistance(problem, std::vector<double>(6 * problem.bodies.size(), 0.0), solution.velocities), 1e-5);
}

// Pushed at the middle a tower that cannot slide turns about an edge of the floor, all boxes with it.
TEST(Compounds, TipTogether) {
  Random random(9);
  for (const int boxes : {4, 9}) {
    const Pile pile = Tower(&random, boxes, 2, 2);
    Problem problem = pile.problem;
    for (qp::BodyTerm& body : problem.bodies) body.velocity[0] += 2.0 / boxes * kFall;
    const qp::Solution solution = Climb(problem, Full(pile.problem).impulses);
    EXPECT_EQ(solution.rung, Rung::kCompound);
    EXPECT_TRUE(ExpectSameAnswer(problem, solution));
    EXPECT_GT(solution.velocities[4], 1e-3 * kFall);
    EXPECT_NEAR(solution.velocities[4], solution.velocities[6 * boxes - 2], 1e-6 * kFall);
  }
}

// A point in the middle of a face that rebounds parts two boxes, though the corners would keep them together.
TEST(Compounds, LetGoOfWhatRebounds) {
  Random random(10);
  const Pile pile = Tower(&random, 5);
  Problem problem = pile.problem;
  std::vector<Vector3> start = Full(problem).impulses;
  ContactTerm middle = problem.contacts[8];
  middle.jacobian_a = 0.5 * (problem.contacts[8].jacobian_a + problem.contacts[11].jacobian_a);
  middle.jacobian_b = 0.5 * (problem.contacts[8].jacobian_b + problem.contacts[11].jacobian_b);
  problem.contacts.push_back(middle);
  start.push_back(Vector3::Zero());
  MoveFloor({0.01 * kFall, 0, 0.1 * kFall}, &problem);
  EXPECT_EQ(Climb(problem, start).rung, Rung::kCompound);
  problem.contacts.back().target = 0.1 * kFall;
  const qp::Solution solution = Climb(problem, start);
  EXPECT_NE(solution.rung, Rung::kCompound);
  ExpectSameAnswer(problem, solution);
}

// The platform pulls harder from frame to frame: the faces between the boxes slide at mu = 0.3, the floor holds to 0.8.
TEST(Compounds, LetGoWhereALoadLeavesItsCone) {
  Random random(4);
  for (const int boxes : {2, 5}) {
    const Pile pile = Tower(&random, boxes, 0.3, 0.8);
    std::vector<Vector3> start = Full(pile.problem).impulses;
    for (int frame = 1; frame <= 10; ++frame) {
      Problem problem = pile.problem;
      // Boxes of half a metre tip at 1, towers sooner: a low pull for them, and the upper body alone beyond it.
      const double pull = (boxes == 2 ? 0.04 : 0.015) * frame;
      MoveFloor({pull * kFall, 0, 0}, &problem);
      problem.bodies.back().velocity[0] -= boxes == 2 ? 0 : 0.03 * frame * kFall;
      const bool holds = pull + (boxes == 2 ? 0 : 0.03 * frame) < 0.299;
      const qp::Solution solution = Climb(problem, start);
      ExpectSameAnswer(problem, solution);
      const double relative = std::abs(solution.velocities[6 * boxes - 6] - pull * kFall);
      EXPECT_EQ(relative < 1e-5 * kFall, holds) << boxes << " boxes, frame " << frame;
      if (holds) {
        EXPECT_EQ(solution.rung, Rung::kCompound) << frame;
      }
      start = solution.impulses;
    }
  }
}

// A sideways push at the top: first the tower bears it, then it begins to tip about the edge of some box.
TEST(Compounds, LetGoWhereAFaceOpens) {
  Random random(5);
  const Pile pile = Tower(&random, 6);
  std::vector<Vector3> start = Full(pile.problem).impulses;
  int held = 0, opened = 0;
  for (int frame = 1; frame <= 12; ++frame) {
    Problem problem = pile.problem;
    problem.bodies.back().velocity[0] += 0.06 * frame * kFall;
    const qp::Solution solution = Climb(problem, start);
    ExpectSameAnswer(problem, solution);
    const bool still = VelocityDistance(problem, std::vector<double>(6 * problem.bodies.size(), 0.0),
                                        solution.velocities) < 1e-5 * kFall;
    ++(still ? held : opened);
    start = solution.impulses;
  }
  EXPECT_GE(held, 2);
  EXPECT_GE(opened, 2);
}

// Pushed above a heavy part a tower opens at the face between: it comes apart there, and both parts stay compounds.
TEST(Compounds, ComeApartAtTheFaceThatOpens) {
  Random random(11);
  int apart = 0, tipped = 0;
  for (int trial = 0; trial < 40; ++trial) {
    const int boxes = random.Integer(6, 12), heavy = random.Integer(2, boxes - 3);
    Pile pile = Tower(&random, boxes, 2, 2);
    for (int i = 0; i < heavy; ++i) {
      qp::BodyTerm& body = pile.problem.bodies[i];
      body.mass *= 10;
      body.inertia *= 10;
      body.inverse_inertia /= 10;
    }
    Problem problem = pile.problem;
    const double push = random.Uniform(1, 2) / (boxes - heavy);
    for (int i = heavy; i < boxes; ++i) problem.bodies[i].velocity[0] += push * kFall;
    const qp::Solution solution = Climb(problem, Full(pile.problem).impulses);
    ExpectSameAnswer(problem, solution);
    const double turn = std::abs(solution.velocities[6 * heavy + 4] - solution.velocities[6 * heavy - 2]);
    tipped += turn > 1e-3 * kFall;
    apart += turn > 1e-3 * kFall && solution.rung == Rung::kCompound;
  }
  EXPECT_GE(tipped, 35);
  EXPECT_GE(apart, tipped - 1);
}

// The top is pushed harder than what is below it, and that harder than the rest: two faces give way.
TEST(Compounds, ComeApartTwice) {
  Random random(12);
  int thrice = 0;
  for (int trial = 0; trial < 20; ++trial) {
    const Pile pile = Tower(&random, 12, 0.5, 2);
    Problem problem = pile.problem;
    for (int i = 6; i < 12; ++i) problem.bodies[i].velocity[0] += (i < 9 ? 0.9 : 1.5) * kFall;
    const qp::Solution solution = Climb(problem, Full(pile.problem).impulses);
    ExpectSameAnswer(problem, solution);
    const auto parts = [&](int at) {
      return std::abs(solution.velocities[6 * at] - solution.velocities[6 * at - 6]) > 1e-3 * kFall;
    };
    thrice += solution.rung == Rung::kCompound && parts(6) && parts(9);
  }
  EXPECT_GE(thrice, 16);
}

// Impulses of a problem that differs, on islands of all kinds: what the rung answers meets the law.
TEST(Compounds, AnswerNothingThatBreaksTheLaw) {
  Random random(6);
  int compounds = 0, others = 0;
  for (int run = 0; run < 4; ++run) {
    const bool bounces = run % 2 == 1;
    const double change = run < 2 ? 1 : 0.1;
    for (const NamedProblem& island : RandomIslands(61 + bounces, 120, 10, bounces)) {
      SCOPED_TRACE(island.name);
      const Problem& now = island.problem;
      Problem before = now;
      for (qp::BodyTerm& body : before.bodies) body.velocity.head<3>() += random.Vector(0.02 * change);
      for (qp::BodyTerm& body : before.bodies) body.velocity *= random.Uniform(1 - 0.2 * change, 1);
      for (ContactTerm& contact : before.contacts) contact.target = 0;
      const qp::Solution solution = Climb(now, Full(before).impulses);
      if (run >= 2) ++(solution.rung == Rung::kCompound ? compounds : others);  // the large change leaves next to none
      if (solution.rung != Rung::kCompound) continue;
      EXPECT_LE(WorstViolation(now, solution), 3e-6 * VelocityScale(now));
    }
  }
  EXPECT_GT(compounds, 5);
  EXPECT_GT(others, 100);
}

TEST(Compounds, AreNotFoundWhereNothingHoldsBodiesTogether) {
  Random random(7);
  const Pile pile = Tower(&random, 4);
  const std::vector<Vector3> start = Full(pile.problem).impulses;
  const auto found = [&](const std::function<void(Problem*, std::vector<Vector3>*)>& change) {
    Problem problem = pile.problem;
    std::vector<Vector3> impulses = start;
    change(&problem, &impulses);
    std::vector<double> after;
    qp::VelocitiesAfter(problem, impulses, &after);
    qp::Compounds compounds;
    return compounds.Find(problem, impulses, after, kFall);
  };
  EXPECT_TRUE(found([](Problem*, std::vector<Vector3>*) {}));
  EXPECT_FALSE(found([](Problem*, std::vector<Vector3>* j) {  // on an edge: a hinge
    for (size_t c = 0; c < j->size(); c += 4) (*j)[c].setZero(), (*j)[c + 1].setZero();
  }));
  EXPECT_FALSE(found([](Problem*, std::vector<Vector3>* j) {  // on the border of the cone
    for (Vector3& impulse : *j) impulse[1] = 0.5 * impulse[0], impulse[2] = 0;
  }));
  EXPECT_FALSE(found([](Problem* p, std::vector<Vector3>*) {
    for (ContactTerm& contact : p->contacts) contact.friction = 0;
  }));
  EXPECT_FALSE(found([](Problem* p, std::vector<Vector3>*) {  // thrown apart
    for (int i = 0; i < 4; ++i) p->bodies[i].velocity[2] += i * 2 * kFall;
  }));
  EXPECT_FALSE(found([](Problem* p, std::vector<Vector3>*) {  // not the points of rigid bodies
    for (ContactTerm& contact : p->contacts) contact.jacobian_b.row(0) *= 2;
  }));
}

// A tower whose parts leave each other: as many compounds as parts. Two are few, and about a third of the bodies.
TEST(Compounds, AreNotFoundWhereTooManyRemain) {
  Random random(13);
  for (const auto& [boxes, few] : {std::pair{4, 2}, {5, 2}, {8, 3}, {10, 3}, {11, 4}, {12, 4}}) {
    const Pile pile = Tower(&random, boxes);
    const std::vector<Vector3> start = Full(pile.problem).impulses;
    for (int parts = 1; 2 * parts <= boxes; ++parts) {
      std::vector<double> after(6 * boxes, 0.0);
      for (int i = 0; i < boxes; ++i) after[6 * i + 2] = std::min(i, parts - 1) * kFall;
      qp::Compounds compounds;
      EXPECT_EQ(compounds.Find(pile.problem, start, after, kFall), parts <= few) << boxes << " in " << parts;
    }
  }
}

// What slides on each other is answered by sweeps of the two parts.
TEST(Compounds, SlideOnEachOther) {
  Random random(14);
  int compounds = 0, compared = 0;
  for (int trial = 0; trial < 20; ++trial) {
    Problem problem = Tower(&random, 8, 2, 2).problem;
    for (ContactTerm& contact : problem.contacts)
      if (contact.body_a == 3) contact.friction = 0.1;
    const std::vector<Vector3> start = Full(problem).impulses;
    const double push = random.Uniform(0.3, 0.6);
    for (int i = 4; i < 8; ++i) problem.bodies[i].velocity[0] += push * kFall;
    const qp::Solution solution = Climb(problem, start);
    compared += ExpectSameAnswer(problem, solution);
    EXPECT_GT(solution.velocities[6 * 4] - solution.velocities[6 * 3], 0.1 * kFall);
    compounds += solution.rung == Rung::kCompound;
  }
  EXPECT_GE(compounds, 18);
  EXPECT_GE(compared, 10);
}

TEST(Compounds, AreLeftOutOnRequestAndAllocateNothing) {
  Random random(8);
  const Pile pile = Tower(&random, 15);
  Problem problem = pile.problem;
  const std::vector<Vector3> start = Full(problem).impulses;
  MoveFloor({0.01, 0, 0.1}, &problem);
  qp::Settings settings = MakeSettings(problem);
  qp::IslandSolver solver;
  qp::Solution solution;
  solver.Solve(problem, settings, &solution, start);
  EXPECT_EQ(solution.rung, Rung::kCompound);
  const qp::Solution first = solution;
  const AllocationCounter counter;
  solver.Solve(problem, settings, &solution, start);
  EXPECT_EQ(counter.count(), 0);
  EXPECT_EQ(solution.velocities, first.velocities);
  settings.ladder = settings.ladder.Without(Rung::kCompound);
  solver.Solve(problem, settings, &solution, start);
  EXPECT_NE(solution.rung, Rung::kCompound);
}

}  // namespace
}  // namespace islet::testing
