#include "qp/compounds.h"

#include <algorithm>
#include <cmath>
#include <tuple>

#include <Eigen/Dense>

#include "qp/body_algebra.h"
#include "qp/natural_map.h"

namespace islet::qp {
namespace {

constexpr double kInside = 0.98;      // of mu j_n: tangential impulses below it stick
constexpr double kApart = 0.5;        // of v_ref: velocity at a contact after the impulses of before
constexpr size_t kMostClusters = 8;   // beyond it two attempts in three are in vain
constexpr size_t kCrowd = 6;          // contacts per cluster
constexpr int kBonds = 3;             // contacts that let two bodies neither slide nor turn
constexpr double kRigid = 1e-9;       // relative: how well a Jacobian is that of a point on a rigid body
constexpr double kStiffness = 1e6;    // of sticking contacts, times 1 / W
constexpr double kLeastShare = 1e-2;  // of the mean load: what every sticking contact begins with
constexpr double kStillShare = 0.1;   // of the goal: velocity at a contact that sticks
constexpr double kEnough = 1e-3;      // of the goal: momentum that may be missing, as a velocity
constexpr int kSteps = 10;            // factorisations
constexpr int kTrialSteps = 2;        // after them no more than kTrialShare may be missing of what was
constexpr double kTrialShare = 0.8;
constexpr int kRefinements = 3;
constexpr double kStepShare = 0.9;  // of the way to the border

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

bool Compounds::Find(const Problem& problem, std::span<const Vector3> start, const std::vector<double>& velocities,
                     double velocity_scale) {
  const int bodies = problem.num_bodies();
  factorisations_ = 0;
  if (bodies < 2) return false;
  FindBonds(problem, start, velocities, velocity_scale);
  if (2 * bonds_.size() < static_cast<size_t>(bodies * kBonds)) return false;
  if (!Join(problem)) return false;
  NumberClusters(problem);
  if (2 * centres_.size() > parent_.size() || centres_.size() > kMostClusters) return false;
  ReduceBodies(problem);
  ReduceContacts(problem, start);
  return true;
}

void Compounds::FindBonds(const Problem& problem, std::span<const Vector3> start, const std::vector<double>& velocities,
                          double velocity_scale) {
  bonds_.clear();
  for (int c = 0; c < problem.num_contacts(); ++c) {
    const ContactTerm& contact = problem.contacts[c];
    const Vector3& j = start[c];
    if (contact.body_a < 0 || contact.body_b < 0 || contact.target != 0 || !contact.drift.isZero(0) || !(j[0] > 0) ||
        j.tail<2>().squaredNorm() > std::pow(kInside * contact.friction * j[0], 2) || contact.friction == 0)
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
    const double size = j.tail<2>().norm(), room = kInside * problem.contacts[c].friction * j[0];
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

// Towards the impulses that give what is missing, in the metric in which the cone's border is far away: D is the inverse
// Hessian of its barrier, so that contacts change by no more than what they bear.
void Compounds::Step(std::vector<Vector3>* impulses) {
  double mean = 0;
  for (size_t k = 0; k < sticking_.size(); ++k) mean += (*impulses)[sticking_[k]].squaredNorm() / weights_[k];
  mean /= static_cast<double>(sticking_.size());
  blocks_.resize(sticking_.size());
  for (size_t k = 0; k < sticking_.size(); ++k) {
    const double mu = inside_.contacts[k].friction;
    const Vector3& j = (*impulses)[sticking_[k]];
    const Vector3 x(mu * j[0], j[1], j[2]), back(1 / mu, 1, 1);
    const double det = x[0] * x[0] - x.tail<2>().squaredNorm();
    Matrix3 d = 2 * x * x.transpose();
    d.diagonal() += det * Vector3(-1, 1, 1);
    blocks_[k] = kStiffness / mean * (back.asDiagonal() * d * back.asDiagonal());
  }
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
  for (size_t k = 0; k < sticking_.size(); ++k)
    length =
        std::min(length, kStepShare * StepInCone((*impulses)[sticking_[k]], changes_[k], inside_.contacts[k].friction));
  for (size_t k = 0; k < sticking_.size(); ++k) (*impulses)[sticking_[k]] += length * changes_[k];
}

}  // namespace islet::qp
