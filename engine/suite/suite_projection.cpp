#include "engine/suite/suite_projection.h"

#include <algorithm>

#include "engine/response/suite_frame.h"
#include "qp/smallness.h"

namespace islet {
namespace {

constexpr double kGiving = 0.1;  // of the displacement that a push makes at its own contact

}  // namespace

double SuiteProjection::Project(std::span<const Body> bodies, std::span<const Contact> contacts,
                                const Settings& settings, parallel::WorkerPool* pool) {
  at_rest_.assign(bodies.begin(), bodies.end());
  cut_.resize(bodies.size());
  for (size_t i = 0; i < bodies.size(); ++i) {
    SetTwist({}, &at_rest_[i]);
    cut_[i] = !bodies[i].Moves();
  }
  smooth_.assign(contacts.begin(), contacts.end());
  frames_.clear();
  pairs_.clear();
  for (Contact& c : smooth_) {
    c.friction = c.restitution = 0;
    frames_.push_back(ContactFrame(c.normal_W));
    pairs_.emplace_back(c.body_a, c.body_b);
  }
  islands::BuildPartition({cut_, pairs_}, &partition_);
  displacements_.assign(bodies.size(), {});
  workers_.resize(std::max(workers_.size(), static_cast<size_t>(pool->num_workers())));
  for (Worker& worker : workers_) worker.left = 0;
  costs_.resize(partition_.num_islands());
  for (int i = 0; i < partition_.num_islands(); ++i)
    costs_[i] = 1.0 + partition_.contact_start[i + 1] - partition_.contact_start[i];
  pool->ForEachByCost(costs_, kBatchCost, &schedule_,
                      [&](int island, int worker) { ProjectIsland(island, settings, &workers_[worker]); });
  double left = 0;
  for (const Worker& worker : workers_) left = std::max(left, worker.left);
  for (const Contact& c : smooth_)
    if (cut_[c.body_a] && cut_[c.body_b]) left = std::max(left, -c.gap);  // nobody moves there
  return left;
}

void SuiteProjection::ProjectIsland(int island, const Settings& settings, Worker* w) {
  const int first = partition_.contact_start[island], last = partition_.contact_start[island + 1];
  w->contacts.assign(partition_.contacts.begin() + first, partition_.contacts.begin() + last);
  double deepest = 0;
  for (const int c : w->contacts) {
    const double size = std::max(at_rest_[smooth_[c].body_a].Moves() ? at_rest_[smooth_[c].body_a].radius : 0.0,
                                 at_rest_[smooth_[c].body_b].Moves() ? at_rest_[smooth_[c].body_b].radius : 0.0);
    if (-smooth_[c].gap > kNegligible * size) deepest = std::max(deepest, -smooth_[c].gap);
  }
  if (deepest == 0) return;
  const std::span<const int> members = partition_.bodies_of(island);
  w->gatherer.Gather(at_rest_, {smooth_, frames_}, members, w->contacts, &w->problem);
  for (size_t k = 0; k < w->contacts.size(); ++k) w->problem.contacts[k].target = -smooth_[w->contacts[k]].gap;
  qp::Settings solver;
  solver.model = qp::Model::kConvex;
  solver.cone = qp::Cone::kCircular;
  solver.tolerance = settings.tolerance;
  solver.velocity_scale = deepest;
  const auto usable_answer = [&] {
    w->solver.Solve(w->problem, solver, &w->solution);
    return w->solution.status == qp::Status::kSolved || w->solution.status == qp::Status::kInaccurate;
  };
  bool usable = usable_answer();
  if (!usable) {  // no room for all: every contact gives way by a share of what pushes it
    for (qp::ContactTerm& c : w->problem.contacts) c.compliance = kGiving * qp::DelassusTrace(w->problem, c) / 3;
    usable = usable_answer();
  }
  for (size_t k = 0; k < w->contacts.size(); ++k) {
    const double moved = usable ? qp::ContactVelocity(w->problem.contacts[k], w->solution.velocities.data())[0] : 0;
    w->left = std::max(w->left, -(smooth_[w->contacts[k]].gap + moved));
  }
  if (!usable) return;
  for (size_t k = 0; k < members.size(); ++k) {
    const double* v = w->solution.velocities.data() + 6 * k;
    displacements_[members[k]] = {{v[0], v[1], v[2]}, {v[3], v[4], v[5]}};
  }
}

}  // namespace islet
