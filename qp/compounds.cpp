#include "qp/compounds.h"

#include <algorithm>
#include <cmath>
#include <tuple>

#include <Eigen/Dense>

#include "qp/body_algebra.h"
#include "qp/sticking_step.h"

namespace islet::qp {
namespace {

// Of v_ref: velocity at a contact after the impulses of before. In stacks dropped by 0.2, 0.25, 0.3 and 0.35 m attempts in vain
// took 12, 6, 4 and 7 % of the time with 0.5, 11, 3, 4 and 2 % with this, and no scene got slower. 0.02 (7, 1, 2, 2 %) refuses
// towers on a floor that sets off.
constexpr double kApart = 0.05;
constexpr int kMostClusters = 8;  // beyond it two attempts in three are in vain
constexpr size_t kCrowd = 6;      // contacts per cluster
constexpr int kBonds = 3;         // contacts that let two bodies neither slide nor turn
constexpr double kBlame = 1.5;    // of the shortest length of a step that a cone allowed
constexpr double kRigid = 1e-9;   // relative: how well a Jacobian is that of a point on a rigid body

// To begin with: two, or about a third of the bodies. In stacks of ten dropped from 30 heights four clusters served in 29 of 90
// attempts, three in 51 of 81; with half of the bodies allowed attempts in vain took 2.7 % of the time, with this 2.0 %.
size_t FewClusters(int bodies) { return std::min(std::max(2, (bodies + 1) / 3), kMostClusters); }

// After splits: two, or fewer than half. Where five of ten bodies were left, one attempt in four served.
size_t MostClusters(int bodies) { return std::min(std::max(2, (bodies - 1) / 2), kMostClusters); }

Matrix3 Cross(const Vector3& r) {
  Matrix3 m;
  m << 0, -r.z(), r.y(), r.z(), 0, -r.x(), -r.y(), r.x(), 0;
  return m;
}

// From the body's centre to the contact: a Jacobian is (R, -R [r]x) with R orthogonal. False if it is not.
bool LeverArm(const Jacobian& jacobian, Vector3* arm) {
  const Matrix3 rotation = jacobian.leftCols<3>();
  if ((rotation * rotation.transpose() - Matrix3::Identity()).cwiseAbs().maxCoeff() > kRigid) return false;
  const Matrix3 cross = -rotation.transpose() * jacobian.rightCols<3>();
  *arm = 0.5 * Vector3(cross(2, 1) - cross(1, 2), cross(0, 2) - cross(2, 0), cross(1, 0) - cross(0, 1));
  return (cross - Cross(*arm)).cwiseAbs().maxCoeff() <= kRigid * (1e-3 + arm->norm());
}

}  // namespace

bool Compounds::Find(const Problem& problem, std::span<const Vector3> start, const std::vector<double>& velocities,
                     double velocity_scale) {
  const int bodies = problem.num_bodies();
  factorisations_ = 0;
  if (bodies < 2) return false;
  FindBonds(problem, start, velocities, velocity_scale);
  if (2 * bonds_.size() < static_cast<size_t>(bodies * kBonds)) return false;
  return Reduce(problem, start, FewClusters(bodies));
}

bool Compounds::Reduce(const Problem& problem, std::span<const Vector3> start, size_t most) {
  if (!Join(problem)) return false;
  NumberClusters(problem);
  if (centres_.size() > std::min(most, parent_.size() / 2)) return false;
  ReduceBodies(problem);
  ReduceContacts(problem, start);
  return true;
}

bool Compounds::Split(const Problem& problem, std::span<const Vector3> start) {
  if (lengths_.empty()) return false;
  const double limit = std::min(1.0, kBlame * *std::min_element(lengths_.begin(), lengths_.end()));
  const auto bars = [&](const Bond& bond) {
    const auto at = std::lower_bound(sticking_.begin(), sticking_.end(), bond.contact);
    return at != sticking_.end() && *at == bond.contact && lengths_[at - sticking_.begin()] < limit;
  };
  size_t kept = 0;
  for (size_t begin = 0, end = 0; begin < bonds_.size(); begin = end) {
    bool holds = true;
    for (; end < bonds_.size() && bonds_[end].a == bonds_[begin].a && bonds_[end].b == bonds_[begin].b; ++end)
      holds = holds && !bars(bonds_[end]);
    for (size_t k = begin; holds && k < end; ++k) bonds_[kept++] = bonds_[k];
  }
  bonds_.resize(kept);
  const size_t before = centres_.size();
  return Reduce(problem, start, MostClusters(problem.num_bodies())) && centres_.size() > before;
}

void Compounds::FindBonds(const Problem& problem, std::span<const Vector3> start, const std::vector<double>& velocities,
                          double velocity_scale) {
  bonds_.clear();
  for (int c = 0; c < problem.num_contacts(); ++c) {
    const ContactTerm& contact = problem.contacts[c];
    const Vector3& j = start[c];
    if (contact.body_a < 0 || contact.body_b < 0 || contact.target != 0 || !contact.drift.isZero(0) || !(j[0] > 0) ||
        j.tail<2>().squaredNorm() > std::pow(kInsideCone * contact.friction * j[0], 2) || contact.friction == 0)
      continue;
    if (ContactVelocity(contact, velocities.data()).squaredNorm() > std::pow(kApart * velocity_scale, 2)) continue;
    bonds_.push_back({contact.body_a, contact.body_b, c});
  }
  std::sort(bonds_.begin(), bonds_.end(),
            [](const Bond& x, const Bond& y) { return std::tie(x.a, x.b, x.contact) < std::tie(y.a, y.b, y.contact); });
}

// Halves the path on its way; positions add up.
int Compounds::Root(int body) {
  while (parent_[body] != body) {
    const int up = parent_[body];
    if (parent_[up] != up) {
      position_[body] += position_[up];
      parent_[body] = parent_[up];
    }
    body = parent_[body];
  }
  return body;
}

// Pairs with enough bonds become parts of one cluster. False where lever arms make no sense.
bool Compounds::Join(const Problem& problem) {
  parent_.resize(problem.bodies.size());
  for (size_t i = 0; i < parent_.size(); ++i) parent_[i] = static_cast<int>(i);
  position_.assign(problem.bodies.size(), Vector3::Zero());
  for (size_t begin = 0, end = 0; begin < bonds_.size(); begin = end) {
    const auto [a, b, number] = bonds_[begin];
    while (end < bonds_.size() && bonds_[end].a == a && bonds_[end].b == b) ++end;
    if (end - begin < kBonds) continue;
    const ContactTerm& contact = problem.contacts[number];
    Vector3 arm_a, arm_b;
    if (!LeverArm(contact.jacobian_a, &arm_a) || !LeverArm(contact.jacobian_b, &arm_b)) return false;
    int up = Root(a), down = Root(b);
    if (up == down) continue;
    const auto from_root = [&](int body, int root) {
      Vector3 sum = Vector3::Zero();
      for (; body != root; body = parent_[body]) sum += position_[body];
      return sum;
    };
    Vector3 apart = from_root(a, up) + arm_a - arm_b - from_root(b, down);  // of the roots
    if (down < up) {
      std::swap(up, down);
      apart = -apart;
    }
    parent_[down] = up;
    position_[down] = apart;
  }
  return true;
}

// parent_ becomes the number of the cluster, position_ the place from its centre of mass.
void Compounds::NumberClusters(const Problem& problem) {
  centres_.clear();
  reduced_.Clear();
  for (int i = 0; i < problem.num_bodies(); ++i) {  // parents come before their children, and are done by then
    const BodyTerm& body = problem.bodies[i];
    const int up = parent_[i];
    if (up == i) {
      parent_[i] = static_cast<int>(centres_.size());
      centres_.push_back(Vector3::Zero());
      reduced_.bodies.emplace_back().mass = 0;
    } else {
      parent_[i] = parent_[up];
      position_[i] += position_[up];
    }
    reduced_.bodies[parent_[i]].mass += body.mass;
    centres_[parent_[i]] += body.mass * position_[i];
  }
  for (size_t k = 0; k < centres_.size(); ++k) centres_[k] /= reduced_.bodies[k].mass;
  for (int i = 0; i < problem.num_bodies(); ++i) position_[i] -= centres_[parent_[i]];
}

void Compounds::ReduceBodies(const Problem& problem) {
  for (BodyTerm& cluster : reduced_.bodies) {
    cluster.inertia.setZero();
    cluster.velocity.setZero();
  }
  for (int i = 0; i < problem.num_bodies(); ++i) {
    const BodyTerm& body = problem.bodies[i];
    BodyTerm& cluster = reduced_.bodies[parent_[i]];
    const Matrix3 cross = Cross(position_[i]);
    cluster.inertia.noalias() += body.inertia - body.mass * cross * cross;
    const Vector3 momentum = body.mass * body.velocity.head<3>();
    cluster.velocity.head<3>() += momentum;
    cluster.velocity.tail<3>() += body.inertia * body.velocity.tail<3>() + position_[i].cross(momentum);
  }
  for (BodyTerm& cluster : reduced_.bodies) {
    cluster.inertia = (0.5 * (cluster.inertia + cluster.inertia.transpose())).eval();
    cluster.inverse_inertia = cluster.inertia.inverse();
    cluster.velocity = InverseMassTimes(cluster, cluster.velocity);
  }
}

void Compounds::ReduceContacts(const Problem& problem, std::span<const Vector3> start) {
  outer_.clear();
  reduced_start_.clear();
  const auto move = [&](int* body, Jacobian* jacobian) {
    if (*body < 0) return;
    jacobian->rightCols<3>() -= jacobian->leftCols<3>() * Cross(position_[*body]);
    *body = parent_[*body];
  };
  for (int c = 0; c < problem.num_contacts(); ++c) {
    if (IsInner(problem.contacts[c])) continue;
    outer_.push_back(c);
    reduced_start_.push_back(start[c]);
    ContactTerm moved = problem.contacts[c];
    move(&moved.body_a, &moved.jacobian_a);
    move(&moved.body_b, &moved.jacobian_b);
    reduced_.contacts.push_back(moved);
  }
}

bool Compounds::crowded() const { return reduced_.contacts.size() > kCrowd * reduced_.bodies.size(); }

bool Compounds::IsInner(const ContactTerm& contact) const {
  return contact.body_a >= 0 && contact.body_b >= 0 && parent_[contact.body_a] == parent_[contact.body_b];
}

}  // namespace islet::qp
