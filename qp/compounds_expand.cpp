// Compounds: from the answer of the reduced problem to that of all bodies.
#include <algorithm>
#include <cmath>

#include <Eigen/Geometry>

#include "qp/body_algebra.h"
#include "qp/compounds.h"
#include "qp/natural_map.h"
#include "qp/sticking_step.h"

namespace islet::qp {
namespace {

constexpr double kLeastShare = 1e-2;  // of the mean load: what every sticking contact begins with
constexpr double kStillShare = 0.1;   // of the goal: velocity at a contact that sticks
constexpr double kEnough = 1e-3;      // of the goal: momentum that may be missing, as a velocity
constexpr int kSteps = 6;             // factorisations; of 325 successes 15 took more, of 37 failures 27 took ten
constexpr int kTrialSteps = 2;        // after them no more than kTrialShare may be missing of what was
constexpr double kTrialShare = 0.8;
constexpr int kRefinements = 3;
constexpr double kStepShare = 0.9;  // of the way to the border

// Largest t with j + t change in the cone, at least 1 / kStepShare if that is inside.
double StepInCone(const Vector3& j, const Vector3& change, double mu) {
  const auto inside = [&](double t) {
    const Vector3 x = j + t * change;
    return x[0] >= 0 && x.tail<2>().squaredNorm() <= mu * mu * x[0] * x[0];
  };
  double low = 0, high = 1 / kStepShare;
  if (inside(high)) return high;
  for (int k = 0; k < 20; ++k) (inside(0.5 * (low + high)) ? low : high) = 0.5 * (low + high);
  return low;
}

}  // namespace

bool Compounds::Expand(const Problem& problem, std::span<const Vector3> start,
                       const std::vector<double>& reduced_velocities, std::span<const Vector3> reduced_impulses,
                       double goal, std::vector<Vector3>* impulses, std::vector<double>* velocities) {
  velocities->resize(6 * parent_.size());
  for (int i = 0; i < problem.num_bodies(); ++i) {
    Vector6 v = At(reduced_velocities, 6 * parent_[i]);
    v.head<3>() -= position_[i].cross(v.tail<3>());
    At(*velocities, 6 * i) = v;
  }
  impulses->assign(problem.contacts.size(), Vector3::Zero());
  for (size_t c = 0; c < outer_.size(); ++c) (*impulses)[outer_[c]] = reduced_impulses[c];
  lengths_.clear();
  FindSticking(problem, *velocities, goal);
  if (sticking_.empty()) return false;
  begin_ = *impulses;
  BeginInside(problem, start, true, impulses);
  BeginInside(problem, start, false, &begin_);
  inside_.bodies = problem.bodies;
  system_.Prepare(inside_, 1);
  ImpulseScales(inside_, &weights_);
  const double grown = MissingMomentum(problem, *velocities, *impulses);
  double first = MissingMomentum(problem, *velocities, begin_);
  if (first < grown) {
    impulses->swap(begin_);
  } else {
    first = MissingMomentum(problem, *velocities, *impulses);
  }
  const double enough = kEnough * goal;
  double missing = first;
  for (int step = 0; step < kSteps && missing > enough; ++step) {
    if (step == kTrialSteps && missing > kTrialShare * first) return false;
    Step(impulses);
    missing = MissingMomentum(problem, *velocities, *impulses);
  }
  return missing <= enough;
}

// Contacts that do not move, inside the clusters and, where the reduced answer is one of many, outside: any impulse in the
// cone is as good to them as another, and that answer's not always one that the insides can bear.
void Compounds::FindSticking(const Problem& problem, const std::vector<double>& velocities, double goal) {
  sticking_.clear();
  inside_.contacts.clear();
  for (int c = 0; c < problem.num_contacts(); ++c) {
    const ContactTerm& contact = problem.contacts[c];
    if (contact.target != 0 || contact.friction == 0) continue;
    if (!IsInner(contact) &&
        (!crowded() || ContactVelocity(contact, velocities.data()).squaredNorm() > std::pow(kStillShare * goal, 2)))
      continue;
    sticking_.push_back(c);
    inside_.contacts.push_back(contact);
  }
}

// Sticking contacts begin with their impulses of before, as much larger as the loads on their cluster are, strictly in their
// cones; between clusters halfway to the reduced answer. What pressed little may begin to press.
void Compounds::BeginInside(const Problem& problem, std::span<const Vector3> start, bool grow,
                            std::vector<Vector3>* impulses) {
  const auto cluster = [&](const ContactTerm& contact) {
    return parent_[contact.body_b >= 0 ? contact.body_b : contact.body_a];
  };
  loads_.assign(reduced_.bodies.size(), {0, 0});
  for (const int c : outer_) {
    for (const int body : {problem.contacts[c].body_a, problem.contacts[c].body_b}) {
      if (body < 0) continue;
      loads_[parent_[body]][0] += start[c][0];
      loads_[parent_[body]][1] += (*impulses)[c][0];
    }
  }
  double sum = 0;
  for (const int c : sticking_) {
    const ContactTerm& contact = problem.contacts[c];
    const auto [before, now] = loads_[cluster(contact)];
    const Vector3 grown = (grow && before > 0 && now > 0 ? now / before : 1) * start[c];
    Vector3& j = (*impulses)[c];
    j = IsInner(contact) ? grown : grow ? 0.5 * (j + grown) : j;
    sum += j[0];
  }
  const double least = kLeastShare * sum / static_cast<double>(sticking_.size());
  for (const int c : sticking_) {
    Vector3& j = (*impulses)[c];
    j[0] = std::max(j[0], least);
    const double size = j.tail<2>().norm(), room = kInsideCone * problem.contacts[c].friction * j[0];
    if (size > room) j.tail<2>() *= room / size;
  }
}

// Of each body, what the impulses do not give to reach its velocity, in missing_. Returns the largest [velocity].
double Compounds::MissingMomentum(const Problem& problem, const std::vector<double>& velocities,
                                  const std::vector<Vector3>& impulses) {
  missing_.resize(velocities.size());
  for (int i = 0; i < problem.num_bodies(); ++i)
    At(missing_, 6 * i) = MassTimes(problem.bodies[i], At(velocities, 6 * i) - problem.bodies[i].velocity);
  for (int c = 0; c < problem.num_contacts(); ++c) AddForce(problem.contacts[c], 6, 0, -1, impulses[c], &missing_);
  double worst = 0;
  for (int i = 0; i < problem.num_bodies(); ++i) {
    const Vector6 p = At(missing_, 6 * i);
    worst = std::max(worst, p.dot(InverseMassTimes(problem.bodies[i], p)) / problem.bodies[i].mass);
  }
  return std::sqrt(worst);
}

// Towards the impulses that give what is missing, in the metric in which the cone's border is far away.
void Compounds::Step(std::vector<Vector3>* impulses) {
  borne_.clear();
  for (const int c : sticking_) borne_.push_back((*impulses)[c]);
  StickingMetric(inside_, borne_, weights_, &blocks_);
  system_.Factorise(inside_, blocks_, {});
  ++factorisations_;
  changes_.assign(sticking_.size(), Vector3::Zero());
  for (int round = 0; round < kRefinements; ++round) {
    multipliers_ = missing_;
    system_.Solve(multipliers_.data());
    for (size_t k = 0; k < sticking_.size(); ++k) {
      const Vector3 change = blocks_[k] * FieldVelocity(inside_.contacts[k], 6, 0, multipliers_);
      changes_[k] += change;
      AddForce(inside_.contacts[k], 6, 0, -1, change, &missing_);
    }
  }
  double length = 1;
  lengths_.resize(sticking_.size(), 1);
  for (size_t k = 0; k < sticking_.size(); ++k) {
    const double here = kStepShare * StepInCone((*impulses)[sticking_[k]], changes_[k], inside_.contacts[k].friction);
    length = std::min(length, here);
    lengths_[k] = std::min(lengths_[k], here);
  }
  for (size_t k = 0; k < sticking_.size(); ++k) (*impulses)[sticking_[k]] += length * changes_[k];
}

}  // namespace islet::qp
