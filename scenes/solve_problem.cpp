#include "scenes/solve_problem.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "qp/cascade/island_solver.h"
#include "qp/dense/dense_solver.h"

namespace islet {
namespace {

constexpr double kSameMass = 1e-12;   // relative: entries of a rigid body's block that should be equal, or zero
constexpr double kLeastScale = 1e-6;  // of the fastest contact: least v_ref
constexpr int kMostDense = 3000;      // contacts
constexpr double kLeastAim = 1e-15;   // relative gap

using Entry = SparseMatrix::InnerIterator;
using Matrix6 = Eigen::Matrix<double, 6, 6>;

// Returns the asymmetry.
double Symmetrise(SparseMatrix* matrix) {
  const SparseMatrix transposed = matrix->transpose();
  const SparseMatrix difference = *matrix - transposed;
  const auto largest = [](const SparseMatrix& m) {
    double most = 0;
    for (int k = 0; k < m.outerSize(); ++k)
      for (Entry e(m, k); e; ++e) most = std::max(most, std::abs(e.value()));
    return most;
  };
  const double asymmetry = largest(difference);
  if (asymmetry == 0) return 0;
  const double scale = largest(*matrix);
  *matrix = 0.5 * (*matrix + transposed);
  return asymmetry / scale;
}

// The block of one rigid body, or nothing: mass times unit matrix, inertia, and zeros between.
std::optional<qp::BodyTerm> RigidBody(const SparseMatrix& mass, int body) {
  Matrix6 block = Matrix6::Zero();
  for (int column = 0; column < 6; ++column)
    for (Entry e(mass, 6 * body + column); e; ++e) {
      const auto row = e.row() - 6 * body;
      if (row < 0 || row >= 6) return std::nullopt;
      block(row, column) = e.value();
    }
  qp::BodyTerm term;
  term.mass = block(0, 0);
  term.inertia = block.bottomRightCorner<3, 3>();
  const double mass_slack = (block.topLeftCorner<3, 3>() - term.mass * qp::Matrix3::Identity()).cwiseAbs().maxCoeff();
  const double cross_slack = block.topRightCorner<3, 3>().cwiseAbs().maxCoeff();
  if (!(term.mass > 0) || mass_slack > kSameMass * term.mass || cross_slack > 0) return std::nullopt;
  const Eigen::LLT<qp::Matrix3> factors(term.inertia);
  if (factors.info() != Eigen::Success) return std::nullopt;
  term.inverse_inertia = factors.solve(qp::Matrix3::Identity());
  term.inverse_inertia = (0.5 * (term.inverse_inertia + term.inverse_inertia.transpose())).eval();
  return term;
}

// The contact, with bodies by their place in M; nothing if it joins more than two, or none.
std::optional<qp::ContactTerm> RigidContact(const FclibProblem& file, int contact) {
  qp::ContactTerm term;
  for (int row = 0; row < 3; ++row)
    for (Entry e(file.coupling, 3 * contact + row); e; ++e) {
      if (e.value() == 0) continue;
      const int body = static_cast<int>(e.row()) / 6, place = static_cast<int>(e.row()) % 6;
      if (term.body_a < 0) term.body_a = body;
      if (term.body_a != body && term.body_b < 0) term.body_b = body;
      if (body != term.body_a && body != term.body_b) return std::nullopt;
      (body == term.body_a ? term.jacobian_a : term.jacobian_b)(row, place) = e.value();
    }
  if (term.body_a < 0) return std::nullopt;
  term.drift = file.drift.segment<3>(3 * contact);
  term.friction = file.friction[contact];
  return term;
}

// Fills `rigid` and `touched` if the problem is one of rigid bodies.
void FindRigidBodies(SolveProblem* problem) {
  const FclibProblem& file = problem->file;
  if (!file.global || file.mass.rows() % 6 != 0) return;
  qp::Problem rigid;
  for (int c = 0; c < file.num_contacts(); ++c) {
    const std::optional<qp::ContactTerm> contact = RigidContact(file, c);
    if (!contact) return problem->touched.clear();
    rigid.contacts.push_back(*contact);
    for (const int body : {contact->body_a, contact->body_b})
      if (body >= 0) problem->touched.push_back(body);
  }
  std::vector<int>& touched = problem->touched;
  std::sort(touched.begin(), touched.end());
  touched.erase(std::unique(touched.begin(), touched.end()), touched.end());
  std::vector<int> local(file.mass.rows() / 6, -1);
  for (const int body : touched) {
    std::optional<qp::BodyTerm> term = RigidBody(file.mass, body);
    if (!term) return touched.clear();
    local[body] = rigid.num_bodies();
    term->velocity.head<3>() = file.load.segment<3>(6 * body) / term->mass;
    term->velocity.tail<3>() = term->inverse_inertia * file.load.segment<3>(6 * body + 3);
    rigid.bodies.push_back(*term);
  }
  for (qp::ContactTerm& contact : rigid.contacts) {
    contact.body_a = local[contact.body_a];
    if (contact.body_b >= 0) contact.body_b = local[contact.body_b];
  }
  problem->rigid = std::move(rigid);
}

double FastestApproach(const Eigen::VectorXd& velocities) {
  double approach = 0, fastest = 0;
  for (Eigen::Index c = 0; c + 2 < velocities.size(); c += 3) {
    approach = std::max(approach, -velocities[c]);
    fastest = std::max(fastest, velocities.segment<3>(c).norm());
  }
  if (fastest == 0) return 1;
  return approach > 0 ? std::max(approach, kLeastScale * fastest) : fastest;
}

Eigen::VectorXd FreeVelocities(const FclibProblem& file, const Eigen::VectorXd& momentum) {
  const Eigen::SimplicialLDLT<SparseMatrix> factors(file.mass);
  return factors.solve(momentum);
}

void SolveSparse(const SolveProblem& problem, const qp::Settings& settings, SolveAnswer* answer) {
  qp::IslandSolver solver;
  qp::Solution solution;
  solver.Solve(*problem.rigid, settings, &solution);
  answer->status = solution.status;
  answer->iterations = solution.iterations;
  for (int c = 0; c < problem.file.num_contacts(); ++c) answer->r.segment<3>(3 * c) = solution.impulses[c];
  answer->v = FreeVelocities(problem.file, problem.file.load);  // of those that nothing touches
  for (size_t i = 0; i < problem.touched.size(); ++i)
    answer->v.segment<6>(6 * problem.touched[i]) = Eigen::Map<const qp::Vector6>(&solution.velocities[6 * i]);
}

void SolveDense(const SolveProblem& problem, const qp::Settings& settings, SolveAnswer* answer) {
  const FclibProblem& file = problem.file;
  qp::DenseProblem local;
  local.velocity = problem.free_velocity;
  local.friction.assign(file.friction.begin(), file.friction.end());
  if (file.global) {
    const Eigen::SimplicialLDLT<SparseMatrix> factors(file.mass);
    const SparseMatrix response = factors.solve(file.coupling);
    local.delassus = SparseMatrix(file.coupling.transpose() * response);
    local.delassus = (0.5 * (local.delassus + local.delassus.transpose())).eval();
  } else {
    local.delassus = file.delassus;
  }
  qp::DenseSolution solution;
  try {
    local.Validate();
    qp::DenseSolver().Solve(local, settings, &solution);
  } catch (const std::invalid_argument& error) {
    throw FclibError(problem.name + ": " + (file.global ? "/fclib_global/H" : "/fclib_local/W") + ": " + error.what());
  }
  answer->status = solution.status;
  answer->iterations = solution.iterations;
  answer->r = solution.impulses;
  answer->u = solution.velocities;
  if (file.global) answer->v = FreeVelocities(file, file.load + file.coupling * answer->r);
}

}  // namespace

SolveProblem PrepareProblem(const std::string& name, FclibProblem file) {
  SolveProblem problem;
  problem.name = name;
  problem.file = std::move(file);
  FclibProblem& f = problem.file;
  problem.asymmetry = Symmetrise(f.global ? &f.mass : &f.delassus);
  if (f.global) {
    const Eigen::SimplicialLLT<SparseMatrix> factors(f.mass);
    if (factors.info() != Eigen::Success) throw FclibError(name + ": /fclib_global/M: is not positive definite");
    problem.free_velocity = f.coupling.transpose() * factors.solve(f.load) + f.drift;
  } else {
    problem.free_velocity = f.q;
  }
  problem.v_ref = FastestApproach(problem.free_velocity);
  FindRigidBodies(&problem);
  return problem;
}

bool FitsDense(const SolveProblem& problem) { return problem.file.num_contacts() <= kMostDense; }

SolveAnswer SolveBy(bool sparse, const SolveProblem& problem, const SolveLaw& law) {
  qp::Settings settings;
  settings.model = law.model;
  settings.cone = law.cone;
  settings.effort = qp::kThoroughEffort;
  settings.tolerance = law.tolerance;
  settings.velocity_scale = problem.v_ref;
  settings.aim = std::max(kLeastAim, 1e-2 * law.tolerance * law.tolerance);
  SolveAnswer answer;
  answer.r.setZero(3 * problem.file.num_contacts());
  if (sparse) {
    SolveSparse(problem, settings, &answer);
  } else {
    SolveDense(problem, settings, &answer);
  }
  if (problem.file.global) answer.u = problem.file.coupling.transpose() * answer.v + problem.file.drift;
  return answer;
}

}  // namespace islet
