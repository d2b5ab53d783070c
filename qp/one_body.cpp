#include "qp/one_body.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <Eigen/Cholesky>

#include "qp/body_algebra.h"
#include "qp/natural_map.h"
#include "qp/slip.h"

namespace islet::qp {
namespace {

using Matrix6 = Eigen::Matrix<double, 6, 6>;

constexpr double kShare = 1e-4;      // of the tolerance: what every contact meets
constexpr double kDependent = 1e-7;  // of the longest row: what is left of one that those before do not imply
constexpr int kRounds = 3;           // in which contacts may be found to press
constexpr double kEnough = 0.1;      // of what may be missed, where Newton's method stops
constexpr int kSteps = 12;           // of it
constexpr int kTrialSteps = 4;       // after them two steps must halve what is missing
constexpr double kLongest = 20;      // of the first value of the dual: beyond it the impulses grow without end
constexpr double kClose = 1e-6;      // of the momentum: less is missing than the dual function resolves
constexpr int kHalvings = 10;
constexpr double kSoft = 1e-3;       // of the trace of the curvature: added to it far from the answer
constexpr double kRounding = 1e-13;  // and always

const Jacobian& OwnJacobian(const ContactTerm& contact) {
  return contact.body_a >= 0 ? contact.jacobian_a : contact.jacobian_b;
}

// += A^T P' A with P' the derivative of the projection on the cone.
void AddCurvature(const Jacobian& a, const Vector3& x, double friction, Matrix6* out) {
  if (friction == 0) {
    if (x[0] > 0) out->noalias() += a.row(0).transpose() * a.row(0);
    return;
  }
  const double tangent = TangentSize(x);
  if (tangent <= friction * x[0]) {
    out->noalias() += a.transpose() * a;
    return;
  }
  if (x[0] + friction * tangent <= 0) return;
  const double scale = 1 / (1 + friction * friction);
  const Vector3 edge(1, friction * x[1] / tangent, friction * x[2] / tangent), side(0, -x[2] / tangent, x[1] / tangent);
  const Vector6 along = a.transpose() * edge, across = a.transpose() * side;
  out->noalias() += scale * along * along.transpose();
  out->noalias() += friction * (x[0] + friction * tangent) * scale / tangent * across * across.transpose();
}

}  // namespace

bool OneBody::Fits(const Problem& problem) {
  return problem.bodies.size() == 1 && problem.contacts.size() > 1 && problem.contacts.size() <= kMostContacts;
}

bool OneBody::Solve(const Problem& problem, const Settings& settings, Solution* solution) {
  if (!Read(problem, settings)) return false;
  for (int round = 0; round < kRounds; ++round) {
    if (!FindMotion()) return false;
    bool grew = false;
    for (int c = 0; c < contacts_; ++c) {
      if (presses_[c]) continue;
      const Vector3 u = jacobians_[c] * motion_ - missing_[c];
      presses_[c] =
          u[0] < (settings.model == Model::kCoulomb ? 0 : Slip(u, problem.contacts[c].friction, settings.cone));
      grew = grew || presses_[c];
    }
    if (!grew) return FindImpulses() && Holds(problem, settings, solution);
  }
  return false;
}

// False where a model's law is none of "target reached or nothing pressed".
bool OneBody::Read(const Problem& problem, const Settings& settings) {
  const BodyTerm& body = problem.bodies[0];
  contacts_ = problem.num_contacts();
  limit_ = kShare * settings.coulomb_tolerance * settings.velocity_scale;
  gap_limit_ = settings.tolerance * settings.velocity_scale;
  const double linear = 1 / std::sqrt(body.mass);
  const Matrix3 angular = Eigen::LLT<Matrix3>(body.inverse_inertia).matrixL();
  // The circle inside the octagon: what it holds both cones hold.
  const double inner = settings.cone == Cone::kOctagon ? std::cos(std::numbers::pi / 8) : 1;
  for (int c = 0; c < contacts_; ++c) {
    const ContactTerm& contact = problem.contacts[c];
    if (contact.compliance > 0 || (settings.model == Model::kKinetic && contact.target > 0)) return false;
    const Jacobian& jacobian = OwnJacobian(contact);
    jacobians_[c].leftCols<3>() = linear * jacobian.leftCols<3>();
    jacobians_[c].rightCols<3>().noalias() = jacobian.rightCols<3>() * angular;
    missing_[c] = -contact.drift;
    missing_[c].noalias() -= jacobian * body.velocity;
    missing_[c][0] += contact.target;
    friction_[c] = inner * contact.friction;
    presses_[c] = missing_[c][0] > 0;
  }
  return true;
}

// The shortest w that gives the pressing contacts what they miss. Largest rows first, each made orthogonal to those taken.
bool OneBody::FindMotion() {
  int rows = 0;
  double largest = 0;
  for (int c = 0; c < contacts_; ++c) {
    if (!presses_[c]) continue;
    for (int k = 0; k < (friction_[c] > 0 ? 3 : 1); ++k) {
      rows_[rows] = {jacobians_[c].row(k), missing_[c][k]};
      largest = std::max(largest, rows_[rows++].row.squaredNorm());
    }
  }
  reach_ = std::sqrt(largest);
  motion_.setZero();
  for (int taken = 0; taken < std::min(rows, 6); ++taken) {
    int next = taken;
    double size = 0;
    for (int k = taken; k < rows; ++k) {
      const double here = rows_[k].row.squaredNorm();
      if (here > size) next = k, size = here;
    }
    if (!(size > kDependent * kDependent * largest)) break;
    std::swap(rows_[taken], rows_[next]);
    const Vector6 direction = rows_[taken].row / std::sqrt(size);
    const double step = rows_[taken].wanted / std::sqrt(size);
    motion_ += step * direction;
    for (int k = taken + 1; k < rows; ++k) {
      const double share = rows_[k].row.dot(direction);
      rows_[k].row -= share * direction;
      rows_[k].wanted -= share * step;
    }
  }
  for (int c = 0; c < contacts_; ++c) {
    if (!presses_[c]) continue;
    const Vector3 left = missing_[c] - jacobians_[c] * motion_;
    if (std::abs(left[0]) > limit_ || (friction_[c] > 0 && TangentSize(left) > limit_)) return false;
  }
  return true;
}

// Impulses for y, and what y is worth: 1/2 |j|^2 - y . w, least where A^T j = w.
double OneBody::Dual(const Vector6& y) {
  double sum = 0;
  for (int c = 0; c < contacts_; ++c) {
    if (!presses_[c]) continue;
    impulses_[c] = ProjectOnCircularCone(jacobians_[c] * y, friction_[c]);
    sum += impulses_[c].squaredNorm();
  }
  return 0.5 * sum - y.dot(motion_);
}

// False where it finds none, and mostly soon where there are none: y then grows without end.
bool OneBody::FindImpulses() {
  double value = Dual(Vector6::Zero());  // and no impulses
  if (motion_.isZero(0)) return true;
  Matrix6 curvature = Matrix6::Zero();
  for (int c = 0; c < contacts_; ++c)
    if (presses_[c]) AddCurvature(jacobians_[c], Vector3::UnitX(), friction_[c], &curvature);
  const double trace = curvature.trace(), enough = kEnough * std::min(limit_, gap_limit_) / reach_;
  Vector6 y = Vector6::Zero(), left = motion_;
  double first = 0, missing = 1, before = 1;  // the last two: momentum, of all
  for (int step = 0; step < kSteps; ++step) {
    curvature.diagonal().array() +=
        trace * std::max(kRounding, step > 0 ? kSoft * std::min(1.0, missing * missing) : 0);
    const Vector6 direction = curvature.ldlt().solve(left);
    const double slope = direction.dot(left);
    double length = 1, next = Dual(y + direction);
    for (int k = 0; missing > kClose && k < kHalvings && !(next <= value - 1e-4 * length * slope); ++k) {
      length *= 0.5;
      next = Dual(y + length * direction);
    }
    y += length * direction;
    value = next;
    left = motion_;
    for (int c = 0; c < contacts_; ++c)
      if (presses_[c]) left.noalias() -= jacobians_[c].transpose() * impulses_[c];
    const double size = left.norm();
    if (size <= enough) return true;
    const double now = size / motion_.norm();
    if (step == 0) first = value;
    if (value < kLongest * first || (step >= kTrialSteps && now > 0.5 * before)) return false;
    before = missing;
    missing = now;
    curvature.setZero();
    for (int c = 0; c < contacts_; ++c)
      if (presses_[c]) AddCurvature(jacobians_[c], jacobians_[c] * y, friction_[c], &curvature);
    if (curvature.isZero(0)) return false;  // every impulse would pull
  }
  return false;
}

// Writes the answer if all contacts meet the law with the velocities that the impulses give.
bool OneBody::Holds(const Problem& problem, const Settings& settings, Solution* solution) const {
  const BodyTerm& body = problem.bodies[0];
  Vector6 momentum = Vector6::Zero();
  for (int c = 0; c < contacts_; ++c) {
    const ContactTerm& contact = problem.contacts[c];
    if (presses_[c]) momentum.noalias() += OwnJacobian(contact).transpose() * impulses_[c];
  }
  const Vector6 v = body.velocity + InverseMassTimes(body, momentum);
  const bool coulomb = settings.model == Model::kCoulomb;  // elsewhere even what separates rubs
  std::array<double, kMostContacts> slips;
  double work = 0;
  for (int c = 0; c < contacts_; ++c) {
    const ContactTerm& contact = problem.contacts[c];
    Vector3 u = OwnJacobian(contact) * v + contact.drift;
    u[0] -= contact.target;
    const double slip = Slip(u, contact.friction, settings.cone);
    if (presses_[c]) {
      work += std::abs(impulses_[c].dot(u));
      if (std::abs(u[0]) > limit_ || (contact.friction > 0 && TangentSize(u) > limit_)) return false;
    } else if (u[0] - (coulomb ? 0 : slip) < -limit_) {
      return false;
    }
    slips[c] = coulomb ? slip : 0;
  }
  const double scale = settings.velocity_scale;
  const double gap = work / (0.5 * body.mass * (body.velocity.head<3>().squaredNorm() + scale * scale));
  if (gap > settings.tolerance) return false;
  solution->gap = gap;
  std::copy_n(slips.begin(), contacts_, solution->slips.begin());
  for (int c = 0; c < contacts_; ++c)
    if (presses_[c]) solution->impulses[c] = impulses_[c];
  Eigen::Map<Vector6>(solution->velocities.data()) = v;
  return true;
}

}  // namespace islet::qp
