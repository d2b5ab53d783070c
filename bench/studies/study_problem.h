// An island problem that islet exported, or one of others in the same format, ready for every solver of the profiles; and how
// exact an answer is under each law, by code that no solver shares.
//
//   convex, coulomb   scenes/solve_judge (both cones), and for exact Coulomb on rigid bodies bench/answer_quality
//   kinetic           here: natural map of both multipliers, see KineticMap
//   all are rms over the contacts, over v_ref, the fastest approach before the impulses
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "bench/problem_files.h"
#include "bench/studies/general_problem.h"
#include "qp/settings.h"
#include "scenes/solve_problem.h"

namespace islet::studies {

struct StudyProblem {
  std::string name, family;  // file and folder
  FclibProblem original;
  SolveProblem solve;
  GeneralProblem general;
  qp::Island island;  // rigid bodies only: the bounces are targets again, so that the kinetic model means the same
  bool rigid = false;

  int num_contacts() const { return solve.file.num_contacts(); }
};

StudyProblem ReadStudyProblem(const std::filesystem::path& file);

struct Exactness {
  double law = 0;                       // natural map of the law that was asked for
  double coulomb = 0, coulomb_max = 0;  // of exact Coulomb on the circular cone
};
Exactness JudgeAnswer(const StudyProblem& problem, const SolveAnswer& answer, qp::Model model, qp::Cone cone);
// solution: of problem.island.
Exactness JudgeIsland(const StudyProblem& problem, const qp::Solution& solution, qp::Model model, qp::Cone cone);

// The kinetic model's optimality, with p = v - M^-1 N^T gamma: K holds j, perpendicular to J p in K*; 0 <= gamma, perpendicular
// to u_n - b >= 0. Root mean square over contacts of |j - P_K(j - rho J p)| / rho and |gamma - max(0, gamma - rho (u_n - b))| / rho,
// rho = 3 / tr W_cc, over v_ref. gamma empty: zero.
double KineticMap(const qp::Island& island, const qp::Solution& solution, qp::Cone cone);

// The distance-nearest point of the cone; the octagon's edges are at odd multiples of pi / 8.
qp::Vector3 ProjectOn(const qp::Vector3& x, double mu, qp::Cone cone);

}  // namespace islet::studies
