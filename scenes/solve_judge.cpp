#include "scenes/solve_judge.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

namespace islet {
namespace {

using Vector2 = Eigen::Vector2d;
using Vector3 = Eigen::Vector3d;
using Matrix3 = Eigen::Matrix3d;

Vector3 ProjectOnCircular(const Vector3& x, double mu) {
  const double tangent = x.tail<2>().norm();
  if (x[0] + mu * tangent <= 0) return Vector3::Zero();
  if (tangent <= mu * x[0]) return x;
  const double normal = (x[0] + mu * tangent) / (1 + mu * mu);
  Vector3 out;
  out << normal, (mu * normal / tangent) * x.tail<2>();
  return out;
}

// The nearest of: the point itself, its images on the eight facets that lie in the pyramid, on the eight edges, the apex.
Vector3 ProjectOnOctagon(const Vector3& x, double mu) {
  std::array<Vector3, 8> edges, facets;
  for (int k = 0; k < 8; ++k) {
    const double facet = k * std::numbers::pi / 4, edge = facet + std::numbers::pi / 8;
    edges[k] = {1, mu * std::cos(edge), mu * std::sin(edge)};
    facets[k] = {mu * std::cos(std::numbers::pi / 8), -std::cos(facet), -std::sin(facet)};
    facets[k].normalize();
  }
  const auto inside = [&](const Vector3& p) {
    return std::all_of(facets.begin(), facets.end(), [&](const Vector3& f) { return f.dot(p) >= -1e-14 * p.norm(); });
  };
  if (mu == 0) return {std::max(0.0, x[0]), 0, 0};
  if (inside(x)) return x;
  Vector3 nearest = Vector3::Zero();
  const auto offer = [&](const Vector3& p) {
    if ((p - x).squaredNorm() < (nearest - x).squaredNorm()) nearest = p;
  };
  for (int k = 0; k < 8; ++k) {
    const Vector3 on_facet = x - facets[k].dot(x) * facets[k];
    if (inside(on_facet)) offer(on_facet);
    offer(std::max(0.0, x.dot(edges[k]) / edges[k].squaredNorm()) * edges[k]);
  }
  return nearest;
}

Vector3 Project(const Vector3& x, double mu, qp::Cone cone) {
  return cone == qp::Cone::kCircular ? ProjectOnCircular(x, mu) : ProjectOnOctagon(x, mu);
}

// What exact Coulomb friction adds to the normal velocity: the largest mu u_t . d over the directions of friction.
double SlipTerm(const Vector3& u, double mu, qp::Cone cone) {
  if (cone == qp::Cone::kCircular) return mu * u.tail<2>().norm();
  double most = 0;
  for (int k = 0; k < 8; ++k) {
    const double angle = (k + 0.5) * std::numbers::pi / 4;
    most = std::max(most, mu * u.tail<2>().dot(Vector2(std::cos(angle), std::sin(angle))));
  }
  return most;
}

// tr W_cc of every contact. With a mass matrix W_cc = H_c^T M^-1 H_c.
std::vector<double> Traces(const SolveProblem& problem) {
  const FclibProblem& file = problem.file;
  std::vector<double> traces(file.num_contacts(), 0.0);
  Eigen::SimplicialLLT<SparseMatrix> factors;
  if (file.global && !problem.rigid) factors.compute(file.mass);
  for (int row = 0; row < 3 * file.num_contacts(); ++row) {
    double& trace = traces[row / 3];
    if (!file.global) {
      trace += file.delassus.coeff(row, row);
    } else if (!problem.rigid) {
      const Eigen::VectorXd column = file.coupling.col(row);
      const Eigen::VectorXd response = factors.solve(column);
      trace += column.dot(response);
    } else {
      const qp::ContactTerm& contact = problem.rigid->contacts[row / 3];
      for (const int local : {contact.body_a, contact.body_b}) {
        if (local < 0) continue;
        const int body = 6 * problem.touched[local];
        const Eigen::MatrixXd block = file.mass.block(body, body, 6, 6);
        const Eigen::VectorXd column = file.coupling.block(body, row, 6, 1).toDense();
        trace += column.dot(block.llt().solve(column));
      }
    }
  }
  return traces;
}

// u = W r + q from the file as it was read.
Eigen::VectorXd LocalVelocities(const FclibProblem& original, const SolveProblem& problem, const Eigen::VectorXd& r) {
  if (!original.global) return original.delassus * r + original.q;
  const Eigen::SimplicialLLT<SparseMatrix> factors(problem.file.mass);
  return original.coupling.transpose() * factors.solve(original.load + original.coupling * r) + original.drift;
}

double Imbalance(const SolveProblem& problem, const SolveAnswer& answer) {
  const FclibProblem& file = problem.file;
  if (file.num_contacts() == 0) return 0;
  if (!file.global) return (answer.u - file.delassus * answer.r - file.q).cwiseAbs().maxCoeff() / problem.v_ref;
  const Eigen::VectorXd masses = file.mass.diagonal();
  const Eigen::VectorXd left = file.mass * answer.v - file.coupling * answer.r - file.load;
  return std::sqrt(left.cwiseAbs2().cwiseQuotient(masses).sum() / masses.sum()) / problem.v_ref;
}

}  // namespace

SolveVerdict Judge(const FclibProblem& original, const SolveProblem& problem, const SolveAnswer& answer,
                   qp::Model model, qp::Cone cone) {
  SolveVerdict verdict;
  const int n = problem.file.num_contacts();
  verdict.finite = answer.r.allFinite() && answer.u.allFinite() && answer.v.allFinite();
  if (!verdict.finite || n == 0) return verdict;
  const Eigen::VectorXd u_siconos = LocalVelocities(original, problem, answer.r);
  const std::vector<double> traces = Traces(problem);
  double model_sum = 0, coulomb_sum = 0, siconos_sum = 0, work = 0, energy = 0;
  for (int c = 0; c < n; ++c) {
    const double mu = problem.file.friction[c], rho = 3 / traces[c];
    const Vector3 r = answer.r.segment<3>(3 * c), u = answer.u.segment<3>(3 * c);
    const auto with_slip = [&](Vector3 w, qp::Cone of) {
      w[0] += SlipTerm(w, mu, of);
      return w;
    };
    const Vector3 wanted = model == qp::Model::kCoulomb ? with_slip(u, cone) : u;
    const double model_map = (r - Project(r - rho * wanted, mu, cone)).norm() / (rho * problem.v_ref);
    const Vector3 exact = with_slip(u, qp::Cone::kCircular);
    const double coulomb_map = (r - ProjectOnCircular(r - rho * exact, mu)).norm() / (rho * problem.v_ref);
    const Vector3 given = with_slip(u_siconos.segment<3>(3 * c), qp::Cone::kCircular);
    verdict.natural_map_max = std::max(verdict.natural_map_max, model_map);
    verdict.coulomb_map_max = std::max(verdict.coulomb_map_max, coulomb_map);
    model_sum += model_map * model_map;
    coulomb_sum += coulomb_map * coulomb_map;
    siconos_sum += (r - ProjectOnCircular(r - given, mu)).squaredNorm();
    work += std::abs(r.dot(wanted));
    energy += 0.5 * rho * problem.v_ref * problem.v_ref;
  }
  verdict.natural_map_rms = std::sqrt(model_sum / n);
  verdict.coulomb_map_rms = std::sqrt(coulomb_sum / n);
  const double q = problem.free_velocity.norm();
  verdict.siconos_error = std::sqrt(siconos_sum) / (q > 0 ? q : 1);
  verdict.gap = work / energy;
  verdict.momentum = Imbalance(problem, answer);
  return verdict;
}

}  // namespace islet
