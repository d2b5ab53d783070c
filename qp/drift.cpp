#include "qp/drift.h"

#include <algorithm>
#include <cmath>

#include "islands/disjoint_sets.h"
#include "qp/body_algebra.h"
#include "qp/natural_map.h"

namespace islet::qp {
namespace {

constexpr double kUnsteady = 0.5;  // of a contact's change: what it may differ from the one before
constexpr double kAstray = 0.1;    // of a group's change: what is not along the one before
constexpr double kSlides = 1e-3;   // of mu j_n: what is nearer to the border of the cone slides along it
constexpr double kLeastFactor = 2, kLargestFactor = 1e7;

// The largest t for which j + t d is inside its cone; infinite if there is none. Of what slides only the normal impulse counts.
double WayToBorder(const Vector3& j, const Vector3& d, double friction) {
  double way = d[0] < 0 ? -j[0] / d[0] : INFINITY;
  if (!(friction * j[0] - j.tail<2>().norm() > kSlides * friction * j[0])) return way;
  // |j_t + t d_t|^2 = mu^2 (j_n + t d_n)^2: a t^2 + 2 b t + c = 0 with c < 0
  const double mu2 = friction * friction;
  const double a = d.tail<2>().squaredNorm() - mu2 * d[0] * d[0];
  const double b = j.tail<2>().dot(d.tail<2>()) - mu2 * j[0] * d[0];
  const double c = j.tail<2>().squaredNorm() - mu2 * j[0] * j[0];
  const double discriminant = b * b - a * c;
  if (discriminant < 0) return way;
  const double q = -(b + std::copysign(std::sqrt(discriminant), b));
  for (const double root : {q / a, c / q})
    if (root > 0) way = std::min(way, root);
  return way;
}

}  // namespace

bool Drift::Follow(const Problem& problem, std::span<const double> scales, double least, GaussSeidel* sweeps,
                   std::vector<Vector3>* impulses, std::vector<double>* velocities) {
  first_ = *impulses;
  sweeps->Sweep(problem, 1, 0, impulses, velocities);
  second_ = *impulses;
  sweeps->Sweep(problem, 1, 0, impulses, velocities);
  FindGroups(problem, scales, least, *impulses);
  bool any = false;
  for (const int c : drifting_) {
    const double factor = GroupOf(problem.contacts[c]).factor;
    if (!(factor > kLeastFactor && factor < kLargestFactor)) continue;
    Vector3& j = (*impulses)[c];
    j = ProjectOnCircularCone(j + factor * (j - second_[c]), problem.contacts[c].friction);
    any = true;
  }
  if (any) VelocitiesAfter(problem, *impulses, velocities);
  return any;
}

Drift::Group& Drift::GroupOf(const ContactTerm& contact) {
  return groups_[roots_[contact.body_a >= 0 ? contact.body_a : contact.body_b]];
}

void Drift::FindGroups(const Problem& problem, std::span<const double> scales, double least,
                       const std::vector<Vector3>& third) {
  roots_.resize(problem.bodies.size());
  islands::DisjointSets joined(roots_);
  drifting_.clear();
  for (int c = 0; c < problem.num_contacts(); ++c) {
    const Vector3 before = second_[c] - first_[c], after = third[c] - second_[c];
    if (!(after.norm() > least * scales[c]) || (after - before).norm() > kUnsteady * after.norm()) continue;
    drifting_.push_back(c);
    const ContactTerm& contact = problem.contacts[c];
    if (contact.body_a >= 0 && contact.body_b >= 0) joined.Union(contact.body_a, contact.body_b);
  }
  for (size_t i = 0; i < roots_.size(); ++i) roots_[i] = joined.Find(static_cast<int>(i));
  groups_.assign(problem.bodies.size(), {});
  for (const int c : drifting_) {
    const Vector3 before = second_[c] - first_[c], after = third[c] - second_[c];
    Group& group = GroupOf(problem.contacts[c]);
    group.before += before.squaredNorm();
    group.across += before.dot(after);
    group.after += after.squaredNorm();
  }
  for (Group& group : groups_) {
    if (group.before == 0) continue;
    const double rate = group.across / group.before;
    if (group.after - rate * group.across > kAstray * kAstray * group.after) continue;
    group.factor = rate < 1 ? rate / (1 - rate) : INFINITY;
  }
  for (const int c : drifting_) {
    double& factor = GroupOf(problem.contacts[c]).factor;
    factor = std::min(factor, WayToBorder(third[c], third[c] - second_[c], problem.contacts[c].friction));
  }
}

}  // namespace islet::qp
