#include "qp/planar_problem.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <tuple>

#include <Eigen/Geometry>

#include "qp/body_algebra.h"

namespace islet::qp {
namespace {

constexpr double kParallel = 1e-3;  // sine of the angle between normals that span a plane
constexpr int kMostDirections = 12;
constexpr int kFewContacts = 6;  // of the first face, to look for a mirrored pair among

bool Small(double x) { return std::abs(x) <= kPlanarTolerance; }

// Directions that the plane may be normal to.
class Directions {
 public:
  Directions(const Problem& problem, double velocity_scale) {
    const Vector6 first = NormalRow(problem.contacts[0]);
    const Vector3 n = first.head<3>();
    for (const ContactTerm& contact : problem.contacts) {
      const Vector3 e = n.cross(Vector3(NormalRow(contact).head<3>()));
      if (e.squaredNorm() < kParallel * kParallel) continue;
      Add(e);
      return;
    }
    AddVelocities(problem, n, velocity_scale);
    const Vector3 arm = n.cross(Vector3(first.tail<3>()));  // of the first contact, without its part along n
    Vector3 apart = Vector3::Zero();
    for (int c = 1; c < std::min(kFewContacts, problem.num_contacts()); ++c) {
      const ContactTerm& contact = problem.contacts[c];
      if (contact.body_a != problem.contacts[0].body_a || contact.body_b != problem.contacts[0].body_b) break;
      apart = n.cross(Vector3(NormalRow(contact).tail<3>())) - arm;
      Add(apart);
    }
    Add(n.cross(arm));
    Add(n.cross(apart));
    Add(n.unitOrthogonal());
    // Of several planes always the same one, in every problem of an island and in every step: what is solved in one plane
    // leaves rounding errors times thousands in others.
    const auto rank = [](const Vector3& e) { return std::abs(e.dot(Vector3(0.28, 0.83, 0.48))); };
    const auto before = [&](const Vector3& a, const Vector3& b) { return rank(a) > rank(b); };
    for (auto it = directions_.begin(); it != directions_.begin() + size_; ++it)  // stable, and allocates nothing
      std::rotate(std::upper_bound(directions_.begin(), it, *it, before), it, it + 1);
  }

  int size() const { return size_; }
  const Vector3& operator[](int i) const { return directions_[i]; }

 private:
  void Add(const Vector3& e) {
    const double length = e.norm();
    if (length > 0 && size_ < kMostDirections) directions_[size_++] = e / length;
  }

  // Spins are normal to the plane, velocities lie in it.
  void AddVelocities(const Problem& problem, const Vector3& n, double velocity_scale) {
    Vector3 spin = Vector3::Zero(), aside = Vector3::Zero();
    double fastest = 0;
    for (const BodyTerm& body : problem.bodies) {
      const Vector3 w = body.velocity.tail<3>(), v = n.cross(Vector3(body.velocity.head<3>()));
      const double speed = std::sqrt(w.squaredNorm() * body.inertia.trace() / body.mass);
      if (speed > fastest) fastest = speed, spin = w;
      if (v.squaredNorm() > aside.squaredNorm()) aside = v;
    }
    if (fastest > kPlanarTolerance * velocity_scale) Add(spin);
    if (aside.norm() > kPlanarTolerance * velocity_scale) Add(aside);
  }

