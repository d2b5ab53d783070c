// Steps 2 and 3 on one island: problem, solve, certificate, scatter; and the one policy for problems that have no
// solution.                                                                                     [SM04 Sec. 4.1, 4.2]
//
//   collision  needed only if contacts still approach: bounces u_n >= -epsilon u_n^- ; restitution is lowered, for the
//              whole island and counted, while the problem has no solution or the answer holds more energy than before
//   static     after gravity; restitution 0; contacts that do not touch yet may approach at gap / dt
//   no solution (walls that close on a body), or one that squirts it out: the contacts of moving walls, and those that bounce or push,
//              made compliant, status kInfeasible
//   no finite answer: velocities stay as they were, status kFailed
//
//   threads: one responder per worker; writes only the island's own bodies and contacts
#pragma once

#include <cmath>
#include <span>
#include <vector>

#include "engine/problem_record.h"
#include "engine/response/certificate.h"
#include "engine/response/island_problem.h"
#include "engine/settings.h"
#include "engine/step_report.h"
#include "qp/cascade/island_solver.h"

namespace islet {

struct IslandView {
  std::span<const int> bodies;  // of the world, ascending
  std::span<const int> contacts;
};

struct ResponseOutcome {
  QpStatus status = QpStatus::kNone;
  int iterations = 0;
  bool restitution_lowered = false;
  double seconds = 0;                  // [s] wall
  qp::Rung rung = qp::Rung::kNothing;  // that the answer came from
  int contacts = 0;                    // of the problem
  Certificate certificate;
  double map = 0;  // natural map of the law, rms, over v_ref
  void AddTo(QpSummary* summary, LadderReport* ladder) const;
  void AddTo(Stage stage, IslandReport* island) const;
};

class IslandResponder {
 public:
  // How exact an island that moves has to be: see qp::Settings::speed_share.
  void SetSpeedShare(double share) { speed_share_ = share; }
  // speed_floor: [m/s] least v_ref, > 0; threshold: [m/s] contacts that approach slower do not collide; time: [s] in which what is open
  // may close.
  // impulses: [N s] per contact of the world, (n, t1, t2); the island's are overwritten. What is found there is
  // taken for a guess.
  ResponseOutcome ResolveCollisions(const IslandView& island, const ContactFrames& contacts, const Settings& settings,
                                    double speed_floor, double threshold, std::span<Body> bodies,
                                    std::span<Vector3> impulses, double time = INFINITY);
  ResponseOutcome ResolveStatic(const IslandView& island, const ContactFrames& contacts, const Settings& settings,
                                double speed_floor, double dt, std::span<Body> bodies, std::span<Vector3> impulses);
  // The contact problem with given least normal velocities [m/s], one per contact of the world.
  ResponseOutcome ResolveTargets(const IslandView& island, const ContactFrames& contacts,
                                 std::span<const double> targets, const Settings& settings, double speed_floor,
                                 std::span<Body> bodies, std::span<Vector3> impulses);
  // [m/s] per contact of the island: what it gave way by, where the last answer is kInfeasible.
  std::span<const double> given() const { return given_; }
  // Problem and answer of the last call that solved one.
  const qp::Problem& problem() const { return problem_; }
  const qp::Solution& solution() const { return solution_; }

 private:
  void Solve(const Settings& settings, double v_ref, ResponseOutcome* outcome);
  void SolveOnce(const qp::Settings& settings, ResponseOutcome* outcome);
  void AcceptOrComply(const qp::Settings& settings, ResponseOutcome* outcome);
  static bool IsDriven(const qp::ContactTerm& contact);
  bool IsSquirt(double most_driven) const;
  bool LowerRestitution(int attempt);
  void KeepMomentum(const ResponseOutcome& outcome);
  void TakeGuess(const IslandView& island, std::span<Vector3> impulses, ResponseOutcome* outcome);
  void Finish(const IslandView& island, const Settings& settings, double v_ref, std::span<Body> bodies,
              std::span<Vector3> impulses, ResponseOutcome* outcome);

  qp::Settings SolverSettings(const Settings& settings, double v_ref) const;

  double speed_share_ = 0;
  IslandGatherer gatherer_;
  qp::Problem problem_;
  qp::Solution solution_;
  qp::IslandSolver solver_;
  std::vector<double> free_;    // contact velocities before
  std::vector<int> touching_;   // contacts of the collision problem
  std::vector<double> given_;   // per contact of the problem
  std::vector<Vector3> guess_;  // impulses found there, per contact of the problem
};

}  // namespace islet
