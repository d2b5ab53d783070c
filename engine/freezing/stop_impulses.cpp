#include "engine/freezing/stop_impulses.h"

#include <algorithm>

#include "engine/response/island_problem.h"

namespace islet {

void StopImpulses::Prepare(const SuiteFrame& frame, std::span<const int> bodies, std::span<const int> contacts) {
  problem_.Clear();
  problem_.bodies.resize(bodies.size());
  holding_.clear();
  for (const int c : contacts) {
    const Contact& contact = frame.contacts.contacts[c];
    qp::ContactTerm& term = problem_.contacts.emplace_back();
    term.friction = contact.friction;
    const auto side = [&](int number, double sign, int* body, qp::Jacobian* jacobian) {
      const auto found = std::lower_bound(bodies.begin(), bodies.end(), number);
      if (found == bodies.end() || *found != number) return;
      *body = static_cast<int>(found - bodies.begin());
      *jacobian = PointJacobian(frame.bodies[number].position_W, contact, frame.frames[c], sign);
      jacobian->rightCols<3>() /= frame.bodies[number].radius;
    };
    side(contact.body_a, -1, &term.body_a, &term.jacobian_a);
    side(contact.body_b, 1, &term.body_b, &term.jacobian_b);
    holding_.push_back(frame.holding[c]);
  }
  least_.Prepare(holding_, &problem_);
}

bool StopImpulses::Find(std::span<const Momentum> wanted, std::span<const double> limits, double outside, Reach reach,
                        std::vector<Vector3>* impulses) {
  wanted_.clear();
  for (const Momentum& momentum : wanted) wanted_.insert(wanted_.end(), momentum.begin(), momentum.end());
  limits_.assign(limits.begin(), limits.end());
  return least_.Find(wanted_, limits_, outside, reach, impulses);
}

const std::vector<double>& StopImpulses::speeds() {
  const std::vector<double>& way = least_.mechanism();
  speeds_.clear();
  for (size_t i = 0; i < way.size(); i += 6) speeds_.push_back(Eigen::Map<const Momentum>(&way[i]).norm());
  return speeds_;
}

}  // namespace islet
