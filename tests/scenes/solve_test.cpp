#include <gtest/gtest.h>

#include <cmath>

#include "engine/world.h"
#include "qp/cascade/island_solver.h"
#include "scenes/export_fclib.h"
#include "scenes/solve_judge.h"
#include "scenes/solve_problem.h"
#include "tests/support/random_problems.h"

namespace islet::testing {
namespace {

using qp::Cone;
using qp::Model;
using Vector6 = Eigen::Matrix<double, 6, 1>;

SparseMatrix Sparse(const Eigen::MatrixXd& dense) { return dense.sparseView(); }

FclibProblem LocalFile(const Eigen::MatrixXd& w, const Eigen::VectorXd& q, const Eigen::VectorXd& mu) {
  FclibProblem file;
  file.delassus = Sparse(w);
  file.q = q;
  file.friction = mu;
  return file;
}

// W = 2 I, q = (-1, 3, 4), mu = 0.5: exact Coulomb gives r = (0.5, -0.15, -0.2), u = (0, 2.7, 3.6).
FclibProblem SlidingContact() {
  return LocalFile(2 * Eigen::Matrix3d::Identity(), Eigen::Vector3d(-1, 3, 4), Eigen::VectorXd::Constant(1, 0.5));
}

TEST(SolveProblem, OneContact) {
  const SolveProblem problem = PrepareProblem("p", SlidingContact());
  EXPECT_FALSE(problem.rigid);
  EXPECT_EQ(problem.v_ref, 1);
  EXPECT_EQ(problem.asymmetry, 0);
  const SolveAnswer answer = SolveBy(false, problem, {});
  EXPECT_LT((answer.r - Eigen::Vector3d(0.5, -0.15, -0.2)).norm(), 1e-8);
  EXPECT_LT((answer.u - Eigen::Vector3d(0, 2.7, 3.6)).norm(), 1e-8);
}

TEST(SolveProblem, SymmetrisesAndTells) {
  Eigen::Matrix3d w = 2 * Eigen::Matrix3d::Identity();
  w(0, 1) = 0.02;
  const FclibProblem original = LocalFile(w, Eigen::Vector3d(-1, 3, 4), Eigen::VectorXd::Constant(1, 0.5));
  const SolveProblem problem = PrepareProblem("p", original);
  EXPECT_NEAR(problem.asymmetry, 0.01, 1e-15);
  EXPECT_EQ(problem.file.delassus.coeff(0, 1), 0.01);
  EXPECT_EQ(problem.file.delassus.coeff(1, 0), 0.01);
  const SolveAnswer answer = SolveBy(false, problem, {});
  const SolveVerdict verdict = Judge(original, problem, answer, Model::kCoulomb, Cone::kCircular);
  EXPECT_LT(verdict.coulomb_map_max, 1e-6);  // of the symmetric problem
  EXPECT_GT(verdict.siconos_error, 1e-4);    // of the file's own
}

// Two masses on a spring, one of them touches: M is not that of rigid bodies. W = H^T M^-1 H by hand: M^-1 = 1/3 (2 -1; -1 2).
TEST(SolveProblem, MassesOfOtherKinds) {
  FclibProblem file;
  file.global = true;
  Eigen::MatrixXd mass = Eigen::MatrixXd::Identity(6, 6);
  mass.topLeftCorner(2, 2) = Eigen::Matrix2d{{2, 1}, {1, 2}};
  file.mass = Sparse(mass);
  Eigen::MatrixXd h = Eigen::MatrixXd::Zero(6, 3);
  h(0, 0) = h(2, 1) = h(3, 2) = 1;
  file.coupling = Sparse(h);
  file.load = Eigen::VectorXd::Zero(6);
  file.load[2] = 3, file.load[3] = 4;
  file.drift = Eigen::Vector3d(-1, 0, 0);
  file.friction = Eigen::VectorXd::Constant(1, 0.5);
  const SolveProblem problem = PrepareProblem("p", file);
  EXPECT_FALSE(problem.rigid);
  const SolveAnswer answer = SolveBy(false, problem, {});
  EXPECT_LT((answer.r - Eigen::Vector3d(1.5, -0.45, -0.6)).norm(), 1e-8);  // W_nn = 2/3
  EXPECT_NEAR(answer.v[0], 1, 1e-8);
  EXPECT_NEAR(answer.v[1], -0.5, 1e-8);
  const SolveVerdict verdict = Judge(file, problem, answer, Model::kCoulomb, Cone::kCircular);
  EXPECT_LT(verdict.coulomb_map_max, 1e-8);
  EXPECT_LT(verdict.momentum, 1e-14);
}

TEST(SolveProblem, RefusesWhatIsNoProblem) {
  const auto reason = [](FclibProblem file) {
    try {
      SolveBy(false, PrepareProblem("p", std::move(file)), {});
    } catch (const FclibError& error) {
      return std::string(error.what());
    }
    return std::string("no complaint");
  };
  FclibProblem flat = SlidingContact();
  flat.delassus = Sparse(Eigen::Matrix3d(Eigen::Vector3d(0, 1, 1).asDiagonal()));
  EXPECT_EQ(reason(flat).rfind("p: /fclib_local/W: ", 0), 0u) << reason(flat);
  FclibProblem saddle = SlidingContact();
  saddle.delassus = Sparse(Eigen::Matrix3d{{1, 3, 0}, {3, 1, 0}, {0, 0, 1}});
  EXPECT_EQ(reason(saddle).rfind("p: /fclib_local/W: ", 0), 0u) << reason(saddle);
  FclibProblem massless;
  massless.global = true;
  massless.mass = Sparse(Eigen::Matrix3d(Eigen::Vector3d(1, 1, -1).asDiagonal()));
  massless.coupling = Sparse(Eigen::Matrix3d::Identity());
  massless.load = massless.drift = Eigen::Vector3d(-1, 0, 0);
  massless.friction = Eigen::VectorXd::Constant(1, 0.5);
  EXPECT_EQ(reason(massless), "p: /fclib_global/M: is not positive definite");
}

// By hand for r = 0: u = q. The circular cone's projection of -q / ... is worked out in dense_newton_test; here rho = 1/2.
TEST(SolveJudge, ByHand) {
  const FclibProblem file = SlidingContact();
  const SolveProblem problem = PrepareProblem("p", file);
  SolveAnswer nothing;
  nothing.r = Eigen::Vector3d::Zero();
  nothing.u = file.q;
  const double ray = std::hypot(1, 0.5);
  // Coulomb: u_hat_n = -1 + 2.5, so (-1.5, -3, -4) is projected, times rho; the map is that over rho.
  SolveVerdict verdict = Judge(file, problem, nothing, Model::kCoulomb, Cone::kCircular);
  EXPECT_NEAR(verdict.coulomb_map_max, 0.8 * ray, 1e-14);
  EXPECT_NEAR(verdict.coulomb_map_rms, 0.8 * ray, 1e-14);
  EXPECT_EQ(verdict.natural_map_max, verdict.coulomb_map_max);
  EXPECT_NEAR(verdict.siconos_error, 0.8 * ray / std::sqrt(26.0), 1e-14);
  EXPECT_EQ(verdict.momentum, 0);
  verdict = Judge(file, problem, nothing, Model::kConvex, Cone::kCircular);
  EXPECT_NEAR(verdict.natural_map_max, 2.8 * ray, 1e-14);
  // The exact answer, and what is left if the solver's velocities are not those of its impulses.
  SolveAnswer exact;
  exact.r = Eigen::Vector3d(0.5, -0.15, -0.2);
  exact.u = Eigen::Vector3d(0, 2.7, 3.6);
  verdict = Judge(file, problem, exact, Model::kCoulomb, Cone::kCircular);
  EXPECT_LT(verdict.coulomb_map_max, 1e-15);
  EXPECT_LT(verdict.siconos_error, 1e-15);
  EXPECT_LT(verdict.gap, 1e-15);
  exact.u[1] += 0.5;
  EXPECT_NEAR(Judge(file, problem, exact, Model::kCoulomb, Cone::kCircular).momentum, 0.5, 1e-14);
  exact.r[2] = NAN;
  EXPECT_FALSE(Judge(file, problem, exact, Model::kCoulomb, Cone::kCircular).finite);
}

TEST(SolveJudge, Octagon) {
  FclibProblem file;  // the sliding contact, of one body
  file.global = true;
  file.mass = Sparse(Vector6{0.5, 0.5, 0.5, 1, 1, 1}.asDiagonal().toDenseMatrix());
  file.coupling = Sparse(Eigen::MatrixXd::Identity(6, 3));
  file.load = Vector6{-0.5, 1.5, 2, 0, 0, 0};
  file.drift = Eigen::Vector3d::Zero();
  file.friction = Eigen::VectorXd::Constant(1, 0.5);
  const SolveProblem problem = PrepareProblem("p", file);
  ASSERT_TRUE(problem.rigid);
  for (const Model model : {Model::kConvex, Model::kCoulomb}) {
    const SolveAnswer answer = SolveBy(true, problem, {model, Cone::kOctagon, 1e-7});
    EXPECT_LT(Judge(file, problem, answer, model, Cone::kOctagon).natural_map_max, 1e-6);
    EXPECT_GT(Judge(file, problem, answer, model, Cone::kCircular).natural_map_max, 1e-3);
  }
}

// Islands as FCLIB problems: recognised as rigid bodies, and the same velocities, by both ways.
TEST(ExportFclib, RoundTrip) {
  for (const NamedProblem& named : RandomIslands(4, 30, 10, true)) {
    SCOPED_TRACE(named.name);
    if (named.problem.num_contacts() == 0) continue;
    qp::Settings settings;
    settings.model = Model::kConvex;
    settings.tolerance = 1e-10, settings.aim = 1e-14;
    settings.velocity_scale = VelocityScale(named.problem);
    qp::Solution solution;
    qp::IslandSolver().Solve(named.problem, settings, &solution);
    if (solution.status != qp::Status::kSolved) continue;  // bounces that contradict each other
    const FclibExample example = ToFclib(named.problem, solution);
    const SolveProblem problem = PrepareProblem("p", example.problem);
    ASSERT_TRUE(problem.rigid);
    EXPECT_LE(static_cast<int>(problem.touched.size()), named.problem.num_bodies());  // less those that nothing touches
    EXPECT_EQ(problem.asymmetry, 0);
    for (const bool sparse : {true, false}) {
      const SolveAnswer answer = SolveBy(sparse, problem, {Model::kConvex, Cone::kCircular, 1e-7});
      const std::vector<double> v(answer.v.begin(), answer.v.end());
      EXPECT_LT(VelocityDistance(named.problem, v, solution.velocities), 1e-5 * settings.velocity_scale);
      const SolveVerdict verdict = Judge(example.problem, problem, answer, Model::kConvex, Cone::kCircular);
      EXPECT_LT(verdict.natural_map_max, sparse ? 1e-4 : 1e-6);
      EXPECT_LT(verdict.momentum, 1e-10);
    }
    SolveAnswer stored;
    stored.v = example.solution.v, stored.u = example.solution.u, stored.r = example.solution.r;
    EXPECT_LT(Judge(example.problem, problem, stored, Model::kConvex, Cone::kCircular).natural_map_max, 1e-4);
  }
}

// What the observer of a world sees does not depend on the number of threads, and the world does not depend on it.
TEST(ExportFclib, ObserverSeesEveryProblem) {
  const auto run = [](int threads, bool watch) {
    Settings settings;
    settings.threads = threads;
    World world(settings);
    world.Add({.shape = Shape::HalfSpace(), .kind = BodyKind::kFixed});
    for (int i = 0; i < 6; ++i)
      world.Add({.shape = Shape::Box({0.5, 0.5, 0.5}), .position_W = {3.0 * (i % 3), 0, 0.6 + 1.1 * (i / 3)}});
    std::vector<double> seen;
    int reported = 0;
    for (int frame = 0; frame < 20; ++frame) {
      if (watch)
        world.SetProblemObserver([&](const ProblemRecord& record) {
          seen.push_back(record.round + 10 * record.island + 1000 * static_cast<int>(record.stage));
          seen.insert(seen.end(), record.solution.velocities.begin(), record.solution.velocities.end());
          EXPECT_EQ(record.problem.contacts.size(), record.solution.impulses.size());
          --reported;
        });
      const StepReport report = world.Step(1.0 / 60);
      reported += watch ? report.collision_qp.solved + report.static_qp.solved : 0;
      world.SetProblemObserver({});
    }
    EXPECT_EQ(reported, 0);
    return std::make_pair(seen, world.StateHash());
  };
  const auto one = run(1, true), two = run(2, true), unseen = run(2, false);
  EXPECT_GT(one.first.size(), 100u);
  EXPECT_EQ(one.first, two.first);
  EXPECT_EQ(one.second, two.second);
  EXPECT_EQ(one.second, unseen.second);
}

}  // namespace
}  // namespace islet::testing
