#include "qp/planar_problem.h"

#include <algorithm>
#include <cmath>

#include <gtest/gtest.h>
#include <Eigen/Geometry>

#include "qp/island_solver.h"
#include "tests/support/no_alloc.h"
#include "tests/support/random_problems.h"
#include "tests/support/solve.h"

namespace islet::testing {
namespace {

using qp::Model;
using qp::Rung;

// Without columns, which would answer before.
qp::Settings PlanarSettings(const Problem& problem, Model model) {
  qp::Settings settings = MakeSettings(problem, model);
  settings.ladder = settings.ladder.Without(Rung::kColumn);
  return settings;
}

qp::Settings WithoutPlanar(qp::Settings settings) {
  settings.ladder = qp::Ladder::Off().With(Rung::kClosedForm).With(Rung::kHeld).With(Rung::kNormal).With(Rung::kSweeps).With(
      Rung::kNewton);
  return settings;
}

// Turns a problem in the world, frames of the contacts and all.
void Rotate(const Matrix3& r, Problem* problem) {
  for (qp::BodyTerm& body : problem->bodies) {
    body.inertia = (r * body.inertia * r.transpose()).eval();
    body.inverse_inertia = (r * body.inverse_inertia * r.transpose()).eval();
    body.velocity << (r * body.velocity.head<3>()).eval(), (r * body.velocity.tail<3>()).eval();
  }
  for (ContactTerm& contact : problem->contacts) {
    for (qp::Jacobian* j : {&contact.jacobian_a, &contact.jacobian_b}) {
      j->leftCols<3>() = (j->leftCols<3>() * r.transpose()).eval();
      j->rightCols<3>() = (j->rightCols<3>() * r.transpose()).eval();
    }
  }
}

// Tangents turned about the normal by some angle.
void TurnTangents(double angle, ContactTerm* contact) {
  Matrix3 turn = Matrix3::Identity();
  turn(1, 1) = turn(2, 2) = std::cos(angle);
  turn(1, 2) = std::sin(angle);
  turn(2, 1) = -turn(1, 2);
  contact->jacobian_a = (turn * contact->jacobian_a).eval();
  contact->jacobian_b = (turn * contact->jacobian_b).eval();
  contact->drift = (turn * contact->drift).eval();
}

// Bodies thrown together in the plane y = 0, on ground that may move; contacts in the plane or in pairs behind each other. Then
// the whole is turned, and so is each contact's frame.
Problem RandomPlanarIsland(Random* random, int bodies, double friction, bool bounces) {
  ProblemBuilder builder;
  const double size = 0.7 * std::sqrt(bodies);
  const auto touch = [&](int a, int b, const Vector3& near, const Vector3& normal) {
    const double mu = friction * random->Uniform(0.5, 1.5), belt = random->Integer(0, 3) == 0 ? 0.2 : 0.0;
    for (int k = random->Integer(1, 2); k > 0; --k) {
      const double behind = random->Integer(0, 1) * random->Uniform(0.1, 0.5);
      const Vector3 at = near + Vector3(random->Uniform(-0.2, 0.2), 0, random->Uniform(-0.2, 0.2));
      for (const double side : {-1.0, 1.0}) {
        if (behind == 0 && side > 0) continue;
        const int c = builder.AddContact(a, b, at + side * behind * Vector3::UnitY(), normal, mu);
        ContactTerm& contact = builder.problem.contacts[c];
        if (a < 0) contact.drift = belt * contact.jacobian_b.leftCols<3>() * Vector3::UnitX();
        TurnTangents(random->Uniform(0, 6), &contact);
      }
    }
  };
  for (int i = 0; i < bodies; ++i) {
    const Vector3 position(random->Uniform(-size, size), 0, 0.3 + random->Uniform(0, size));
    const double mass = random->Uniform(0.5, 5);
    Matrix3 inertia = random->PositiveDefinite(0.05, 0.3);
    inertia(0, 1) = inertia(1, 0) = inertia(1, 2) = inertia(2, 1) = 0;
    Vector6 v;
    v << random->Uniform(-1, 1), 0, random->Uniform(-1.2, 0.8), 0, random->Uniform(-1, 1), 0;
    builder.AddBody(position, mass, mass * inertia, v);
    if (position[2] < 0.9 || i == 0) touch(-1, i, {position[0], 0, 0}, Vector3::UnitZ());
    for (int k = 0; k < i; ++k) {
      const Vector3 between = position - builder.positions[k];
      if (between.norm() > 1) continue;
      touch(k, i, builder.positions[k] + 0.5 * between, between.normalized());
    }
  }
  if (bounces) SetBounces(0.5, &builder.problem);
  Rotate(random->Rotation(), &builder.problem);
  return builder.problem;
}

// A tower of boxes of different masses, pushed along one of its sides: all normals are parallel.
Problem PushedTower(Random* random, int boxes, double push) {
  ProblemBuilder builder;
  for (int i = 0; i < boxes; ++i)
    builder.AddBox({0, 0, i + 0.5}, {0.5, 0.5, 0.5}, random->Uniform(1, 2), {push * random->Uniform(0, 1), 0, -0.3});
  for (int i = 0; i < boxes; ++i) builder.AddFace(i - 1, i, Vector3(0, 0, i), 0.5, 0.4, 0.5);
  Rotate(random->Rotation(), &builder.problem);
  return builder.problem;
}

TEST(PlanarProblem, AgreesWithTheWholeProblem) {
  Random random(301);
  int planar = 0, solved = 0;
  for (const double friction : {0.0, 0.4}) {
    for (int trial = 0; trial < 80; ++trial) {
      SCOPED_TRACE(std::to_string(friction) + " " + std::to_string(trial));
      const Problem problem = RandomPlanarIsland(&random, random.Integer(2, 20), friction, trial % 2 == 1);
      qp::Settings settings = PlanarSettings(problem, Model::kConvex);
      settings.tolerance = 1e-13;
      const qp::Solution flat = Solve(problem, settings), whole = Solve(problem, WithoutPlanar(settings));
      if (problem.num_contacts() > 1) planar += flat.rung == Rung::kPlanar;
      if (whole.status != qp::Status::kSolved) continue;
      ++solved;
      EXPECT_EQ(flat.status, qp::Status::kSolved);
      EXPECT_LT(VelocityDistance(problem, flat.velocities, whole.velocities), 1e-6 * settings.velocity_scale);
      EXPECT_LT(MomentumResidual(problem, flat.velocities, flat.impulses), 1e-11 * settings.velocity_scale);
    }
  }
  EXPECT_GT(planar, 130);
  EXPECT_GT(solved, 120);
}

// Exact Coulomb: the map of the whole problem is as small as without the rung; the answer is the same wherever both are
// exact, but for the few islands that have several.
TEST(PlanarProblem, MeetsTheExactLawOfTheWholeProblem) {
  Random random(302);
  int planar = 0, reached = 0, whole_reached = 0, both = 0, same = 0;
  for (int trial = 0; trial < 120; ++trial) {
    SCOPED_TRACE(trial);
    const Problem problem = RandomPlanarIsland(&random, random.Integer(2, 24), 0.4, trial % 3 == 2);
    const qp::Settings settings = PlanarSettings(problem, Model::kCoulomb);
    const qp::Solution flat = Solve(problem, settings), whole = Solve(problem, WithoutPlanar(settings));
    if (flat.rung != Rung::kPlanar) continue;
    ++planar;
    EXPECT_EQ(flat.status, qp::Status::kSolved);
    const double goal = settings.coulomb_tolerance * settings.velocity_scale;
    const double map = qp::CoulombMap(problem, flat.velocities, flat.impulses).rms;
    EXPECT_EQ(flat.coulomb_reached, map <= goal) << map;
    reached += flat.coulomb_reached;
    whole_reached += whole.coulomb_reached;
    if (!flat.coulomb_reached || !whole.coulomb_reached) continue;
    ++both;
    same += VelocityDistance(problem, flat.velocities, whole.velocities) < 1e-4 * settings.velocity_scale;
  }
  EXPECT_GT(planar, 100);
  EXPECT_GE(reached, whole_reached - 2) << planar;
  EXPECT_GE(same, both * 9 / 10) << both;
}

// What slides in the plane is found to what the plane is held to.
TEST(PlanarProblem, PushedTowersAreSolved) {
  Random random(305);
  int reached = 0;
  for (int trial = 0; trial < 200; ++trial) {
    const Problem problem = PushedTower(&random, 4 + trial % 7, 0.8);
    qp::Settings settings = PlanarSettings(problem, Model::kCoulomb);
    settings.coulomb_tolerance = 1e-7;
    const qp::Solution solution = Solve(problem, settings);
    reached += solution.rung == Rung::kPlanar && solution.coulomb_reached;
  }
  EXPECT_EQ(reached, 200);
}

// Nothing is left to choose where a box slides: the impulses are those of a sum in one's head.
TEST(PlanarProblem, SharesAnImpulseAmongTheContactsOfAGroup) {
  ProblemBuilder builder;
  builder.AddBox({0, 0, 0.05}, {0.05, 0.05, 0.05}, 1, {6, 0, -0.3});
  builder.AddFace(-1, 0, Vector3::Zero(), 0.05, 0.05, 0.2);
  const qp::Solution solution = Solve(builder.problem, PlanarSettings(builder.problem, Model::kCoulomb));
  EXPECT_EQ(solution.rung, Rung::kPlanar);
  Vector3 sum = Vector3::Zero();
  for (int c = 0; c < 4; ++c) {
    const Vector3& j = solution.impulses[c];
    sum += builder.problem.contacts[c].jacobian_b.leftCols<3>().transpose() * j;
    EXPECT_NEAR(j[0], solution.impulses[c ^ 2][0], 1e-15);  // across the plane
    EXPECT_NEAR(j.tail<2>().norm(), 0.2 * j[0], 1e-9);
  }
  EXPECT_NEAR(sum[0], -0.06, 1e-9);
  EXPECT_EQ(sum[1], 0);
  EXPECT_NEAR(sum[2], 0.3, 1e-9);
  EXPECT_EQ(solution.velocities[1], 0);
}

TEST(PlanarProblem, TowersAreSeenFromTheirFaces) {
  Random random(303);
  for (const double push : {0.0, 0.5}) {
    const Problem problem = PushedTower(&random, 8, push);
    const qp::Settings settings = PlanarSettings(problem, Model::kCoulomb);
    const qp::Solution flat = Solve(problem, settings), whole = Solve(problem, WithoutPlanar(settings));
    EXPECT_EQ(flat.rung, Rung::kPlanar);
    EXPECT_LT(VelocityDistance(problem, flat.velocities, whole.velocities), 1e-6 * settings.velocity_scale);
    qp::PlanarProblem plane;
    ASSERT_TRUE(plane.Reduce(problem, settings.velocity_scale));
    EXPECT_EQ(plane.problem().num_contacts(), 16);
  }
}

// Balls on one axis have no face: any plane through it will do.
TEST(PlanarProblem, BallsOnAnAxis) {
  ProblemBuilder builder;
  for (int i = 0; i < 5; ++i)
    builder.AddBody({0, 0, i + 0.5}, 1, 0.1 * Matrix3::Identity(), (Vector6() << 0, 0, -i, 0, 0, 0).finished());
  for (int i = 0; i < 5; ++i) builder.AddContact(i - 1, i, {0, 0, 1.0 * i}, Vector3::UnitZ(), 0.5);
  EXPECT_EQ(Solve(builder.problem, PlanarSettings(builder.problem, Model::kConvex)).rung, Rung::kPlanar);
  builder.problem.bodies[2].velocity.tail<3>() << 0, 1, 0;
  builder.problem.bodies[4].velocity.tail<3>() << 0, -2, 0;
  EXPECT_EQ(Solve(builder.problem, PlanarSettings(builder.problem, Model::kConvex)).rung, Rung::kPlanar);
  builder.problem.bodies[4].velocity.tail<3>() << 1, 1, 0;
  EXPECT_NE(Solve(builder.problem, PlanarSettings(builder.problem, Model::kConvex)).rung, Rung::kPlanar);
}

// Each of these breaks the symmetry a little: the whole problem is solved, and that is the answer.
TEST(PlanarProblem, JustOutsideItsKind) {
  Random random(304);
  const auto each = [&](const auto& breaks) {
    for (int trial = 0; trial < 20; ++trial) {
      Problem problem = trial % 2 == 0 ? PushedTower(&random, 6, 0.5) : RandomPlanarIsland(&random, 12, 0.4, false);
      const qp::Settings settings = PlanarSettings(problem, Model::kConvex);
      ASSERT_EQ(Solve(problem, settings).rung, Rung::kPlanar);
      breaks(&problem, settings.velocity_scale);
      const qp::Solution flat = Solve(problem, settings), whole = Solve(problem, WithoutPlanar(settings));
      EXPECT_NE(flat.rung, Rung::kPlanar);
      EXPECT_EQ(flat.velocities, whole.velocities);
    }
  };
  // A contact that has a mirror image.
  const auto paired = [](const Problem& problem) {
    qp::PlanarProblem plane;
    EXPECT_TRUE(plane.Reduce(problem, 1));
    int c = 0;
    while (problem.contacts[c].jacobian_b.row(0).tail<3>().cross(plane.normal()).norm() < 1e-3) ++c;
    return c;
  };
  each([&](Problem* problem, double v_ref) {
    qp::PlanarProblem plane;
    ASSERT_TRUE(plane.Reduce(*problem, v_ref));
    problem->bodies[2].velocity.head<3>() += 1e-6 * v_ref * plane.normal();
  });
  each([&](Problem* problem, double v_ref) {
    qp::PlanarProblem plane;
    ASSERT_TRUE(plane.Reduce(*problem, v_ref));
    problem->bodies[2].velocity.tail<3>() += 1e-6 * v_ref * plane.normal().unitOrthogonal();
  });
  each([&](Problem* problem, double) {  // a contact moved by 1e-6 within its face
    ContactTerm& contact = problem->contacts[paired(*problem)];
    for (qp::Jacobian* j : {&contact.jacobian_a, &contact.jacobian_b}) {
      const Matrix3 frame = j->leftCols<3>();
      const Vector3 shift = 1e-6 * (frame.row(1) + 0.7 * frame.row(2)).transpose();
      for (int r = 0; r < 3; ++r) j->row(r).tail<3>() += shift.cross(Vector3(frame.row(r))).transpose();
    }
  });
  each([&](Problem* problem, double) { problem->contacts[paired(*problem)].friction += 1e-6; });
  each([&](Problem* problem, double v_ref) { problem->contacts[paired(*problem)].target += 1e-6 * v_ref; });
  each([&](Problem* problem, double v_ref) {
    problem->contacts[paired(*problem)].drift += 1e-6 * v_ref * Vector3(0, 1, 0.7);
  });
  each([&](Problem* problem, double v_ref) {  // ground that moves across the plane
    qp::PlanarProblem plane;
    ASSERT_TRUE(plane.Reduce(*problem, v_ref));
    for (ContactTerm& contact : problem->contacts)
      if (contact.body_a < 0) contact.drift += 1e-6 * v_ref * contact.jacobian_b.leftCols<3>() * plane.normal();
  });
  each([&](Problem* problem, double v_ref) {
    qp::PlanarProblem plane;
    ASSERT_TRUE(plane.Reduce(*problem, v_ref));
    qp::BodyTerm& body = problem->bodies[1];
    const Vector3 e = plane.normal(), across = e.unitOrthogonal();
    body.inertia += 1e-6 * body.inertia.trace() * (e * across.transpose() + across * e.transpose());
  });
}

// At the border: what is out of the plane by less than the tolerance leaves the answer as good as without the rung.
TEST(PlanarProblem, NearlyPlanarIslandsMeetTheLaw) {
  Random random(305);
  int planar = 0;
  for (int trial = 0; trial < 40; ++trial) {
    SCOPED_TRACE(trial);
    Problem problem = trial % 2 == 0 ? PushedTower(&random, 6, 0.5) : RandomPlanarIsland(&random, 12, 0.4, false);
    const qp::Settings settings = PlanarSettings(problem, Model::kConvex);
    const double off = std::pow(10, random.Uniform(-12, -8));
    for (qp::BodyTerm& body : problem.bodies)
      body.velocity.head<3>() += off * settings.velocity_scale * random.Vector(1);
    for (ContactTerm& contact : problem.contacts)
      contact.jacobian_b.block<3, 3>(0, 3) += off * random.PositiveDefinite(-1, 1);
    const qp::Solution flat = Solve(problem, settings);
    planar += flat.rung == Rung::kPlanar;
    EXPECT_LT(MomentumResidual(problem, flat.velocities, flat.impulses), 1e-11 * settings.velocity_scale);
    for (int c = 0; c < problem.num_contacts(); ++c) {
      const ContactTerm& contact = problem.contacts[c];
      const Vector3 u = qp::ContactVelocity(contact, flat.velocities.data());
      EXPECT_GE(u[0] - contact.friction * u.tail<2>().norm(), -2e-8 * settings.velocity_scale) << c << " " << off;
    }
  }
  EXPECT_GT(planar, 10);
  EXPECT_LT(planar, 40);
}

// The same by the exact law: whoever answers, in the plane or in space, says what is reached, and reaches it as often as in the plane
// alone.
TEST(PlanarProblem, NearlyPlanarIslandsMeetTheExactLaw) {
  Random random(309);
  int planar = 0, reached = 0, in_plane = 0;
  for (int trial = 0; trial < 60; ++trial) {
    SCOPED_TRACE(trial);
    Problem problem = trial % 2 == 0 ? PushedTower(&random, 4, 0.5) : RandomPlanarIsland(&random, 8, 0.4, false);
    const qp::Settings settings = PlanarSettings(problem, Model::kCoulomb);
    in_plane += Solve(problem, settings).coulomb_reached;
    const double off = std::pow(10, random.Uniform(-12, -8));
    for (qp::BodyTerm& body : problem.bodies)
      body.velocity.head<3>() += off * settings.velocity_scale * random.Vector(1);
    const qp::Solution flat = Solve(problem, settings);
    planar += flat.rung == Rung::kPlanar;
    reached += flat.coulomb_reached;
    EXPECT_LT(MomentumResidual(problem, flat.velocities, flat.impulses), 1e-11 * settings.velocity_scale);
    const double map = qp::CoulombMap(problem, flat.velocities, flat.impulses).rms;
    EXPECT_EQ(flat.coulomb_reached, map <= settings.coulomb_tolerance * settings.velocity_scale) << map;
  }
  EXPECT_GT(planar, 10);
  EXPECT_LT(planar, 50);
  EXPECT_GT(in_plane, 50);
  EXPECT_GE(reached, in_plane - 3);
}

TEST(PlanarProblem, OrderOfContactsDoesNotMatter) {
  Random random(306);
  for (int trial = 0; trial < 40; ++trial) {
    SCOPED_TRACE(trial);
    Problem problem = trial % 2 == 0 ? PushedTower(&random, 6, 0.2) : RandomPlanarIsland(&random, 10, 0.4, false);
    qp::Settings settings = PlanarSettings(problem, trial % 4 < 2 ? Model::kConvex : Model::kCoulomb);
    const qp::Solution first = Solve(problem, settings);
    std::shuffle(problem.contacts.begin(), problem.contacts.end(), random.engine());
    const qp::Solution second = Solve(problem, settings);
    EXPECT_EQ(first.rung, Rung::kPlanar);
    EXPECT_EQ(second.rung, Rung::kPlanar);
    EXPECT_LT(VelocityDistance(problem, first.velocities, second.velocities), 1e-4 * settings.velocity_scale);
  }
}

// Crowds in space, each of them looked at: none is taken for planar, and all answers are those of the ladder without the rung.
TEST(PlanarProblem, RefusesCrowds) {
  for (const NamedProblem& island : RandomIslands(307, 60, 10, false)) {
    SCOPED_TRACE(island.name);
    const qp::Settings settings = PlanarSettings(island.problem, Model::kCoulomb);
    const qp::Solution flat = Solve(island.problem, settings), whole = Solve(island.problem, WithoutPlanar(settings));
    if (flat.rung == Rung::kPlanar) continue;  // towers at rest
    EXPECT_EQ(flat.velocities, whole.velocities);
    EXPECT_EQ(flat.in_vain.times(), whole.in_vain.times());
  }
}

TEST(PlanarProblem, AllocatesNothingWhenRepeated) {
  Random random(308);
  const Problem problem = RandomPlanarIsland(&random, 15, 0.4, false);
  const qp::Settings settings = PlanarSettings(problem, Model::kCoulomb);
  qp::IslandSolver solver;
  qp::Solution solution;
  for (int i = 0; i < 2; ++i) solver.Solve(problem, settings, &solution);
  ASSERT_EQ(solution.rung, Rung::kPlanar);
  const AllocationCounter counter;
  solver.Solve(problem, settings, &solution);
  EXPECT_EQ(counter.count(), 0);
}

}  // namespace
}  // namespace islet::testing
