#include "engine/response/response.h"

#include <algorithm>
#include <cmath>

#include "engine/slice.h"
#include "engine/stopwatch.h"
#include "qp/body_algebra.h"

namespace islet {
namespace {

constexpr int kLoweringAttempts = 3;  // of restitution, before it vanishes
constexpr double kBlameShare = 0.02;  // of the largest multiplier times bounce: contacts above it lose their bounce
constexpr double kCompliances[] = {
    1e-4, 0.1};  // of the contact's own W_nn: of what gives way, and where that squirts out what is beside
constexpr double kMostDriven = 5;  // times the speeds that drive an island: what walls may give it

// [m/s] normal velocities before the impulses; returns the fastest approach (>= 0).
double ApproachVelocities(const qp::Problem& problem, std::vector<double>* velocities) {
  velocities->clear();
  double fastest = 0;
  const auto row = [&](const qp::Jacobian& jacobian, int body) {
    return jacobian.row(0).dot(problem.bodies[body].velocity);
  };
  for (const qp::ContactTerm& c : problem.contacts) {
    double u = c.drift[0];
    if (c.body_a >= 0) u += row(c.jacobian_a, c.body_a);
    if (c.body_b >= 0) u += row(c.jacobian_b, c.body_b);
    velocities->push_back(u);
    fastest = std::max(fastest, -u);
  }
  return fastest;
}

bool Usable(qp::Status status) { return status == qp::Status::kSolved || status == qp::Status::kInaccurate; }

bool AnyDrift(const qp::Problem& problem) {
  return std::any_of(problem.contacts.begin(), problem.contacts.end(),
                     [](const qp::ContactTerm& c) { return !c.drift.isZero(0); });
}

// Nothing holds these bodies and nothing but gravity pulls at them, at all alike: there is no load.
bool FallsFreely(const IslandView& island, const ContactFrames& contacts, std::span<const Body> bodies) {
  return std::all_of(island.bodies.begin(), island.bodies.end(),
                     [&](int i) { return bodies[i].force_W.isZero(0) && bodies[i].torque_W.isZero(0); }) &&
         std::all_of(island.contacts.begin(), island.contacts.end(), [&](int c) {
           return bodies[contacts.contacts[c].body_a].Moves() && bodies[contacts.contacts[c].body_b].Moves();
         });
}

void Tell(const char* name, const IslandView& island, const Stopwatch& watch, ResponseOutcome* outcome) {
  outcome->seconds = watch.seconds();
  TellSlice({name, watch.begin(), watch.begin() + outcome->seconds, island.bodies.empty() ? -1 : island.bodies[0],
             outcome->contacts});
}

}  // namespace

qp::Settings IslandResponder::SolverSettings(const Settings& settings, double v_ref) const {
  qp::Settings out;
  out.model = settings.model;
  out.cone = settings.cone;
  out.effort = settings.effort;
  out.ladder = settings.ladder;
  out.tolerance = settings.tolerance;
  out.speed_share = speed_share_;
  out.velocity_scale = v_ref;
  return out;
}

void ResponseOutcome::AddTo(QpSummary* summary, LadderReport* ladder) const {
  summary->seconds += seconds;
  if (contacts == 0) return;
  ladder->Add(rung, 1, contacts, seconds);
  if (status == QpStatus::kNone) return;
  ++summary->solved;
  summary->failed += status == QpStatus::kInfeasible || status == QpStatus::kFailed;
  summary->missed += status == QpStatus::kInaccurate;
  summary->worst_map = Worse(summary->worst_map, map);
  summary->iterations += iterations;
  summary->iterations_max = std::max(summary->iterations_max, iterations);
}

void ResponseOutcome::AddTo(Stage stage, IslandReport* island) const {
  const bool collides = stage == Stage::kCollision;
  QpStatus& worst = collides ? island->collision_status : island->static_status;
  worst = std::max(worst, status);
  (collides ? island->collision_iterations : island->static_iterations) += iterations;
  island->map = Worse(island->map, map);
  island->certificate.Include(certificate);
}

// Where bounces contradict each other (a jam), those that the multipliers blame are given up; where they add energy, all are
// halved; with the last attempt all vanish. False if there was nothing left to lower.
bool IslandResponder::LowerRestitution(int attempt) {
  const bool blame =
      solution_.status == qp::Status::kInfeasible && solution_.impulses.size() == problem_.contacts.size();
  const auto fault = [&](size_t c) {  // what may still close bounces by nothing
    return std::max(0.0, problem_.contacts[c].target) * (blame ? solution_.impulses[c][0] : 1);
  };
  double worst = 0;
  for (size_t c = 0; c < problem_.contacts.size(); ++c) worst = std::max(worst, fault(c));
  if (worst == 0) return false;
  for (size_t c = 0; c < problem_.contacts.size(); ++c) {
    double& target = problem_.contacts[c].target;
    if (target <= 0) continue;
    if (attempt >= kLoweringAttempts || (blame && fault(c) >= kBlameShare * worst))
      target = 0;
    else if (!blame)
      target /= 2;
  }
  return true;
}

void IslandResponder::Solve(const Settings& settings, double v_ref, ResponseOutcome* outcome) {
  qp::Settings solver_settings = SolverSettings(settings, v_ref);
  const bool may_gain = AnyDrift(problem_);  // moving walls do work
  const double energy_before = qp::KineticEnergy(problem_, nullptr);
  const bool bounces =
      std::any_of(problem_.contacts.begin(), problem_.contacts.end(), [](const auto& c) { return c.target > 0; });
  if (bounces && !may_gain) solver_settings.energy_limit = energy_before;
  const auto good = [&] {
    // On the brink of a jam the interior point stalls, and exact friction has answers without bound, or none: less bounce is better than a bad
    // answer. Large islands are inexact anyway.
    const bool stalled = bounces && (settings.model != Model::kCoulomb ? solution_.rung == qp::Rung::kInteriorPoint
                                                                       : qp::IsSmall(problem_));
    const bool accepted = solution_.status == qp::Status::kSolved || (!stalled && Usable(solution_.status));
    return accepted && (may_gain || qp::KineticEnergy(problem_, solution_.velocities.data()) <=
                                        energy_before * (1 + settings.tolerance));
  };
  SolveOnce(solver_settings, outcome);
  for (int attempt = 0; !good() && LowerRestitution(attempt); ++attempt) {
    outcome->restitution_lowered = true;
    SolveOnce(solver_settings, outcome);
  }
  AcceptOrComply(solver_settings, outcome);
}

void IslandResponder::SolveOnce(const qp::Settings& settings, ResponseOutcome* outcome) {
  solver_.Solve(problem_, settings, &solution_, guess_);
  outcome->iterations += solution_.iterations;
  outcome->rung = solution_.rung;
}

// Without moving walls, bounces and pushes all bodies could stand still: where a problem has no solution, these are to blame.
bool IslandResponder::IsDriven(const qp::ContactTerm& contact) {
  return contact.target > 0 || !contact.drift.isZero(0);
}

// What is squirted out between closing walls obeys the law, but for walls of no strength that there is: they would give the island more
// energy than all of it has at a few times the speeds that drive it.
bool IslandResponder::IsSquirt(double most_driven) const {
  if (!AnyDrift(problem_)) return false;
  double driven = 0, mass = 0;
  for (const qp::ContactTerm& c : problem_.contacts) driven = std::max({driven, c.target, c.drift.norm()});
  for (const qp::BodyTerm& body : problem_.bodies) mass += body.mass;
  const double most = 0.5 * mass * most_driven * most_driven * driven * driven;
  return qp::KineticEnergy(problem_, solution_.velocities.data()) > qp::KineticEnergy(problem_, nullptr) + most;
}

// The status of what was solved; where it is no answer, what drives gives way.
void IslandResponder::AcceptOrComply(const qp::Settings& settings, ResponseOutcome* outcome) {
  outcome->status = solution_.status == qp::Status::kSolved ? QpStatus::kSolved : QpStatus::kInaccurate;
  given_.assign(problem_.contacts.size(), 0.0);
  if (Usable(solution_.status) && !IsSquirt(kMostDriven)) return;
  const bool driven = std::any_of(problem_.contacts.begin(), problem_.contacts.end(), IsDriven);
  for (const double compliance : kCompliances) {
    for (qp::ContactTerm& c : problem_.contacts)
      if (!driven || IsDriven(c)) c.compliance = compliance * qp::DelassusBlock(problem_, c)(0, 0);
    guess_.clear();
    SolveOnce(settings, outcome);
    if (Usable(solution_.status) && !IsSquirt(1)) break;  // what gives way throws nobody faster than it comes
  }
  outcome->status = Usable(solution_.status) ? QpStatus::kInfeasible : QpStatus::kFailed;
  for (qp::ContactTerm& c : problem_.contacts) c.compliance = 0;  // the certificate judges the rigid problem
  for (size_t c = 0; c < given_.size(); ++c) {
    const qp::ContactTerm& contact = problem_.contacts[c];
    given_[c] = std::max(0.0, contact.target - qp::ContactVelocity(contact, solution_.velocities.data())[0]);
  }
}

// Velocities from the impulses, whatever the solver's own: momentum and angular momentum to rounding.
void IslandResponder::KeepMomentum(const ResponseOutcome& outcome) {
  if (outcome.status == QpStatus::kFailed || solution_.impulses.size() != problem_.contacts.size()) return;
  qp::VelocitiesAfter(problem_, solution_.impulses, &solution_.velocities);
}

// What is found in the impulses is the guess; they are left zero.
void IslandResponder::TakeGuess(const IslandView& island, std::span<Vector3> impulses, ResponseOutcome* outcome) {
  outcome->contacts = static_cast<int>(island.contacts.size());
  guess_.clear();
  for (const int contact : island.contacts) {
    guess_.push_back(impulses[contact]);
    impulses[contact].setZero();
  }
}

void IslandResponder::Finish(const IslandView& island, const Settings& settings, double v_ref, std::span<Body> bodies,
                             std::span<Vector3> impulses, ResponseOutcome* outcome) {
  if (outcome->status == QpStatus::kFailed) {
    for (const int contact : island.contacts) impulses[contact].setZero();
    return;
  }
  outcome->certificate = Certify(problem_, solution_, settings.model, settings.cone, v_ref);
  // The slips of an answer may make way for an approach: of the exact law its own map tells.
  const bool exact = settings.model == Model::kCoulomb && settings.cone == Cone::kCircular;
  outcome->map = (exact ? outcome->certificate.coulomb_map_rms : outcome->certificate.natural_map_rms) / v_ref;
  IslandGatherer::ScatterVelocities(solution_, island.bodies, bodies);
  for (size_t c = 0; c < island.contacts.size(); ++c) impulses[island.contacts[c]] = solution_.impulses[c];
}

ResponseOutcome IslandResponder::ResolveCollisions(const IslandView& island, const ContactFrames& contacts,
                                                   const Settings& settings, double speed_floor, double threshold,
                                                   std::span<Body> bodies, std::span<Vector3> impulses, double time) {
  ResponseOutcome outcome;
  touching_.clear();
  guess_.clear();
  for (const int contact : island.contacts) {
    if (contacts.contacts[contact].touches) {
      touching_.push_back(contact);
      guess_.push_back(impulses[contact]);
    }
    impulses[contact].setZero();
  }
  outcome.contacts = static_cast<int>(touching_.size());
  const auto approaches = [&](int number) {
    const Contact& c = contacts.contacts[number];
    return NormalVelocity(c, bodies[c.body_a], bodies[c.body_b]) < -threshold;
  };
  // (The convex models would rub here, too.)
  const bool looks = settings.ladder.Has(qp::Rung::kNothing) || settings.model != Model::kCoulomb;
  if (touching_.empty() || (looks && std::none_of(touching_.begin(), touching_.end(), approaches))) return outcome;
  const Stopwatch watch;
  const IslandView touching{island.bodies, touching_};
  gatherer_.Gather(bodies, contacts, touching.bodies, touching.contacts, &problem_);
  const double v_ref = std::max(speed_floor, ApproachVelocities(problem_, &free_));
  for (size_t c = 0; c < touching.contacts.size(); ++c) {
    const Contact& contact = contacts.contacts[touching.contacts[c]];
    double& target = problem_.contacts[c].target;
    if (free_[c] < -threshold) target = ReboundSpeed(contact, -free_[c]);
    if (target == 0) target = -ClosingSpeed(contact, time);
  }
  Solve(settings, v_ref, &outcome);
  KeepMomentum(outcome);
  Tell("collision_qp", touching, watch, &outcome);
  Finish(touching, settings, v_ref, bodies, impulses, &outcome);
  return outcome;
}

ResponseOutcome IslandResponder::ResolveStatic(const IslandView& island, const ContactFrames& contacts,
                                               const Settings& settings, double speed_floor, double dt,
                                               std::span<Body> bodies, std::span<Vector3> impulses) {
  ResponseOutcome outcome;
  TakeGuess(island, impulses, &outcome);
  if (island.contacts.empty()) return outcome;
  const Stopwatch watch;
  gatherer_.Gather(bodies, contacts, island.bodies, island.contacts, &problem_);
  ApproachVelocities(problem_, &free_);
  double fastest = 0;
  for (size_t c = 0; c < island.contacts.size(); ++c) {
    const Contact& contact = contacts.contacts[island.contacts[c]];
    if (!contact.touches) problem_.contacts[c].target = -contact.gap / dt;
    fastest = std::max(fastest, problem_.contacts[c].target - free_[c]);
  }
  // Nothing approaches: no impulse is the exact Coulomb answer. (With friction the convex models would still rub.)
  const double v_ref = std::max(speed_floor, fastest);
  const bool rubs = settings.model != Model::kCoulomb && std::any_of(problem_.contacts.begin(), problem_.contacts.end(),
                                                                     [](const auto& c) { return c.friction > 0; });
  const bool looks = settings.ladder.Has(qp::Rung::kNothing);
  if (looks && fastest <= 1e-12 * v_ref && !rubs) return outcome;
  // What still approaches without a load is what the collision problem's tolerance left. (Without gravity the floor is a thousandth of
  // the fastest approach.)
  const double left = (settings.gravity.isZero(0) ? 1e3 : 10) * settings.tolerance * speed_floor;
  const bool free = !rubs && FallsFreely(island, contacts, bodies);
  if (looks && free && fastest <= left) return outcome;
  Solve(settings, v_ref, &outcome);
  if (free) KeepMomentum(outcome);
  Tell("static_qp", island, watch, &outcome);
  Finish(island, settings, v_ref, bodies, impulses, &outcome);
  return outcome;
}

ResponseOutcome IslandResponder::ResolveTargets(const IslandView& island, const ContactFrames& contacts,
                                                std::span<const double> targets, const Settings& settings,
                                                double speed_floor, std::span<Body> bodies,
                                                std::span<Vector3> impulses) {
  ResponseOutcome outcome;
  TakeGuess(island, impulses, &outcome);
  if (island.contacts.empty()) return outcome;
  const Stopwatch watch;
  gatherer_.Gather(bodies, contacts, island.bodies, island.contacts, &problem_);
  ApproachVelocities(problem_, &free_);
  double fastest = 0;
  for (size_t c = 0; c < island.contacts.size(); ++c) {
    problem_.contacts[c].target = targets[island.contacts[c]];
    fastest = std::max(fastest, problem_.contacts[c].target - free_[c]);
  }
  const double v_ref = std::max(speed_floor, fastest);
  if (settings.model == Model::kCoulomb && fastest <= 1e-12 * v_ref) return outcome;
  const qp::Settings solver_settings = SolverSettings(settings, v_ref);
  SolveOnce(solver_settings, &outcome);
  AcceptOrComply(solver_settings, &outcome);
  KeepMomentum(outcome);
  Tell("static_qp", island, watch, &outcome);
  Finish(island, settings, v_ref, bodies, impulses, &outcome);
  return outcome;
}

}  // namespace islet
