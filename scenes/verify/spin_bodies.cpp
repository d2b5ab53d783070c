#include "scenes/verify/spin_bodies.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include <Eigen/LU>

#include "scenes/verify/builders.h"

namespace islet::verify {
namespace {

const Vector3 kDown(0, 0, -1), kUp(0, 0, 1);

Quaternion Rotated(const Quaternion& rotation, const Vector3& turn_W) {  // by a rotation vector
  const double angle = turn_W.norm();
  if (angle == 0) return rotation;
  return (Quaternion(Eigen::AngleAxisd(angle, turn_W / angle)) * rotation).normalized();
}

Matrix3 InWorld(const Matrix3& inertia_B, const Quaternion& rotation) {
  const Matrix3 r = rotation.toRotationMatrix();
  return r * inertia_B * r.transpose();
}

}  // namespace

// The point of an ellipsoid x . S^-1 x = 1 with outward normal d is S d / sqrt(d . S d), S = diag(squares of the semi-axes).
Vector3 Ellipsoid::Lowest(const Vector3& down_B) const {
  const Vector3 s = semi_axes.cwiseAbs2().cwiseProduct(down_B);
  return centre_B + s / std::sqrt(down_B.dot(s));
}

Vector3 Ellipsoid::LowestRate(const Vector3& down_B, const Vector3& down_rate_B) const {
  const Vector3 s = semi_axes.cwiseAbs2().cwiseProduct(down_B);
  const Vector3 rate = semi_axes.cwiseAbs2().cwiseProduct(down_rate_B);
  const double length = std::sqrt(down_B.dot(s));
  return rate / length - down_B.dot(rate) / (length * length * length) * s;
}

Vector3 ContactArm(const Ellipsoid& body, const TopState& state) {
  return state.rotation_WB * body.Lowest(state.rotation_WB.conjugate() * kDown);
}

TopState Rolling(const Ellipsoid& body, const Quaternion& rotation_WB, const Vector3& angular_velocity_W) {
  TopState state{.rotation_WB = rotation_WB, .angular_velocity_W = angular_velocity_W};
  const Vector3 arm = ContactArm(body, state);
  state.position_W.z() = -arm.z();
  state.velocity_W = -angular_velocity_W.cross(arm);
  return state;
}

double Gap(const Ellipsoid& body, const TopState& state) { return state.position_W.z() + ContactArm(body, state).z(); }

Vector3 TopMomentum(const Ellipsoid& body, const TopState& state) {
  return InWorld(body.inertia_B, state.rotation_WB) * state.angular_velocity_W;
}

double TopEnergy(const Ellipsoid& body, const TopState& state) {
  return 0.5 * body.mass * state.velocity_W.squaredNorm() +
         0.5 * state.angular_velocity_W.dot(TopMomentum(body, state)) + body.mass * kGravity * state.position_W.z();
}

Vector3 Slip(const Ellipsoid& body, const TopState& state) {
  return state.velocity_W + state.angular_velocity_W.cross(ContactArm(body, state));
}

SuiteRoller::SuiteRoller(const Settings& settings, const Ellipsoid& body, double friction, const TopState& start)
    : body_(body), friction_(friction), pool_(1), suite_(settings, &pool_), state_(start), bodies_(2), contacts_(1) {
  suite_.SetGravity({0, 0, -kGravity});
  bodies_[0].kind = BodyKind::kFixed;
  bodies_[1].mass = body.mass;
  bodies_[1].inertia_B = body.inertia_B;
  bodies_[1].radius = body.centre_B.norm() + body.semi_axes.maxCoeff();
}

// Mean velocity w of the step: m w = m v0 + half the impulse, and in the frame of the body I w = L0 - dt/2 w x I w + half the
// torque's impulse (the midpoint rule with the Cayley map, as in the engine's free rotation [Aus93]). The ends are v1 = 2 w - v0
// and L1 = 2 I w - L0.
void SuiteRoller::Step(double dt) {
  const Vector3 momentum_B = body_.inertia_B * (state_.rotation_WB.conjugate() * state_.angular_velocity_W);
  const double gap = Gap(body_, state_);
  Vector3 linear = state_.velocity_W, angular = state_.angular_velocity_W;
  Quaternion middle, end;
  double last_change = std::numeric_limits<double>::infinity();
  for (int repeat = 0; repeat < 20; ++repeat) {
    const double half_angle = std::atan(0.5 * dt * angular.norm());
    const Vector3 half_turn = angular.norm() > 0 ? Vector3(half_angle / angular.norm() * angular) : Vector3::Zero();
    middle = Rotated(state_.rotation_WB, half_turn);
    end = Rotated(state_.rotation_WB, 2 * half_turn);
    const TopState at_middle{state_.position_W + 0.5 * dt * linear, middle, linear, angular};
    const Matrix3 inertia = InWorld(body_.inertia_B, middle);
    Body& b = bodies_[1];
    b.frozen = false;
    b.position_W = at_middle.position_W;
    b.rotation_WB = middle;
    b.linear_velocity_W = state_.velocity_W;
    b.angular_velocity_W =
        inertia.inverse() * (middle * momentum_B - 0.5 * dt * angular.cross(Vector3(inertia * angular)));
    Contact& c = contacts_[0];
    c = {.body_a = 0, .body_b = 1, .normal_W = kUp, .friction = friction_};
    c.point_W = b.position_W + ContactArm(body_, at_middle);
    c.gap = 0.5 * gap;  // what the whole step may close, in the half that the suite sees
    c.touches = false;  // a contact that lasts: it never bounces
    StepReport report;
    suite_.Resolve(0.5 * dt, bodies_, contacts_, &report);
    const double change = (b.linear_velocity_W - linear).norm() + b.radius * (b.angular_velocity_W - angular).norm();
    linear = b.linear_velocity_W;
    angular = b.angular_velocity_W;
    froze_ = froze_ || b.frozen;
    // Each repeat gains two digits or so, down to what the suite's solver leaves.
    if (change <= 1e-14 * (linear.norm() + b.radius * angular.norm()) || change > 0.5 * last_change) break;
    last_change = change;
  }
  state_.position_W += dt * linear;
  state_.velocity_W = 2 * linear - state_.velocity_W;
  state_.rotation_WB = end;
  const Vector3 end_momentum_B = 2 * body_.inertia_B * (middle.conjugate() * angular) - momentum_B;
  state_.angular_velocity_W = end * Vector3(body_.inertia_B.inverse() * end_momentum_B);
}

ReferenceTop::ReferenceTop(const Ellipsoid& body, double friction, const TopState& start)
    : body_(body), friction_(friction), state_(start) {}

// Arm r, w' = w'0 + I^-1 (r x F), w'0 = -I^-1 (w x I w). The lowest point keeps its height: z' = -(w x r)_z, whatever it does
// over the surface, so z'' = -(w' x r + w x r')_z.
ReferenceTop::Numbers ReferenceTop::Rates(const Numbers& numbers) {
  const TopState s = Unpack(numbers);
  const Vector3& w = s.angular_velocity_W;
  const Vector3 down_B = s.rotation_WB.conjugate() * kDown, w_B = s.rotation_WB.conjugate() * w;
  const Vector3 r = s.rotation_WB * body_.Lowest(down_B);
  const Vector3 r_rate = s.rotation_WB * body_.LowestRate(down_B, -w_B.cross(down_B)) + w.cross(r);
  const Matrix3 inertia = InWorld(body_.inertia_B, s.rotation_WB);
  const Vector3 gyro = -w.cross(Vector3(inertia * w));
  const Vector3 lift = w.cross(r_rate);  // of -v' for a rolling body
  Vector3 force, turn;
  if (friction_ < 0) {
    // v = -w x r, F = m (v' + g z): (I + m (r^2 - r r^T)) w' = gyro + m r x (g z - w x r')
    const Matrix3 about_contact = inertia + body_.mass * (r.squaredNorm() * Matrix3::Identity() - r * r.transpose());
    turn = about_contact.inverse() * (gyro + body_.mass * r.cross(Vector3(kGravity * kUp - lift)));
    force = body_.mass * (-turn.cross(r) - lift + kGravity * kUp);
  } else {
    Vector3 slip = s.velocity_W + w.cross(r);
    slip.z() = 0;
    const Vector3 direction = kUp - friction_ / std::max(slip.norm(), 1e-9) * slip;
    const Vector3 per_force = inertia.inverse() * r.cross(direction), free = inertia.inverse() * gyro;
    const double normal = (kGravity - free.cross(r).z() - lift.z()) / (1 / body_.mass + per_force.cross(r).z());
    force = normal * direction;
    turn = free + normal * per_force;
  }
  least_normal_ = std::min(least_normal_, force.z());
  most_friction_ = std::max(most_friction_, force.head<2>().norm() / force.z());
  const Quaternion spin = Quaternion(0, w.x(), w.y(), w.z()) * s.rotation_WB;
  Numbers rates;
  rates << s.velocity_W, 0.5 * spin.coeffs(), force / body_.mass - kGravity * kUp, turn;
  return rates;
}

ReferenceTop::Numbers ReferenceTop::Pack(const TopState& s) {
  Numbers numbers;
  numbers << s.position_W, s.rotation_WB.coeffs(), s.velocity_W, s.angular_velocity_W;
  return numbers;
}

TopState ReferenceTop::Unpack(const Numbers& n) {
  Quaternion rotation;
  rotation.coeffs() = n.segment<4>(3);
  return {n.head<3>(), rotation.normalized(), n.segment<3>(7), n.tail<3>()};
}

void ReferenceTop::Step(double dt) {
  const Numbers y = Pack(state_);
  const Numbers k1 = Rates(y), k2 = Rates(y + dt / 2 * k1), k3 = Rates(y + dt / 2 * k2), k4 = Rates(y + dt * k3);
  state_ = Unpack(y + dt / 6 * (k1 + 2 * k2 + 2 * k3 + k4));
}

}  // namespace islet::verify
