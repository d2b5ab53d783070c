#include "qp/direct/column.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include <Eigen/Geometry>

#include "qp/cascade/island_solver.h"
#include "tests/support/no_alloc.h"
#include "tests/support/random_problems.h"
#include "tests/support/solve.h"

namespace islet::testing {
namespace {

using qp::Model;
using qp::Rung;

enum class Ends { kWallBelow, kWallAbove, kNone };

struct RandomColumn {
  Problem problem;
  Vector3 up;
};

// Bodies over each other that fall or rise, whose contacts are corners of regular polygons about the line, of `least` corners, in any
// order and seen from either side. Without walls all drift aside together. The whole is turned.
RandomColumn MakeColumn(Random* random, int bodies, double friction, bool bounces, Ends ends, int least = 1) {
  const Matrix3 turned = random->Rotation();
  const Vector3 up = turned.col(2), aside = (ends == Ends::kNone ? 0.3 : 0.0) * turned.col(0);
  ProblemBuilder builder;
  for (int i = 0; i < bodies; ++i) {
    const double mass = std::pow(10, random->Uniform(-1, 1));
    Vector6 v;
    v << random->Uniform(-1, 1) * up + aside, Vector3::Zero();
    builder.AddBody((i + 0.5) * up, mass, mass * random->PositiveDefinite(0.05, 0.3), v);
  }
  const int first = ends == Ends::kWallBelow ? 0 : 1, last = ends == Ends::kWallAbove ? bodies : bodies - 1;
  for (int i = first; i <= last; ++i) {
    const int below = i - 1, above = i < bodies ? i : -1, corners = std::max(least, random->Integer(-1, 6));
    const double phase = random->Uniform(0, 6), radius = corners == 1 ? 0 : random->Uniform(0.1, 0.5);
    const double belt = random->Uniform(-0.1, 0.1);
    for (int k = 0; k < corners; ++k) {
      const double angle = phase + 2 * M_PI * k / corners;
      const Vector3 at = turned * Vector3(radius * std::cos(angle), radius * std::sin(angle), i);
      const int c = random->Integer(0, 1) == 0 ? builder.AddContact(below, above, at, up, friction)
                                               : builder.AddContact(above, below, at, -up, friction);
      if (below < 0 || above < 0) builder.problem.contacts[c].drift[0] = belt;
    }
  }
  if (bounces) SetBounces(0.5, &builder.problem);
  std::shuffle(builder.problem.contacts.begin(), builder.problem.contacts.end(), random->engine());
  return {builder.problem, up};
}

// Moves the centre of a body against its contacts.
void Displace(int body, const Vector3& by, Problem* problem) {
  for (ContactTerm& contact : problem->contacts) {
    qp::Jacobian* const j = contact.body_a == body   ? &contact.jacobian_a
                            : contact.body_b == body ? &contact.jacobian_b
                                                     : nullptr;
    for (int r = 0; j && r < 3; ++r) j->row(r).tail<3>() -= by.cross(Vector3(j->row(r).head<3>())).transpose();
  }
}

// All falls equally fast on a wall that stands still, so that all contacts press.
RandomColumn MakeRestingColumn(Random* random, int bodies, double friction, int least = 1) {
  RandomColumn column = MakeColumn(random, bodies, friction, false, Ends::kWallBelow, least);
  for (qp::BodyTerm& body : column.problem.bodies) body.velocity.head<3>() = -0.3 * column.up;
  for (ContactTerm& contact : column.problem.contacts) contact.drift.setZero();
  return column;
}

// Three cubes of one side, of masses 1, 2 and 3, from the ground up.
Problem ThreeCubes(double v0, double v1, double v2) {
  ProblemBuilder builder;
  const double speeds[] = {v0, v1, v2};
  for (int i = 0; i < 3; ++i) builder.AddBox({0, 0, i + 0.5}, {0.5, 0.5, 0.5}, i + 1, {0, 0, speeds[i]});
  for (int i = 0; i < 3; ++i) builder.AddFace(i - 1, i, Vector3(0, 0, i), 0.5, 0.5, 0.5);
  return builder.problem;
}

// By hand: what rests carries the weight above it; what flies up leaves; what meets in the air goes on with the momentum of all.
TEST(Column, HandComputed) {
  struct {
    double free[3], velocities[3], impulses[3];
  } const cases[] = {{{-0.3, -0.3, -0.3}, {0, 0, 0}, {1.8, 1.5, 0.9}},
                     {{-0.3, 0.1, 0.2}, {0, 0.1, 0.2}, {0.3, 0, 0}},
                     {{1, 0, 0.2}, {4.0 / 15, 4.0 / 15, 4.0 / 15}, {0, 11.0 / 15, 0.2}},
                     {{-1, 2, -1}, {0, 0.2, 0.2}, {1, 0, 3.6}},
                     {{-1, 1, -1}, {0, 0, 0}, {2, 1, 3}}};
  for (const auto& [free, velocities, impulses] : cases) {
    const Problem problem = ThreeCubes(free[0], free[1], free[2]);
    const qp::Solution solution = Solve(problem, MakeSettings(problem, Model::kCoulomb));
    EXPECT_EQ(solution.rung, Rung::kColumn);
    EXPECT_EQ(solution.iterations, 0);
    for (int i = 0; i < 3; ++i) {
      EXPECT_NEAR(solution.velocities[6 * i + 2], velocities[i], 1e-15);
      for (int k = 0; k < 4; ++k) EXPECT_NEAR(solution.impulses[4 * i + k][0], impulses[i] / 4, 1e-15);
    }
  }
}

TEST(Column, AgreesWithTheInteriorPoint) {
  Random random(701);
  for (const Model model : {Model::kConvex, Model::kCoulomb, Model::kKinetic}) {
    for (const qp::Cone cone : {qp::Cone::kCircular, qp::Cone::kOctagon}) {
      for (int trial = 0; trial < 60; ++trial) {
        SCOPED_TRACE(::testing::Message() << static_cast<int>(model) << ' ' << trial);
        const bool bounces = trial % 2 == 1 && model != Model::kKinetic;
        const Problem problem =
            MakeColumn(&random, random.Integer(2, 12), trial % 5 == 0 ? 0 : 0.5, bounces, Ends(trial % 3)).problem;
        qp::Settings settings = MakeSettings(problem, model);
        settings.cone = cone;
        const qp::Solution ours = Solve(problem, settings);
        settings.ladder = qp::Ladder::Off();
        const qp::Solution full = Solve(problem, settings);
        if (problem.num_contacts() > 1) {
          EXPECT_EQ(ours.rung, Rung::kColumn);
        }
        EXPECT_EQ(ours.status, qp::Status::kSolved);
        EXPECT_LT(ours.gap, 1e-9);
        EXPECT_LT(VelocityDistance(problem, ours.velocities, full.velocities), 1e-6 * settings.velocity_scale);
        EXPECT_LT(MomentumResidual(problem, ours.velocities, ours.impulses), 1e-12 * settings.velocity_scale);
        EXPECT_LT(qp::CoulombMap(problem, ours.velocities, ours.impulses).max, 1e-11 * settings.velocity_scale);
      }
    }
  }
}

// Each of these makes it something else: the rungs above answer, as if there were no columns.
TEST(Column, JustOutsideItsKind) {
  Random random(702);
  const auto each = [&](const auto& breaks) {
    for (int trial = 0; trial < 20; ++trial) {
      SCOPED_TRACE(trial);
      auto [problem, up] = MakeRestingColumn(&random, 6, 0.5);
      qp::Settings settings = MakeSettings(problem, Model::kConvex);
      ASSERT_EQ(Solve(problem, settings).rung, Rung::kColumn);
      breaks(&problem, up);
      const qp::Solution ours = Solve(problem, settings);
      settings.ladder = settings.ladder.Without(Rung::kColumn);
      const qp::Solution others = Solve(problem, settings);
      EXPECT_NE(ours.rung, Rung::kColumn);
      EXPECT_EQ(ours.velocities, others.velocities);
    }
  };
  const auto sides = [](ContactTerm* contact, const auto& visit) {
    if (contact->body_a >= 0) visit(contact->body_a, &contact->jacobian_a);
    if (contact->body_b >= 0) visit(contact->body_b, &contact->jacobian_b);
  };
  each([&](Problem* problem, const Vector3& up) {  // a normal that is tilted
    sides(&problem->contacts[1], [&](int, qp::Jacobian* j) {
      j->row(0).head<3>() += (j->row(0).head<3>().dot(up) * 1e-6 * up.unitOrthogonal()).transpose();
    });
  });
  each([](Problem* problem, const Vector3& up) { Displace(3, 20 * up.unitOrthogonal(), problem); });  // one falls over
  each(
      [](Problem* problem, const Vector3& up) { problem->bodies[2].velocity.head<3>() += 1e-6 * up.unitOrthogonal(); });
  each([](Problem* problem, const Vector3&) {  // ground that slides
    for (ContactTerm& contact : problem->contacts)
      if (contact.body_a < 0 || contact.body_b < 0) contact.drift[1] = 1e-6;
  });
  const auto touch = [](Problem* problem, int below, int above, const Vector3& up) {
    ProblemBuilder builder;
    for (size_t i = 0; i < problem->bodies.size(); ++i)
      builder.positions.push_back((static_cast<double>(i) + 0.5) * up);
    builder.problem = *problem;
    builder.AddContact(below, above, (std::max(below, above) + 0.5) * up, up, 0.5);
    *problem = builder.problem;
  };
  each([&](Problem* problem, const Vector3& up) { touch(problem, 5, -1, up); });  // a ceiling
  each([&](Problem* problem, const Vector3& up) { touch(problem, 2, 4, up); });   // a body on two others
  each([&](Problem* problem, const Vector3& up) {                                 // two bodies on one
    problem->bodies.push_back(problem->bodies.back());
    touch(problem, 2, 6, up);
  });
  each([&](Problem* problem, const Vector3& up) {  // two columns
    problem->bodies.push_back(problem->bodies.back());
    touch(problem, -1, 6, up);
  });
}

// Faces of three corners and more hold what leans over them: the interior point finds nothing else.
TEST(Column, Leaning) {
  Random random(706);
  int columns = 0, leaning = 0;
  for (int trial = 0; trial < 100; ++trial) {
    SCOPED_TRACE(trial);
    auto [problem, up] = MakeRestingColumn(&random, 5, 0.5, 3);
    const double lean = std::pow(10, random.Uniform(-8, 0));
    const Vector3 aside = up.unitOrthogonal();
    for (int i = 0; i < 5; ++i)
      Displace(i, lean * (random.Uniform(-1, 1) * aside + random.Uniform(-1, 1) * up.cross(aside)), &problem);
    qp::Settings settings = MakeSettings(problem, trial % 2 == 0 ? Model::kConvex : Model::kCoulomb);
    const qp::Solution ours = Solve(problem, settings);
    columns += ours.rung == Rung::kColumn;
    if (ours.rung != Rung::kColumn) continue;
    leaning += lean > 1e-3;
    for (const Vector3& j : ours.impulses) EXPECT_GE(j[0], 0);
    EXPECT_LT(qp::CoulombMap(problem, ours.velocities, ours.impulses).max, 1e-11 * settings.velocity_scale);
    settings.ladder = qp::Ladder::Off();
    const qp::Solution full = Solve(problem, settings);
    EXPECT_LT(VelocityDistance(problem, ours.velocities, full.velocities), 1e-6 * settings.velocity_scale);
  }
  EXPECT_GT(columns, 70);
  EXPECT_LT(columns, 99);
  EXPECT_GT(leaning, 20);
}

// An edge holds what is over it: by hand, a quarter of the way from one end.
TEST(Column, OnAnEdge) {
  Problem problem = ThreeCubes(-0.3, -0.3, -0.3);
  problem.contacts.resize(10);
  Vector3 ends[2];  // of the third cube's edge, from its centre: the moment of a push along z is (y, -x)
  for (int k = 0; k < 2; ++k) {
    const auto turn = problem.contacts[8 + k].jacobian_b.row(0).tail<3>();
    ends[k] = {-turn[1], turn[0], 0};
  }
  Displace(2, 0.75 * ends[0] + 0.25 * ends[1], &problem);
  qp::Settings settings = MakeSettings(problem, Model::kCoulomb);
  const qp::Solution solution = Solve(problem, settings);
  EXPECT_EQ(solution.rung, Rung::kColumn);
  EXPECT_NEAR(solution.impulses[8][0], 0.9 * 0.75, 1e-15);
  EXPECT_NEAR(solution.impulses[9][0], 0.9 * 0.25, 1e-15);
  Displace(2, 1e-6 * Vector3::UnitZ().cross(ends[1] - ends[0]), &problem);
  EXPECT_NE(Solve(problem, settings).rung, Rung::kColumn);
}

// Near a corner the least change of equal shares would pull at the one across: the other three hold the cube, by hand. Beyond the
// edge between two of them nothing does.
TEST(Column, NearACorner) {
  ProblemBuilder builder;
  builder.AddBox({0, 0, 0.5}, {0.5, 0.5, 0.5}, 2, {0, 0, -0.3});
  builder.AddFace(-1, 0, Vector3(0, 0, 0), 0.5, 0.5, 0.5);
  Problem problem = builder.problem;
  const auto corner = [&](int c) {  // from the centre: the moment of a push along z is (y, -x)
    const auto turn = problem.contacts[c].jacobian_b.row(0).tail<3>();
    return Vector3(-turn[1], turn[0], 0);
  };
  const Vector3 near = corner(0);
  std::vector<double> shares;
  for (int c = 0; c < 4; ++c) {
    const double along = corner(c).dot(near) / near.squaredNorm();
    shares.push_back(along > 0.5 ? 0.8 : along < -0.5 ? 0.0 : 0.1);
  }
  Displace(0, 0.8 * near, &problem);
  qp::Settings settings = MakeSettings(problem, Model::kCoulomb);
  settings.ladder = qp::Ladder::Off().With(qp::Rung::kColumn);
  const qp::Solution solution = Solve(problem, settings);
  ASSERT_EQ(solution.rung, qp::Rung::kColumn);
  for (int c = 0; c < 4; ++c) EXPECT_NEAR(solution.impulses[c][0], 0.6 * shares[c], 1e-15);
  Displace(0, 0.3 * near, &problem);
  EXPECT_NE(Solve(problem, settings).rung, qp::Rung::kColumn);
}

// By itself, without those who judge it: what slides, turns or is no number is no column, to the tolerance that was given.
TEST(Column, KeepsItsTolerance) {
  const double g = 0.3;
  qp::Column column;
  std::vector<Vector3> impulses;
  const auto fits = [&](const Problem& problem, double tolerance) {
    return column.Solve(problem, tolerance, FreeVelocities(problem), &impulses);
  };
  EXPECT_TRUE(fits(ThreeCubes(-g, -g, -g), 0));
  Problem sliding = ThreeCubes(-g, -g, -g);
  sliding.bodies[1].velocity[0] = 1e-6;
  EXPECT_TRUE(fits(sliding, 2e-6));
  EXPECT_FALSE(fits(sliding, 0.5e-6));
  Problem turning = ThreeCubes(-g, -g, -g);
  turning.contacts.resize(10);  // the third cube on an edge, its centre next to it
  const Vector3 moment =
      turning.contacts[8].jacobian_b.row(0).tail<3>() + turning.contacts[9].jacobian_b.row(0).tail<3>();
  const Vector3 over(-0.5 * moment[1], 0.5 * moment[0], 0);
  Displace(2, over + 1e-6 * over.normalized(), &turning);
  const double speed = 1e-6 * g / std::sqrt(0.5);  // of its radius of gyration, sqrt(1 / 2)
  EXPECT_TRUE(fits(turning, 1.01 * speed));
  EXPECT_FALSE(fits(turning, 0.99 * speed));
  for (const double bad : {std::nan(""), HUGE_VAL, -HUGE_VAL}) {
    Problem broken = ThreeCubes(-g, -g, -g);
    broken.contacts[6].target = bad;
    EXPECT_FALSE(fits(broken, 1e-6)) << bad;
  }
}

// Without friction nothing brakes a slide, and where nothing presses nothing turns.
TEST(Column, WhatDoesNotMatterDoesNotCount) {
  Problem sliding = ThreeCubes(-0.3, -0.3, -0.3);
  sliding.bodies[1].velocity[0] = 2;
  EXPECT_NE(Solve(sliding, MakeSettings(sliding, Model::kConvex)).rung, Rung::kColumn);
  for (ContactTerm& contact : sliding.contacts) contact.friction = 0;
  const qp::Solution slides = Solve(sliding, MakeSettings(sliding, Model::kConvex));
  EXPECT_EQ(slides.rung, Rung::kColumn);
  EXPECT_EQ(slides.velocities[6], 2);

  Problem leaving = ThreeCubes(-0.3, -0.3, 0.1);
  leaving.contacts.resize(10);  // the third cube lies on two corners
  EXPECT_EQ(Solve(leaving, MakeSettings(leaving, Model::kConvex)).rung, Rung::kColumn);
  leaving.bodies[2].velocity[2] = -0.3;
  EXPECT_NE(Solve(leaving, MakeSettings(leaving, Model::kConvex)).rung, Rung::kColumn);
}

Vector6 RandomVector6(Random* random) { return (Vector6() << random->Vector(1), random->Vector(1)).finished(); }
Matrix3 RandomMatrix(Random* random) {
  return (Matrix3() << random->Vector(1), random->Vector(1), random->Vector(1)).finished();
}

// At the border: what is off by less than the tolerance leaves the answer within it, whoever gives it.
TEST(Column, NearlyColumnsMeetTheLaw) {
  Random random(703);
  int columns = 0;
  for (int trial = 0; trial < 200; ++trial) {
    SCOPED_TRACE(trial);
    Problem problem = MakeColumn(&random, 6, 0.5, false, Ends(trial % 3)).problem;
    const qp::Settings settings = MakeSettings(problem, Model::kConvex);
    const double off = std::pow(10, random.Uniform(-13, -8));
    for (qp::BodyTerm& body : problem.bodies) body.velocity += off * settings.velocity_scale * RandomVector6(&random);
    for (ContactTerm& contact : problem.contacts)
      for (qp::Jacobian* j : {&contact.jacobian_a, &contact.jacobian_b})
        if (!j->isZero(0)) j->rightCols<3>() += off * RandomMatrix(&random);
    const qp::Solution ours = Solve(problem, settings);
    columns += ours.rung == Rung::kColumn;
    EXPECT_EQ(ours.status, qp::Status::kSolved);
    EXPECT_LT(MomentumResidual(problem, ours.velocities, ours.impulses), 1e-11 * settings.velocity_scale);
    const double bound = ours.rung == Rung::kColumn ? 2e-9 : 1e-6;
    EXPECT_LT(qp::CoulombMap(problem, ours.velocities, ours.impulses).max, bound * settings.velocity_scale);
  }
  EXPECT_GT(columns, 50);
  EXPECT_LT(columns, 180);
}

// Centres far from the origin are on the line to less than one would like: 20,000 cubes are not.
TEST(Column, AsHighAsOneLikes) {
  Random random(704);
  const Problem problem = MakeColumn(&random, 3000, 0.5, false, Ends::kWallBelow).problem;
  const qp::Settings settings = MakeSettings(problem, Model::kCoulomb);
  const qp::Solution solution = Solve(problem, settings);
  EXPECT_EQ(solution.rung, Rung::kColumn);
  EXPECT_LT(qp::CoulombMap(problem, solution.velocities, solution.impulses).max, 1e-9 * settings.velocity_scale);
}

// Of the contacts of a pair some ask for less, and press not; heavy bodies lie on light ones; no compliance.
TEST(Column, UnlikeContactsAndBodies) {
  Random random(707);
  int columns = 0;
  for (int trial = 0; trial < 100; ++trial) {
    SCOPED_TRACE(trial);
    auto [problem, up] = MakeRestingColumn(&random, 6, 0.5, 4);
    for (qp::BodyTerm& body : problem.bodies) {
      const double factor = std::pow(10, random.Uniform(-2, 2));
      body.mass *= factor, body.inertia *= factor, body.inverse_inertia /= factor;
    }
    for (ContactTerm& contact : problem.contacts)
      if (random.Integer(0, 5) == 0) contact.target -= 0.1;
    qp::Settings settings = MakeSettings(problem, trial % 2 == 0 ? Model::kConvex : Model::kCoulomb);
    const qp::Solution ours = Solve(problem, settings);
    if (ours.rung != Rung::kColumn) continue;
    ++columns;
    EXPECT_LT(ours.gap, 1e-9);
    EXPECT_LT(qp::CoulombMap(problem, ours.velocities, ours.impulses).max, 2e-9 * settings.velocity_scale);
    for (int c = 0; c < problem.num_contacts(); ++c) {
      EXPECT_GE(ours.impulses[c][0], 0);
      if (problem.contacts[c].target < 0) {
        EXPECT_EQ(ours.impulses[c][0], 0);
      }
    }
    std::shuffle(problem.contacts.begin(), problem.contacts.end(), random.engine());
    const qp::Solution shuffled = Solve(problem, settings);
    EXPECT_EQ(shuffled.rung, Rung::kColumn);
    EXPECT_LT(VelocityDistance(problem, ours.velocities, shuffled.velocities), 1e-11 * settings.velocity_scale);
    problem.contacts[0].compliance = 1e-3;
    EXPECT_NE(Solve(problem, settings).rung, Rung::kColumn);
  }
  EXPECT_GT(columns, 20);
}

// A slide within the tolerance is a gap: who asks for less than that is answered by others.
TEST(Column, TheGapThatIsAskedForCounts) {
  Random random(708);
  for (const double tolerance : {1e-6, 1e-14}) {
    auto [problem, up] = MakeRestingColumn(&random, 6, 0.5, 3);
    qp::Settings settings = MakeSettings(problem, Model::kConvex);
    settings.tolerance = tolerance;
    const Vector3 aside = up.unitOrthogonal();
    for (int i = 0; i < 6; ++i)
      problem.bodies[i].velocity.head<3>() += (i % 2 == 0 ? 4e-11 : -4e-11) * settings.velocity_scale * aside;
    const qp::Solution solution = Solve(problem, settings);
    EXPECT_EQ(solution.rung == Rung::kColumn, tolerance > 1e-10);
    if (solution.rung == Rung::kColumn) {
      EXPECT_LE(solution.gap, tolerance);
    }
  }
}

// Bounces that bring more energy than there may be are for others to give up.
TEST(Column, TooMuchEnergyIsNoAnswer) {
  Problem problem = ThreeCubes(-0.3, -0.3, -0.3);
  for (int k = 8; k < 12; ++k) problem.contacts[k].target = 1;
  qp::Settings settings = MakeSettings(problem, Model::kCoulomb);
  EXPECT_EQ(Solve(problem, settings).rung, Rung::kColumn);
  const double energy = KineticEnergy(problem, Solve(problem, settings).velocities);
  settings.energy_limit = 1.01 * energy;
  EXPECT_EQ(Solve(problem, settings).rung, Rung::kColumn);
  settings.energy_limit = 0.99 * energy;
  EXPECT_NE(Solve(problem, settings).rung, Rung::kColumn);
}

TEST(Column, AllocatesNothingWhenRepeated) {
  Random random(705);
  const Problem problem = MakeColumn(&random, 15, 0.4, false, Ends::kWallBelow).problem;
  const qp::Settings settings = MakeSettings(problem, Model::kCoulomb);
  qp::IslandSolver solver;
  qp::Solution solution;
  solver.Solve(problem, settings, &solution);
  ASSERT_EQ(solution.rung, Rung::kColumn);
  const AllocationCounter counter;
  solver.Solve(problem, settings, &solution);
  EXPECT_EQ(counter.count(), 0);
}

}  // namespace
}  // namespace islet::testing
