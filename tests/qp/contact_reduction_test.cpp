// Contacts inside a face: what leaving them out keeps, and when it must not happen.
#include "qp/contact_reduction.h"

#include <algorithm>
#include <cmath>
#include <functional>

#include <gtest/gtest.h>
#include <Eigen/QR>

#include "qp/island_solver.h"
#include "tests/support/no_alloc.h"
#include "tests/support/random_problems.h"

namespace islet::testing {
namespace {

using qp::Rung;

// A box on a face with its four corners and points inside it, on its edges, and on its corners once more.
struct Face {
  Problem problem;
  int inside = 0;  // of the points
};

Face RandomFace(std::uint32_t seed, double friction = 0.5) {
  Random random(seed);
  ProblemBuilder builder;
  const double x = random.Uniform(0.3, 1), y = random.Uniform(0.3, 1);
  builder.AddBox({0, 0, 0.5}, {x, y, 0.5}, random.Uniform(0.5, 2));
  builder.AddFace(-1, 0, {0, 0, 0}, x, y, friction);
  Face face;
  for (int k = random.Integer(1, 8); k > 0; --k, ++face.inside) {
    const int kind = random.Integer(0, 2);
    const Vector3 point = kind == 0   ? Vector3(x * random.Uniform(-0.9, 0.9), y * random.Uniform(-0.9, 0.9), 0)
                          : kind == 1 ? Vector3(x, y * random.Uniform(-0.9, 0.9), 0)
                                      : Vector3(-x, y, 0);
    builder.AddContact(-1, 0, point, {0, 0, 1}, friction);
  }
  std::shuffle(builder.problem.contacts.begin(), builder.problem.contacts.end(), random.engine());
  face.problem = builder.problem;
  face.problem.bodies[0].velocity << random.Vector(1), random.Vector(0.5);
  face.problem.bodies[0].velocity[2] -= 1;
  return face;
}

qp::Solution Solve(const Problem& problem, qp::Model model, qp::Ladder ladder, qp::Cone cone = qp::Cone::kCircular) {
  qp::Settings settings;
  settings.model = model;
  settings.cone = cone;
  settings.ladder = ladder;
  settings.velocity_scale = VelocityScale(problem);
  qp::IslandSolver solver;
  qp::Solution solution;
  solver.Solve(problem, settings, &solution);
  EXPECT_EQ(solution.status, qp::Status::kSolved);
  return solution;
}

// [velocity] how far u - target is outside the dual cone with the slip added, what pulls, and what works: |j . (u + s n - b n)|.
double WorstOfTheLaw(const Problem& problem, const qp::Solution& solution) {
  double worst = 0;
  for (int c = 0; c < problem.num_contacts(); ++c) {
    const ContactTerm& contact = problem.contacts[c];
    Vector3 u = qp::ContactVelocity(contact, solution.velocities.data());
    u[0] += solution.slips[c] - contact.target;
    const Vector3& j = solution.impulses[c];
    worst = std::max({worst, contact.friction * u.tail<2>().norm() - u[0], j.tail<2>().norm() - contact.friction * j[0],
                      std::abs(j.dot(u))});
  }
  return worst;
}

TEST(ContactReduction, LeavesTheCornersOfAFace) {
  for (std::uint32_t seed = 0; seed < 200; ++seed) {
    const Face face = RandomFace(seed);
    qp::ContactReduction reduction;
    ASSERT_TRUE(reduction.Reduce(face.problem)) << seed;
    EXPECT_EQ(reduction.problem().num_contacts(), 4) << seed;
  }
}

// All that an impulse does through a contact: both Jacobians, side by side, and the drift.
Eigen::VectorXd Effect(const ContactTerm& contact) {
  Eigen::VectorXd effect(39);
  effect << Eigen::Map<const Eigen::VectorXd>(contact.jacobian_a.data(), 18),
      Eigen::Map<const Eigen::VectorXd>(contact.jacobian_b.data(), 18), contact.drift;
  return effect;
}

// The least of what three contacts, each with a weight that is not negative, leave of the effect of another one.
double LeftByThree(const std::vector<ContactTerm>& kept, const ContactTerm& contact) {
  double least = INFINITY;
  const size_t n = kept.size();
  for (size_t i = 0; i < n; ++i) {
    for (size_t j = i + 1; j < n; ++j) {
      for (size_t k = j + 1; k < n; ++k) {
        Eigen::MatrixXd effects(40, 3);  // and the weights' sum
        effects << Effect(kept[i]), Effect(kept[j]), Effect(kept[k]), Eigen::RowVector3d::Ones();
        Eigen::VectorXd wanted(40);
        wanted << Effect(contact), 1;
        const Eigen::Vector3d weights = effects.colPivHouseholderQr().solve(wanted);
        least = std::min(least, std::max((effects * weights - wanted).norm(), -weights.minCoeff()));
      }
    }
  }
  return least;
}

// The set of wrenches is the same: what an impulse does at a contact that was left out, the same one does in parts at three that
// were kept, and these parts lie in the cones if it does. Also between two bodies, and at a wall that moves.
TEST(ContactReduction, KeepsTheSetOfWrenches) {
  Random random(703);
  int left_out = 0;
  for (int trial = 0; trial < 100; ++trial) {
    ProblemBuilder builder;
    builder.AddBox({0, 0, 0.5}, {1, 1, 0.5}, 1);
    builder.AddBox({0.2, 0.1, -0.5}, {1, 1, 0.5}, 2);
    const int below = trial % 2 == 0 ? 1 : -1;
    for (int k = random.Integer(5, 20); k > 0; --k)
      builder.AddContact(below, 0, {random.Uniform(-1, 1), random.Uniform(-1, 1), 0}, {0, 0, 1}, 0.5);
    for (ContactTerm& contact : builder.problem.contacts)
      if (below < 0) contact.drift = {0.1, -0.2, 0.3};
    qp::ContactReduction reduction;
    if (!reduction.Reduce(builder.problem)) continue;
    const std::vector<ContactTerm>& all = builder.problem.contacts;
    std::vector<Vector3> numbers, kept;
    for (size_t c = 0; c < all.size(); ++c) numbers.emplace_back(static_cast<double>(c), 0, 0);
    reduction.Select(numbers, &kept);
    ASSERT_GE(kept.size(), 3U);
    left_out += static_cast<int>(all.size() - kept.size());
    for (size_t c = 0; c < all.size(); ++c) EXPECT_LT(LeftByThree(reduction.problem().contacts, all[c]), 1e-13) << c;
  }
  EXPECT_GT(left_out, 300);
}

// A face whose normals are nearly the same, or of which a point is nearly outside: where it is left out the law holds there.
TEST(ContactReduction, BorderlinePointsMeetTheLaw) {
  int reduced = 0, kept = 0;
  for (int decade = -14; decade <= -3; ++decade) {
    for (int kind = 0; kind < 4; ++kind) {
      ProblemBuilder builder;
      builder.AddBox({0, 0, 0.5}, {0.5, 0.5, 0.5}, 1);
      builder.AddFace(-1, 0, {0, 0, 0}, 0.5, 0.5, 0.5);
      const double by = std::pow(10.0, decade);
      const Vector3 normal = kind == 0 ? Vector3(by, 0, 1).normalized() : Vector3::UnitZ();
      const double x = kind == 1 ? 0.5 + by : kind == 2 ? 0.5 - by : 0.3;
      builder.AddContact(-1, 0, {x, 0.1, kind == 3 ? by : 0}, normal, 0.5);
      builder.problem.bodies[0].velocity << 0.1, 0.2, -1, 0.3, -0.2, 0.1;
      for (const qp::Model model : {qp::Model::kConvex, qp::Model::kCoulomb}) {
        const qp::Solution ours = Solve(builder.problem, model, qp::Ladder::Off().With(Rung::kCorners));
        EXPECT_LT(WorstOfTheLaw(builder.problem, ours), 3e-6) << decade << " " << kind;
        (ours.rung == Rung::kCorners ? reduced : kept) += 1;
      }
    }
  }
  EXPECT_GT(reduced, 20);
  EXPECT_GT(kept, 40);
}

TEST(ContactReduction, ConvexModelsHaveTheSameAnswer) {
  int reduced = 0;
  for (std::uint32_t seed = 0; seed < 100; ++seed) {
    const Problem problem = RandomFace(seed).problem;
    for (const qp::Cone cone : {qp::Cone::kCircular, qp::Cone::kOctagon}) {
      const qp::Solution full = Solve(problem, qp::Model::kConvex, qp::Ladder::Off(), cone);
      const qp::Solution ours = Solve(problem, qp::Model::kConvex, qp::Ladder::Off().With(Rung::kCorners), cone);
      reduced += ours.rung == Rung::kCorners;
      EXPECT_LT(VelocityDistance(problem, full.velocities, ours.velocities), 1e-6 * VelocityScale(problem)) << seed;
    }
    EXPECT_LT(WorstOfTheLaw(problem, Solve(problem, qp::Model::kConvex, qp::Ladder::Off().With(Rung::kCorners))), 1e-6);
  }
  EXPECT_EQ(reduced, 200);
}

// One of the answers of exact Coulomb friction: the law holds at the points that were left out, too.
TEST(ContactReduction, ExactFrictionHoldsAtAllPoints) {
  for (std::uint32_t seed = 0; seed < 100; ++seed) {
    const Problem problem = RandomFace(seed).problem;
    const qp::Solution ours = Solve(problem, qp::Model::kCoulomb, qp::Ladder().Without(Rung::kClosedForm));
    EXPECT_EQ(ours.rung, Rung::kCorners);
    EXPECT_LT(WorstOfTheLaw(problem, ours), 3e-6 * VelocityScale(problem)) << seed;
    for (int c = 0; c < problem.num_contacts(); ++c) {
      const Vector3 u = qp::ContactVelocity(problem.contacts[c], ours.velocities.data());
      EXPECT_LE(std::abs(ours.slips[c] - problem.contacts[c].friction * u.tail<2>().norm()),
                ours.impulses[c].isZero(0) ? INFINITY : 3e-6 * VelocityScale(problem));
    }
  }
}

TEST(ContactReduction, KeepsWhatIsNeeded) {
  const auto reduces = [](const std::function<void(ContactTerm*)>& change) {
    ProblemBuilder builder;
    builder.AddBox({0, 0, 0.5}, {0.5, 0.5, 0.5}, 1);
    builder.AddFace(-1, 0, {0, 0, 0}, 0.5, 0.5, 0.5);
    builder.AddContact(-1, 0, {0.1, 0.2, 0}, {0, 0, 1}, 0.5);
    change(&builder.problem.contacts.back());
    qp::ContactReduction reduction;
    return reduction.Reduce(builder.problem);
  };
  EXPECT_TRUE(reduces([](ContactTerm*) {}));
  EXPECT_TRUE(reduces([](ContactTerm* c) { c->target = -1; }));  // asks for less than its corners
  EXPECT_FALSE(reduces([](ContactTerm* c) { c->target = 1e-6; }));
  EXPECT_FALSE(reduces([](ContactTerm* c) { c->friction = 0.4; }));
  EXPECT_FALSE(reduces([](ContactTerm* c) { c->drift[1] = 1e-6; }));
  EXPECT_FALSE(reduces([](ContactTerm* c) { c->compliance = 1e-6; }));
  EXPECT_FALSE(reduces([](ContactTerm* c) { c->jacobian_b.row(0).tail<3>() *= 10; }));    // outside the face
  EXPECT_FALSE(reduces([](ContactTerm* c) { c->jacobian_b.row(1).tail<3>() *= 1.01; }));  // not in its plane
  EXPECT_FALSE(reduces([](ContactTerm* c) { c->jacobian_b *= -1; }));
}

TEST(ContactReduction, TwinsAndPointsOnALine) {
  ProblemBuilder builder;
  builder.AddBox({0, 0, 0.5}, {0.5, 0.5, 0.5}, 1);
  for (const double x : {-0.5, 0.5, 0.0, 0.25, 0.5}) builder.AddContact(-1, 0, {x, 0.5, 0}, {0, 0, 1}, 0.5);
  qp::ContactReduction reduction;
  ASSERT_TRUE(reduction.Reduce(builder.problem));
  EXPECT_EQ(reduction.problem().num_contacts(), 2);
  builder.problem.contacts.resize(2);
  EXPECT_FALSE(reduction.Reduce(builder.problem));
  builder.problem.contacts[1] = builder.problem.contacts[0];
  ASSERT_TRUE(reduction.Reduce(builder.problem));
  EXPECT_EQ(reduction.problem().num_contacts(), 1);
}

TEST(ContactReduction, AllocatesNothingWhenWarm) {
  const Problem problem = RandomFace(3).problem;
  qp::IslandSolver solver;
  qp::Solution solution;
  qp::Settings settings;
  settings.velocity_scale = VelocityScale(problem);
  solver.Solve(problem, settings, &solution);
  EXPECT_EQ(solution.rung, Rung::kCorners);
  const AllocationCounter counter;
  solver.Solve(problem, settings, &solution);
  EXPECT_EQ(counter.count(), 0);
}

}  // namespace
}  // namespace islet::testing