  std::array<Vector3, kMostDirections> directions_;
  int size_ = 0;
};

}  // namespace

bool PlanarProblem::Reduce(const Problem& problem, double velocity_scale) {
  if (problem.contacts.empty()) return false;
  scale_ = velocity_scale;
  const Directions directions(problem, velocity_scale);
  for (int i = 0; i < directions.size(); ++i)
    if (ReduceAbout(directions[i], problem)) return true;
  return false;
}

bool PlanarProblem::ReduceAbout(const Vector3& e, const Problem& problem) {
  const Vector3 n = NormalRow(problem.contacts[0]).head<3>();
  if (!Small(n.dot(e)) || !Small(n.squaredNorm() - 1)) return false;
  axes_ << n, e.cross(n), e;
  if (!ReduceBodies(problem)) return false;
  reduced_.contacts.clear();
  groups_.clear(), weights_.clear();
  members_.resize(problem.contacts.size());
  order_.resize(problem.contacts.size());
  std::iota(order_.begin(), order_.end(), 0);
  const auto pair = [&](int c) { return std::tuple(problem.contacts[c].body_a, problem.contacts[c].body_b, c); };
  const auto before = [&](int c, int d) { return pair(c) < pair(d); };
  if (!std::is_sorted(order_.begin(), order_.end(), before)) std::sort(order_.begin(), order_.end(), before);
  int first_group = 0;  // of this pair of bodies, and its first contact
  size_t begin = 0;
  for (size_t k = 0; k < order_.size(); ++k) {
    const ContactTerm& contact = problem.contacts[order_[k]];
    ContactTerm flat;
    Member& member = members_[order_[k]];
    if (!Look(contact, &flat, &member)) return false;
    const ContactTerm& last = problem.contacts[order_[begin]];
    if (last.body_a != contact.body_a || last.body_b != contact.body_b) {
      if (!Balance(first_group, begin, k)) return false;
      first_group = static_cast<int>(groups_.size());
      begin = k;
    }
    int g = first_group;
    while (g < static_cast<int>(groups_.size()) && !LooksLike(flat, reduced_.contacts[g])) ++g;
    if (g == static_cast<int>(groups_.size())) {
      groups_.push_back({});
      weights_.push_back({0, DelassusBlock(problem, contact)(0, 0)});
      reduced_.contacts.push_back(flat);
    }
    member.group = g;
    ++weights_[g].size;
    if (!Small(member.height)) (member.height > 0 ? groups_[g].above : groups_[g].below) += std::abs(member.height);
  }
  return Balance(first_group, begin, order_.size());
}

bool PlanarProblem::ReduceBodies(const Problem& problem) {
  const Vector3 e = axes_.col(2);
  reduced_.bodies.resize(problem.bodies.size());
  radii_.resize(problem.bodies.size());
  for (size_t i = 0; i < problem.bodies.size(); ++i) {
    const BodyTerm& body = problem.bodies[i];
    const double trace = body.inertia.trace(), radius = std::sqrt(trace / body.mass);
    const Vector3 turned = body.inertia * e, v = body.velocity.head<3>(), w = body.velocity.tail<3>();
    const double about = turned.dot(e), spin = w.dot(e);
    if (!((turned - about * e).norm() <= kPlanarTolerance * trace)) return false;
    if (!Small(v.dot(e) / scale_) || !Small((w - spin * e).norm() * radius / scale_)) return false;
    BodyTerm& reduced = reduced_.bodies[i];
    reduced.mass = body.mass;
    reduced.inertia = about * Matrix3::Identity();
    reduced.inverse_inertia = e.dot(body.inverse_inertia * e) * Matrix3::Identity();
    reduced.velocity << v.dot(axes_.col(0)), v.dot(axes_.col(1)), 0, 0, 0, spin;
    radii_[i] = radius;
  }
  return true;
}

// False if the contact by itself breaks the symmetry: its normal or drift leaves the plane, or its frame is none.
bool PlanarProblem::Look(const ContactTerm& contact, ContactTerm* flat_term, Member* member) const {
  const Vector3 x = axes_.col(0), y = axes_.col(1), e = axes_.col(2);
  const bool of_b = contact.body_b >= 0;
  const Jacobian& shown = of_b ? contact.jacobian_b : contact.jacobian_a;
  const Vector3 n = (of_b ? 1 : -1) * shown.row(0).head<3>().transpose();
  const Vector3 t = (of_b ? 1 : -1) * e.cross(n);
  const double along[2] = {shown.row(1).head<3>().dot(t), shown.row(2).head<3>().dot(t)};
  if (!Small(n.dot(e)) || !Small(along[0] * along[0] + along[1] * along[1] - 1)) return false;
  ContactTerm& term = *flat_term;
  *member = {};
  term.body_a = contact.body_a, term.body_b = contact.body_b;
  member->along[0] = along[0], member->along[1] = along[1];
  for (int side = 0; side < 2; ++side) {
    const int body = side == 0 ? contact.body_a : contact.body_b;
    const Jacobian& whole = side == 0 ? contact.jacobian_a : contact.jacobian_b;
    Jacobian& flat = side == 0 ? term.jacobian_a : term.jacobian_b;
    if (body < 0) continue;
    const double per_radius = 1 / radii_[body];
    const Vector6 across = along[0] * whole.row(2) - along[1] * whole.row(1);
    if (!Small(across.head<3>().dot(x)) || !Small(across.head<3>().dot(y)) ||
        !Small(across.tail<3>().dot(e) * per_radius))
      return false;
    for (int r = 0; r < 2; ++r) {
      const Vector6 row = r == 0 ? Vector6(whole.row(0)) : Vector6(along[0] * whole.row(1) + along[1] * whole.row(2));
      const Vector3 push = row.head<3>(), turn = row.tail<3>();
      if (!Small(push.dot(e))) return false;
      flat.row(r) << push.dot(x), push.dot(y), 0, 0, 0, turn.dot(e);
      member->levers[4 * side + 2 * r] = turn.dot(x) * per_radius;
      member->levers[4 * side + 2 * r + 1] = turn.dot(y) * per_radius;
      if (r == 0) member->height = (side == 0 ? -1 : 1) * turn.dot(e.cross(n)) * per_radius;
    }
  }
  const Vector3& drift = contact.drift;
  if (!Small((along[0] * drift[2] - along[1] * drift[1]) / scale_)) return false;
  term.drift << drift[0], along[0] * drift[1] + along[1] * drift[2], 0;
  term.friction = contact.friction;
  term.target = contact.target;
  return true;
}

bool PlanarProblem::LooksLike(const ContactTerm& a, const ContactTerm& b) const {
  const auto same = [](const Jacobian& j, const Jacobian& k, double radius) {
    for (int r = 0; r < 2; ++r)
      if (!Small(j(r, 0) - k(r, 0)) || !Small(j(r, 1) - k(r, 1)) || !Small((j(r, 5) - k(r, 5)) / radius)) return false;
    return true;
  };
  return same(a.jacobian_a, b.jacobian_a, Radius(a.body_a)) && same(a.jacobian_b, b.jacobian_b, Radius(a.body_b)) &&
         Small(a.friction - b.friction) && Small((a.target - b.target) / scale_) &&
         Small((a.drift - b.drift).norm() / scale_);
}

// Shares of the contacts order_[begin] .. order_[end - 1] in their groups: contacts above the plane and below it in proportion to
// the others' heights. False if these leave a lever arm.
bool PlanarProblem::Balance(int first_group, size_t begin, size_t end) {
  const auto each = [&](const auto& visit) {
    for (size_t k = begin; k < end; ++k) visit(members_[order_[k]], groups_[members_[order_[k]].group]);
  };
  each([](Member& member, Group& group) {
    const double all = group.above + group.below;
    member.share = all == 0 ? 1 : Small(member.height) ? 0.5 * all : member.height > 0 ? group.below : group.above;
    group.total += member.share;
  });
  each([](Member& member, Group& group) {
    member.share /= group.total;  // nothing, where all are on one side
    for (size_t i = 0; i < member.levers.size(); ++i) group.levers[i] += member.share * member.levers[i];
  });
  return std::all_of(groups_.begin() + first_group, groups_.end(), [](const Group& group) {
    return group.total > 0 && std::all_of(group.levers.begin(), group.levers.end(), Small);
  });
}

void PlanarProblem::MergeImpulses(std::span<const Vector3> whole, std::vector<Vector3>* merged) const {
  merged->clear();
  if (whole.size() != members_.size()) return;
  merged->assign(groups_.size(), Vector3::Zero());
  for (size_t c = 0; c < whole.size(); ++c) {
    const auto& along = members_[c].along;
    (*merged)[members_[c].group] += Vector3(whole[c][0], along[0] * whole[c][1] + along[1] * whole[c][2], 0);
  }
}

void PlanarProblem::MergeScales(std::span<const double> whole, std::vector<double>* merged) const {
  merged->assign(groups_.size(), INFINITY);
  for (size_t c = 0; c < members_.size(); ++c) {
    double& scale = (*merged)[members_[c].group];
    scale = std::min(scale, whole[c] / members_[c].share);
  }
}

double PlanarProblem::Expand(const Problem& whole, const Solution& planar, Solution* solution) const {
  solution->impulses.resize(members_.size());
  solution->slips.resize(members_.size());
  for (size_t c = 0; c < members_.size(); ++c) {
    const Member& member = members_[c];
    const Vector3 share = member.share * planar.impulses[member.group];
    solution->impulses[c] = {share[0], member.along[0] * share[1], member.along[1] * share[1]};
    solution->slips[c] = planar.slips[member.group];
  }
  VelocitiesAfter(whole, solution->impulses, &solution->velocities);
  double worst = 0;
  for (size_t i = 0; i < whole.bodies.size(); ++i) {
    const auto flat = At(planar.velocities, static_cast<int>(6 * i));
    const auto v = At(solution->velocities, static_cast<int>(6 * i));
    const Vector3 linear = axes_.transpose() * v.head<3>() - flat.head<3>();
    const Vector3 angular = axes_.transpose() * v.tail<3>() - flat.tail<3>();
    worst = std::max({worst, linear.norm(), radii_[i] * angular.norm()});
  }
  solution->status = planar.status;
  solution->gap = planar.gap;
  solution->rounds = planar.rounds;
  solution->coulomb_reached = planar.coulomb_reached;
  return worst;
}

}  // namespace islet::qp
