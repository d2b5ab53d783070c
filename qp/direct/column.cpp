#include "qp/direct/column.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Geometry>

#include "qp/body_algebra.h"
#include "qp/smallness.h"

namespace islet::qp {
namespace {

// Away from the first wall that is found.
Vector3 Upwards(const std::vector<ContactTerm>& contacts) {
  const auto on_wall = [](const ContactTerm& c) { return c.body_a < 0 || c.body_b < 0; };
  const auto wall = std::find_if(contacts.begin(), contacts.end(), on_wall);
  const ContactTerm& first = wall == contacts.end() ? contacts[0] : *wall;
  return (first.body_b < 0 ? -1 : 1) * NormalRow(first).head<3>();
}

// x of S x = y with the least residual, of those the shortest; S is symmetric and positive semidefinite.
Eigen::Vector2d SolveSpread(const Eigen::Matrix2d& s, const Eigen::Vector2d& y) {
  const double trace = s.trace();
  if (trace == 0) return Eigen::Vector2d::Zero();
  if (s.determinant() > kNegligible * trace * trace) return s.inverse() * y;
  return s * y / (trace * trace);
}

}  // namespace

bool Column::Solve(const Problem& problem, double tolerance, std::span<const double> velocities,
                   std::vector<Vector3>* impulses) {
  tolerance_ = tolerance;
  if (problem.contacts.empty() || !FindJoints(problem, velocities.data()) || !FindChain()) return false;
  Pool(problem);
  Load(problem);
  return ShareAll(problem, impulses);
}

// False if a contact breaks the column by itself: a normal that is not parallel, another body below or above, a slide.
bool Column::FindJoints(const Problem& problem, const double* velocities) {
  const Vector3 up = Upwards(problem.contacts), x = up.unitOrthogonal(), y = up.cross(x);
  joints_.assign(problem.bodies.size(), {});
  touches_.resize(problem.contacts.size());
  for (int c = 0; c < problem.num_contacts(); ++c) {
    const ContactTerm& contact = problem.contacts[c];
    const Vector3 direction = NormalRow(contact).head<3>();
    const double along = direction.dot(up);
    if (!((direction - along * up).norm() <= 10 * kRefined && std::abs(std::abs(along) - 1) <= 10 * kRefined))
      return false;
    const Vector3 u = ContactVelocity(contact, velocities);
    if (contact.friction > 0 && !(u.tail<2>().norm() <= tolerance_)) return false;
    const bool of_b = along > 0;
    const int below = of_b ? contact.body_a : contact.body_b, above = of_b ? contact.body_b : contact.body_a;
    if (above < 0) return false;
    const Vector3 turn_a = contact.jacobian_a.row(0).tail<3>(), turn_b = contact.jacobian_b.row(0).tail<3>();
    const Vector3 &low = of_b ? turn_a : turn_b, &high = of_b ? turn_b : turn_a;
    Joint& joint = joints_[above];
    if (joint.below == kNobody) {
      joint.below = below;
      joint.demand = -INFINITY;
      if (below >= 0 && joints_[below].above != kNobody) return false;
      if (below >= 0) joints_[below].above = above;
    } else if (joint.below != below) {
      return false;
    }
    Touch& touch = touches_[c];
    touch = {joint.last, contact.target - u[0], {{low.dot(x), low.dot(y)}, {high.dot(x), high.dot(y)}}};
    joint.last = c;
    if (!std::isfinite(touch.demand)) return false;
    joint.demand = std::max(joint.demand, touch.demand);
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

// From the top down: each joint's impulse balances what turns the body above it. False if that takes a pull, or there is none.
bool Column::ShareAll(const Problem& problem, std::vector<Vector3>* impulses) {
  impulses->assign(problem.contacts.size(), Vector3::Zero());
  Vector2 turning = Vector2::Zero();  // of the body at this place, by what is above it
  for (size_t place = chain_.size(); place-- > 0;) {
    const BodyTerm& body = problem.bodies[chain_[place]];
    const Joint& joint = joints_[chain_[place]];
    Moments moments;
    if (joint.impulse > 0 && !Share(joint, -turning, &moments, impulses)) return false;
    const double radius = std::sqrt(body.inertia.trace() / body.mass);
    if (!((turning + moments.above).norm() <= tolerance_ * body.mass * radius)) return false;
    turning = moments.below;
  }
  return true;
}

// The joint's impulse, to its contacts that ask for as much as it does, with the moment `wanted` about the body above or the
// nearest to it. Who would have to pull is left out, and the others share anew. False if nobody is left.
bool Column::Share(const Joint& joint, const Vector2& wanted, Moments* moments, std::vector<Vector3>* impulses) {
  const auto each = [&](const auto& visit) {
    for (int c = joint.last; c >= 0; c = touches_[c].before)
      if (touches_[c].presses) visit(c, &touches_[c]);
  };
  each([&](int, Touch* touch) { touch->presses = touch->demand >= joint.demand - tolerance_; });
  for (bool pulls = true; pulls;) {
    pulls = false;
    *moments = {};
    int count = 0;
    Vector2 mean = Vector2::Zero();
    each([&](int, Touch* touch) { ++count, mean += touch->moments.above; });
    if (count == 0) return false;
    mean /= count;
    Eigen::Matrix2d spread = Eigen::Matrix2d::Zero();
    each([&](int, Touch* touch) {
      spread += (touch->moments.above - mean) * (touch->moments.above - mean).transpose();
    });
    const Vector2 slope = SolveSpread(spread, wanted / joint.impulse - mean);
    each([&](int c, Touch* touch) {
      const double share = 1.0 / count + slope.dot(touch->moments.above - mean),
                   impulse = joint.impulse * std::max(0.0, share);
      touch->presses = share >= -kRounding;
      pulls = pulls || !touch->presses;
      (*impulses)[c][0] = impulse;
      moments->above += impulse * touch->moments.above;
      moments->below += impulse * touch->moments.below;
    });
  }
  return true;
}

}  // namespace islet::qp
