#include "qp/column.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Geometry>

namespace islet::qp {
namespace {

// Normal of the contact with the moments it has about both bodies, as the push on `side` b or a.
struct Push {
  Vector3 direction;
  Vector3 turn_a, turn_b;
};

Push PushOf(const ContactTerm& contact) {
  const bool of_b = contact.body_b >= 0;
  const Jacobian& shown = of_b ? contact.jacobian_b : contact.jacobian_a;
  return {(of_b ? 1 : -1) * shown.row(0).head<3>().transpose(), contact.jacobian_a.row(0).tail<3>().transpose(),
          contact.jacobian_b.row(0).tail<3>().transpose()};
}

bool OnWall(const ContactTerm& contact) { return contact.body_a < 0 || contact.body_b < 0; }

}  // namespace

bool Column::Solve(const Problem& problem, double velocity_scale, std::span<const double> velocities,
                   std::vector<Vector3>* impulses) {
  if (problem.contacts.empty() || !FindJoints(problem, kColumnTolerance * velocity_scale, velocities.data()) ||
      !FindChain())
    return false;
  Pool(problem);
  Load(problem);
  if (!TurnsNothing(problem)) return false;
  impulses->assign(problem.contacts.size(), Vector3::Zero());
  for (int c = 0; c < problem.num_contacts(); ++c) {
    const Joint& joint = joints_[upper_[c]];
    if (demands_[c] >= joint.demand - kColumnTolerance * velocity_scale)
      (*impulses)[c][0] = joint.impulse / joint.pressing;
  }
  return true;
}

// Up is away from the first wall that is found. False if a contact breaks the column by itself: a normal that is not parallel,
// another body below or above, a slide.
bool Column::FindJoints(const Problem& problem, double tolerance, const double* velocities) {
  const auto& contacts = problem.contacts;
  const auto wall = std::find_if(contacts.begin(), contacts.end(), OnWall);
  const ContactTerm& first = wall == contacts.end() ? contacts[0] : *wall;
  up_ = (first.body_b < 0 ? -1 : 1) * PushOf(first).direction;
  joints_.assign(problem.bodies.size(), {});
  upper_.resize(contacts.size());
  demands_.resize(contacts.size());
  for (int c = 0; c < problem.num_contacts(); ++c) {
    const ContactTerm& contact = contacts[c];
    const Push push = PushOf(contact);
    const double along = push.direction.dot(up_);
    if (!((push.direction - along * up_).norm() <= kColumnTolerance &&
          std::abs(std::abs(along) - 1) <= kColumnTolerance))
      return false;
    const Vector3 u = ContactVelocity(contact, velocities);
    if (contact.friction > 0 && !(u.tail<2>().norm() <= tolerance)) return false;
    const auto [below, above] =
        along > 0 ? std::pair(contact.body_a, contact.body_b) : std::pair(contact.body_b, contact.body_a);
    if (above < 0) return false;
    Joint& joint = joints_[above];
    if (joint.below == kNobody) {
      joint.below = below;
      joint.demand = -INFINITY;
      if (below >= 0 && joints_[below].above != kNobody) return false;
      if (below >= 0) joints_[below].above = above;
    } else if (joint.below != below) {
      return false;
    }
    upper_[c] = above;
    demands_[c] = contact.target - u[0];
    joint.demand = std::max(joint.demand, demands_[c]);
  }
  for (int c = 0; c < problem.num_contacts(); ++c) {
    Joint& joint = joints_[upper_[c]];
    if (demands_[c] < joint.demand - tolerance) continue;
    const Push push = PushOf(contacts[c]);
    const bool b_above = upper_[c] == contacts[c].body_b;
    ++joint.pressing;
    joint.levers.head<3>() += b_above ? push.turn_a : push.turn_b;
    joint.levers.tail<3>() += b_above ? push.turn_b : push.turn_a;
  }
  return true;
}

// From the one body that lies on a wall or on nothing upwards; false if that does not reach all.
bool Column::FindChain() {
  const auto lowest = [](const Joint& joint) { return joint.below < 0; };
  const auto bottom = std::find_if(joints_.begin(), joints_.end(), lowest);
  if (bottom == joints_.end()) return false;
  chain_.clear();
  for (int body = static_cast<int>(bottom - joints_.begin()); body != kNobody; body = joints_[body].above)
    chain_.push_back(body);
  return chain_.size() == joints_.size();
}

// What a body gains less the demands below it must not fall from the bottom up. A wall is a block that nothing moves.
void Column::Pool(const Problem& problem) {
  blocks_.clear();
  offsets_.clear();
  double offset = 0;
  for (int place = 0; place < static_cast<int>(chain_.size()); ++place) {
    const Joint& joint = joints_[chain_[place]];
    if (joint.below == kWall) blocks_.push_back({0, INFINITY, 0});
    if (joint.below != kNobody) offset += joint.demand;
    offsets_.push_back(offset);
    const double mass = problem.bodies[chain_[place]].mass;
    Block block{place, mass, -mass * offset};
    while (!blocks_.empty() && block.Speed() < blocks_.back().Speed()) {
      const Block& below = blocks_.back();
      block = {below.first, below.mass + block.mass, below.momentum + block.momentum};
      blocks_.pop_back();
    }
    blocks_.push_back(block);
  }
}

// Impulses of the joints, from the top of each block down: what is above gains what passes through. Between blocks nothing does.
void Column::Load(const Problem& problem) {
  int end = static_cast<int>(chain_.size());
  for (auto block = blocks_.rbegin(); block != blocks_.rend(); ++block) {
    const bool on_wall = std::isinf(block->mass);
    double impulse = 0;
    for (int place = end - 1; place >= block->first; --place) {
      Joint& joint = joints_[chain_[place]];
      impulse += problem.bodies[chain_[place]].mass * (block->Speed() + offsets_[place]);
      joint.impulse = place > block->first || on_wall ? std::max(0.0, impulse) : 0.0;
    }
    end = block->first;
  }
}

bool Column::TurnsNothing(const Problem& problem) const {
  const auto turns = [&](int body, const Vector3& lever, int pressing) {
    if (body < 0) return false;
    const BodyTerm& term = problem.bodies[body];
    return !(lever.norm() <= kColumnTolerance * pressing * std::sqrt(term.inertia.trace() / term.mass));
  };
  for (size_t i = 0; i < joints_.size(); ++i) {
    const Joint& joint = joints_[i];
    if (joint.impulse > 0 && (turns(joint.below, joint.levers.head<3>(), joint.pressing) ||
                              turns(static_cast<int>(i), joint.levers.tail<3>(), joint.pressing)))
      return false;
  }
  return true;
}

}  // namespace islet::qp
