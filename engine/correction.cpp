#include "engine/correction.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "engine/stopwatch.h"
#include "engine/suite_frame.h"
#include "qp/body_algebra.h"

namespace islet {
namespace {

constexpr int kSweeps = 500;
// Of the deepest overlap: tolerance of small islands, and the least change of a sweep in heaps. What a correction leaves tilts a tower,
// and tilts grow: with 1e-3 for all islands stacks of 10, 20 and 30 cubes that were dropped came to rest after 56, 170 and 160 frames on
// average, and five of eight of 100 cubes fell; by what is fine after 31, 28 and 34, and none. In a heap the next pass sees to the rest;
// 1e-6 takes six times as long there (cubeglass), 1e-2 halves the time of the motion, but what opens too far stays open (1.4 mm between
// cubes that met 0.14 m deep), and three frames of 120 keep overlaps of up to 0.01 m.
constexpr double kFine = 1e-8, kCoarse = 1e-3;
constexpr double kColumnMap = 1e-9;  // of the same: natural map of a column's correction
constexpr int kFewBodies = 50;        // up to them, if some lie on faces, all is to be fine

// Times the deepest overlap of its island: no correction of a pass moves a point farther against what its body touches, nor
// farther at all than that or than the longest way that a body of the island goes freely in the step. Between surfaces that are
// nearly parallel the linear problem sees its way out far away: of 9,800 corrections in cubeglass, cubejam and sphereglass all
// stayed below 4.1 times but one, which threw a cube by 1.3 m for 1.2 mm; another one took a cube at rest through a wall. (The
// ends of a row of 300 that all close in have far to go back, each with its neighbours: 20 times the overlap stopped them.)
constexpr double kFarthest = 20;
constexpr double kMassRatio = 100;

// Light bodies count for at least a hundredth of the heaviest, where something immovable takes up what that moves: else a light
// box between heavy ones is what gives way, and by mass goes a hundred times as far (1:10,000: 21 m, in a room of 3 m).
void LevelMasses(qp::Problem* problem) {
  const bool held = std::any_of(problem->contacts.begin(), problem->contacts.end(),
                                [](const qp::ContactTerm& c) { return c.body_a < 0 || c.body_b < 0; });
  if (!held) return;
  double most = 0;
  for (const qp::BodyTerm& body : problem->bodies) most = std::max(most, body.mass);
  for (qp::BodyTerm& body : problem->bodies) {
    const double factor = most / (kMassRatio * body.mass);
    if (!(factor > 1)) continue;
    body.mass *= factor;
    body.inertia *= factor;
    body.inverse_inertia /= factor;
  }
}

// Whether two bodies lie on a face, with three contacts at least. Their contacts are neighbours.
bool HasFace(const qp::Problem& problem) {
  const std::vector<qp::ContactTerm>& contacts = problem.contacts;
  for (size_t c = 2; c < contacts.size(); ++c)
    if (contacts[c].body_a == contacts[c - 2].body_a && contacts[c].body_b == contacts[c - 2].body_b) return true;
  return false;
}

Twist DisplacementOf(const qp::Solution& solution, size_t member) {
  const double* d = &solution.velocities[6 * member];
  return {{d[0], d[1], d[2]}, {d[3], d[4], d[5]}};
}

}  // namespace

// The change of the planned displacements, from rest, that opens all predicted gaps. (The planned displacements themselves as v0
// would drown a millimetre in a metre of flight.)
bool Corrector::Solve(const IslandToCorrect& island, std::span<const Body> bodies) {
  gatherer_.Gather(bodies, island.near, island.bodies, island.contacts, &problem_);
  LevelMasses(&problem_);
  for (qp::BodyTerm& body : problem_.bodies) {
    body.velocity.setZero();
    body.inertia *= kTurnWeight;
    body.inverse_inertia /= kTurnWeight;
  }
  for (size_t k = 0; k < island.contacts.size(); ++k) {
    problem_.contacts[k].friction = 0;
    problem_.contacts[k].drift = Vector3(island.gaps[island.contacts[k]], 0, 0);
  }
  if (!SolveProblem(island.scale)) return false;
  share_ = Share(island, bodies);
  return true;
}

Displacement Corrector::CorrectionOf(size_t member) const {
  const Twist displacement = DisplacementOf(solution_, member);
  return {share_ * displacement.linear_W, share_ * displacement.angular_W};
}

LadderReport Corrector::TakeReport() { return std::exchange(report_, {}); }

// How much of the correction is made: all of it, unless it goes too far.
double Corrector::Share(const IslandToCorrect& island, std::span<const Body> bodies) const {
  double deepest = 0, against = 0, farthest = 0, longest = 0;  // [m]
  for (size_t k = 0; k < island.contacts.size(); ++k) {
    deepest = std::max(deepest, -island.gaps[island.contacts[k]]);
    Vector3 shift = Vector3::Zero();
    double turn = 0;
    const auto add = [&](int local, double sign) {
      if (local < 0) return;
      const Twist displacement = DisplacementOf(solution_, local);
      shift += sign * displacement.linear_W;
      turn = std::max(turn, bodies[island.bodies[local]].radius * displacement.angular_W.norm());
    };
    add(problem_.contacts[k].body_a, -1);
    add(problem_.contacts[k].body_b, 1);
    against = std::max(against, shift.norm() + turn);
  }
  for (size_t i = 0; i < island.bodies.size(); ++i) {
    const int body = island.bodies[i];
    farthest = std::max(farthest, FastestPoint(DisplacementOf(solution_, i), bodies[body].radius));
    longest = std::max(longest, island.free_way[body]);
  }
  if (deepest == 0) return 0;
  const double most = kFarthest * deepest;
  return std::min({1.0, most / against, std::max(most, longest) / farthest});
}

// What stands on each other moves along its line: sweeps would leave a tilt. Small islands on faces are answered as exactly as contact
// problems are; heaps are swept, and what that leaves the next pass sees to.
bool Corrector::SolveProblem(double scale) {
  const double begin = Seconds();
  qp::Rung rung = qp::Rung::kColumn;
  if (!(ladder_.Has(rung) && SolveColumn(scale))) {
    const bool fine = problem_.num_bodies() <= kFewBodies && HasFace(problem_);
    if (fine || !ladder_.Has(qp::Rung::kSweeps)) {
      if (!SolveFine(scale, &rung)) return false;
    } else {
      Sweep(scale);
      rung = qp::Rung::kSweeps;
    }
  }
  report_.Add(rung, 1, problem_.num_contacts(), Seconds() - begin);
  return std::ranges::all_of(solution_.velocities, [](double d) { return std::isfinite(d); });
}

// Over thousands of bodies, or mass ratios of thousands, sums lose digits: what is not fine then goes the other ways.
bool Corrector::SolveColumn(double scale) {
  solution_.velocities.assign(6 * problem_.bodies.size(), 0.0);
  if (!column_.Solve(problem_, qp::kColumnTolerance * scale, solution_.velocities, &solution_.impulses)) return false;
  solution_.slips.assign(problem_.contacts.size(), 0.0);
  qp::VelocitiesAfter(problem_, solution_.impulses, &solution_.velocities);
  qp::ImpulseScales(problem_, &scales_);
  return qp::CoulombMap(problem_, solution_.velocities, solution_.impulses, scales_).max <= kColumnMap * scale;
}

// False where there is no way out for all.
bool Corrector::SolveFine(double scale, qp::Rung* rung) {
  const double begin = Seconds();
  qp::Settings settings;
  settings.model = qp::Model::kConvex;
  settings.ladder = ladder_.Without(qp::Rung::kColumn);  // has been asked
  settings.velocity_scale = scale;
  settings.tolerance = kFine;
  solver_.Solve(problem_, settings, &solution_);
  report_.in_vain.Include(solution_.in_vain);
  *rung = solution_.rung;
  if (solution_.status == qp::Status::kSolved || solution_.status == qp::Status::kInaccurate) return true;
  report_.in_vain.Add(*rung, Seconds() - begin);
  return false;
}

void Corrector::Sweep(double scale) {
  solution_.slips.assign(problem_.contacts.size(), 0.0);
  solution_.velocities.assign(6 * problem_.bodies.size(), 0.0);
  solution_.impulses.assign(problem_.contacts.size(), Vector3::Zero());
  sweeps_.Prepare(problem_);
  sweeps_.Sweep(problem_, kSweeps, kCoarse * scale, &solution_.impulses, &solution_.velocities, qp::Pace::kMomentum);
}

}  // namespace islet
