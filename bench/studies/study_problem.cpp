#include "bench/studies/study_problem.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "bench/answer_quality.h"
#include "scenes/solve_judge.h"

namespace islet::studies {
namespace {

using qp::Vector3;

Vector3 OnCircle(const Vector3& x, double mu) {
  const double tangent = std::hypot(x[1], x[2]);
  if (x[0] + mu * tangent <= 0) return Vector3::Zero();
  if (tangent <= mu * x[0]) return x;
  const double normal = (x[0] + mu * tangent) / (1 + mu * mu);
  return {normal, normal * mu * x[1] / tangent, normal * mu * x[2] / tangent};
}

// The nearest candidate that lies in the pyramid: the point, its images on facets and edges, the apex.
Vector3 OnOctagon(const Vector3& x, double mu) {
  if (mu == 0) return {std::max(0.0, x[0]), 0, 0};
  constexpr double kHalf = std::numbers::pi / 8;
  const double inner = mu * std::cos(kHalf);
  const auto outside = [&](const Vector3& p) {  // of the worst facet
    double worst = -INFINITY;
    for (int k = 0; k < 8; ++k)
      worst = std::max(worst, p[1] * std::cos(2 * k * kHalf) + p[2] * std::sin(2 * k * kHalf));
    return worst - inner * p[0];
  };
  if (outside(x) <= 0) return x;
  Vector3 nearest = Vector3::Zero();
  const auto offer = [&](const Vector3& p) {
    if (outside(p) <= 1e-13 * p.norm() && (p - x).norm() < (nearest - x).norm()) nearest = p;
  };
  for (int k = 0; k < 8; ++k) {
    const Vector3 facet = Vector3(inner, -std::cos(2 * k * kHalf), -std::sin(2 * k * kHalf)).normalized();
    const Vector3 edge(1, mu * std::cos((2 * k + 1) * kHalf), mu * std::sin((2 * k + 1) * kHalf));
    offer(x - facet.dot(x) * facet);
    offer(std::max(0.0, x.dot(edge) / edge.squaredNorm()) * edge);
  }
  return nearest;
}

// A frictionless bounce is written as drift of the normal; the rest of the drift moves with walls.
void RestoreTargets(qp::Problem* problem) {
  for (qp::ContactTerm& contact : problem->contacts) {
    contact.target = std::max(0.0, -contact.drift[0]);
    contact.drift[0] += contact.target;
  }
}

}  // namespace

Vector3 ProjectOn(const Vector3& x, double mu, qp::Cone cone) {
  return cone == qp::Cone::kCircular ? OnCircle(x, mu) : OnOctagon(x, mu);
}

StudyProblem ReadStudyProblem(const std::filesystem::path& file) {
  StudyProblem problem;
  problem.name = file.stem().string();
  problem.family = file.parent_path().filename().string();
  problem.original = ReadFclib(file.string());
  problem.solve = PrepareProblem(file.string(), problem.original);
  problem.general = MakeGeneral(problem.solve.file);
  problem.rigid = problem.solve.rigid.has_value();
  if (!problem.rigid) return problem;
  problem.island.problem = *problem.solve.rigid;
  problem.island.scale = problem.solve.v_ref;
  RestoreTargets(&problem.island.problem);
  return problem;
}

double KineticMap(const qp::Island& island, const qp::Solution& solution, qp::Cone cone) {
  const qp::Problem& problem = island.problem;
  std::vector<double> dual = solution.velocities;  // p
  const bool bounces = !solution.bounce_multipliers.empty();
  for (int c = 0; bounces && c < problem.num_contacts(); ++c)
    qp::ApplyImpulse(problem, problem.contacts[c], {-solution.bounce_multipliers[c], 0, 0}, dual.data());
  double sum = 0;
  for (int c = 0; c < problem.num_contacts(); ++c) {
    const qp::ContactTerm& contact = problem.contacts[c];
    const double rho = 3 / qp::DelassusBlock(problem, contact).trace();
    const Vector3 j = solution.impulses[c];
    const Vector3 along = qp::ContactVelocity(contact, dual.data());
    const double above = qp::ContactVelocity(contact, solution.velocities.data())[0] - contact.target;
    const double gamma = bounces ? solution.bounce_multipliers[c] : 0;
    sum += ((j - ProjectOn(j - rho * along, contact.friction, cone)) / rho).squaredNorm();
    sum += std::pow((gamma - std::max(0.0, gamma - rho * above)) / rho, 2);
  }
  return std::sqrt(sum / std::max(1, problem.num_contacts())) / island.scale;
}

Exactness JudgeAnswer(const StudyProblem& problem, const SolveAnswer& answer, qp::Model model, qp::Cone cone) {
  const SolveVerdict verdict = Judge(problem.original, problem.solve, answer, model, cone);
  if (!verdict.finite) return {INFINITY, INFINITY, INFINITY};
  return {verdict.natural_map_rms, verdict.coulomb_map_rms, verdict.coulomb_map_max};
}

Exactness JudgeIsland(const StudyProblem& problem, const qp::Solution& solution, qp::Model model, qp::Cone cone) {
  if (solution.status == qp::Status::kFailed) return {INFINITY, INFINITY, INFINITY};
  const qp::Quality quality = qp::Judge(problem.island, solution);
  Exactness exactness{quality.rms, quality.rms, quality.max};
  if (model == qp::Model::kKinetic) {
    exactness.law = KineticMap(problem.island, solution, cone);
  } else if (model == qp::Model::kConvex || cone == qp::Cone::kOctagon) {
    SolveAnswer answer;
    const int n = problem.num_contacts();
    answer.r.resize(3 * n), answer.u.resize(3 * n), answer.v.resize(0);
    for (int c = 0; c < n; ++c) {
      const qp::ContactTerm& contact = problem.island.problem.contacts[c];
      answer.r.segment<3>(3 * c) = solution.impulses[c];
      answer.u.segment<3>(3 * c) =
          qp::ContactVelocity(contact, solution.velocities.data()) - contact.target * Vector3::UnitX();
    }
    answer.v = problem.solve.file.load;  // the map does not look at it
    exactness.law = Judge(problem.original, problem.solve, answer, model, cone).natural_map_rms;
  }
  return exactness;
}

}  // namespace islet::studies
