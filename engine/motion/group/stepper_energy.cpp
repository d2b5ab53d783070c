// In: a piece that was done. Out: who gained energy by it, and who may be pushed out of an overlap.
#include "engine/motion/group/stepper.h"

#include <algorithm>
#include <cmath>

#include "qp/smallness.h"

namespace islet::motion {
namespace {

constexpr double kLeft = 0.02;  // of the tolerance: velocities that solves leave, in what they may gain

Vector3 AngularMomentum(const Body& body, const Quaternion& rotation, const Vector3& w) {
  return rotation * Vector3(body.inertia_B * (rotation.conjugate() * w));
}

}  // namespace

// [J] of a body, its height counted from where the step began.
double Stepper::EnergyOf(int i, const State& s) const {
  const Body& b = group_->bodies[i];
  return 0.5 * b.mass * s.linear_W.squaredNorm() +
         0.5 * s.angular_W.dot(AngularMomentum(b, s.pose.rotation_WB, s.angular_W)) -
         (b.mass * settings_.gravity + b.force_W).dot(s.pose.position_W - b.position_W);
}

// What the piece gave to those who did something to each other, beyond the work of torques and of walls that move; what they had;
// and what they may gain: of that, what solves of this accuracy leave, and what heights are rounded by.
void Stepper::KeepAccounts(double h) {
  const std::vector<Body>& bodies = group_->bodies;
  accounts_.assign(bodies.size(), {});
  edges_.clear();
  for (size_t i = 0; i < bodies.size(); ++i) {
    const Body& b = bodies[i];
    if (!b.Moves()) continue;
    const State& s = state_[i];
    accounts_[i].gain = EnergyOf(static_cast<int>(i), end_state_[i]) - EnergyOf(static_cast<int>(i), s) -
                        0.5 * h * b.torque_W.dot(turned_[i].spin_W + spun_after_[i]);
    accounts_[i].at_hand = 0.5 * b.mass * (s.linear_W.squaredNorm() + floor_ * floor_) +
                           0.5 * s.angular_W.dot(AngularMomentum(b, s.pose.rotation_WB, s.angular_W));
    accounts_[i].allowed = kRefined * accounts_[i].at_hand + kUlp * b.mass * pull_ * s.pose.position_W.norm();
  }
  const auto act = [&](const Contact& contact, const Vector3& point, const Vector3& impulse, bool at_end) {
    if (impulse.isZero(0)) return;
    const int a = contact.body_a, b = contact.body_b, mover = bodies[a].Moves() ? a : b;
    accounts_[mover].allowed += kLeft * settings_.tolerance * floor_ * impulse.norm();
    for (const int i : {a, b}) {
      const Body& wall = bodies[i];
      if (wall.kind != BodyKind::kKinematic) continue;
      const double work = impulse.dot(at_end ? end_state_[i].VelocityAt(point) : MeanVelocity(i, point));
      accounts_[mover].gain += (i == b ? 1 : -1) * work;
      accounts_[mover].allowed += 10 * kUlp * std::abs(work);
    }
    accounts_[mover].gain += impulse.dot(SurfaceSlip(contact));  // what drives a belt works on what it carries
    edges_.emplace_back(a, b);
  };
  for (size_t c = 0; c < held_.size(); ++c) {
    act(held_[c], acted_at_[c], impulse_W_[c], false);
    const int a = held_[c].body_a, b = held_[c].body_b;
    if (!IsTurningWall(bodies[a]) && !IsTurningWall(bodies[b])) continue;
    const Vector3 &n = held_[c].normal_W, wall_slip = held_[c].surface_W - held_of_[c].belt_W;
    Account& account = accounts_[bodies[a].Moves() ? a : b];
    const double press = n.dot(impulse_W_[c]);
    account.gain += press * n.dot(wall_slip);  // friction's part is counted
    account.left += press * std::abs(n.dot(MeanVelocity(b, acted_at_[c]) - MeanVelocity(a, acted_at_[c]) + wall_slip));
  }
  FindWork();
  for (size_t p = 0; p < work_of_.size(); ++p) {  // what pushes an overlap out was paid before
    const GroupPair& pair = group_->pairs[p];
    if (PushOut(static_cast<int>(p)) > 0)
      accounts_[bodies[pair.a].Moves() ? pair.a : pair.b].allowed +=
          std::clamp(work_of_[p], 0.0, std::max(0.0, purse_[p]));
  }
  for (size_t e = 0; e < end_.size(); ++e) {
    act(end_[e], end_[e].point_W, settle_W_[e], true);
    act(end_[e], end_[e].point_W, strike_W_[e], true);
  }
  islands::BuildPartition({cut_, edges_}, &partition_);
  gains_ = creates_ = false;
  for (int island = 0; island < partition_.num_islands(); ++island) {
    Account sum;
    for (const int i : partition_.bodies_of(island)) {
      sum.gain += accounts_[i].gain;
      sum.at_hand += accounts_[i].at_hand;
      sum.allowed += accounts_[i].allowed;
      sum.left += accounts_[i].left;
    }
    const double most = Ledger::kMostEnergy * sum.at_hand;
    gains_ = gains_ || sum.gain > sum.allowed + std::min(sum.left, most);
    creates_ = creates_ || sum.gain > sum.allowed + most;
  }
}

// [J] per pair: work of what carried in the piece.
void Stepper::FindWork() {
  work_of_.assign(group_->pairs.size(), 0.0);
  for (size_t c = 0; c < held_.size(); ++c)
    work_of_[held_of_[c].pair] +=
        impulse_W_[c].dot(MeanVelocity(held_[c].body_b, acted_at_[c]) - MeanVelocity(held_[c].body_a, acted_at_[c]) +
                          SurfaceSlip(held_[c]));
}

// Which pairs took more in the step, by friction and where they sank, than a piece of this length would give them for their overlap.
// What one took another may have given: all that did something to each other in the step must have taken as much together.
void Stepper::SeeWhoPays(double h) {
  costs_.assign(group_->pairs.size(), 0.0);
  for (size_t c = 0; c < held_.size(); ++c) {
    const int pair = held_of_[c].pair;
    costs_[pair] -= held_[c].normal_W.dot(impulse_W_[c]) * kPushOut * GapBefore(pair) / h;
  }
  edges_.clear();
  problem_of_.clear();
  for (size_t p = 0; p < costs_.size(); ++p) {
    taken_[p] -= work_of_[p];
    if (taken_[p] == 0) continue;
    edges_.emplace_back(group_->pairs[p].a, group_->pairs[p].b);
    problem_of_.push_back(static_cast<int>(p));
  }
  pays_.assign(costs_.size(), false);
  if (edges_.empty()) return;
  islands::BuildPartition({cut_, edges_}, &partition_);
  for (int island = 0; island < partition_.num_islands(); ++island) {
    double taken = 0, costs = 0;
    for (const int e : partition_.contacts_of(island)) {
      const int p = problem_of_[e];
      taken += taken_[p];
      if (taken_[p] > costs_[p]) costs += costs_[p];
    }
    for (const int e : partition_.contacts_of(island)) {
      const int p = problem_of_[e];
      pays_[p] = taken_[p] > costs_[p] && taken > costs;
      purse_[p] = std::min(taken_[p], taken);
    }
  }
}

// Whether any overlap was pushed out.
bool Stepper::Pushed() const {
  for (size_t p = 0; p < pays_.size(); ++p)
    if (PushOut(static_cast<int>(p)) > 0) return true;
  return false;
}

}  // namespace islet::motion
