#include "bench/charts/coulomb_error.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <stdexcept>
#include <utility>

namespace islet::charts {
namespace {

using peers::State;

constexpr double kTouch = 5e-3;          // [m] farther apart than that and than what closes in the step: no contact
constexpr double kCollision = 1.0 / 60;  // [s] approach at what gravity gives in that time is a collision
constexpr double kClosed = 1e-6;         // [m] an open contact may close at any speed: it is the next step's
constexpr double kUnitTime = 1.0 / 60;   // [s] velocities count in units of what gravity gives in that time
constexpr double kRounding = 1.2e-7;     // of a coordinate: what poses in float may move by
constexpr double kConverged = 2e-7;      // of a step of the fit, relative to the momentum of gravity
constexpr double kFlies = 1e-3;          // [g] what touches nothing and is explained to that flies free: not judged
constexpr double kWork = 4e6;            // updates of contacts a fit may take
constexpr int kMostIterations = 1500, kLeastIterations = 300;

Vector3 VelocityAt(const State& state, const Vector3& arm) {
  return state.linear_velocity_W + state.angular_velocity_W.cross(arm);
}

double DistanceToSegment(const Vector3& p, const Vector3& a, const Vector3& b) {
  const double length = (b - a).squaredNorm();
  const double share = length > 0 ? std::clamp((p - a).dot(b - a) / length, 0.0, 1.0) : 0;
  return (p - a - share * (b - a)).norm();
}

double DistanceToTriangle(const Vector3& p, const Vector3& a, const Vector3& b, const Vector3& c) {
  const double edges = std::min({DistanceToSegment(p, a, b), DistanceToSegment(p, b, c), DistanceToSegment(p, c, a)});
  const Vector3 normal = (b - a).cross(c - a);
  const double area = normal.squaredNorm();
  const auto inside = [&](const Vector3& from, const Vector3& to) {
    return (to - from).cross(p - from).dot(normal) >= 0;
  };
  if (area == 0 || !inside(a, b) || !inside(b, c) || !inside(c, a)) return edges;
  return std::min(edges, std::abs((p - a).dot(normal)) / std::sqrt(area));
}

}  // namespace

CoulombMeter::CoulombMeter(const peers::WorldPlan& plan) : plan_(plan) {
  if (plan.gravity.isZero()) throw std::invalid_argument("gravity = 0: the Coulomb error has no unit");
}

CoulombError CoulombMeter::Measure(std::span<const State> before, std::span<const State> after, double dt) {
  MeasureMomentum(before, after, dt);
  FindContacts(before, after, dt);
  SetSlopes();
  const double unit = plan_.gravity.norm() * dt;  // [m/s]
  double mass = 0;
  for (const peers::BodyPlan& body : plan_.bodies) mass += body.mass;
  CoulombError result{.contacts = static_cast<int>(contacts_.size())};
  result.iterations = contacts_.empty() ? 0 : Fit(mass * unit * unit);
  Explain(&Fitted::impulse);

  std::vector<double> momentum(plan_.bodies.size()), map(plan_.bodies.size());  // [J] twice the energy
  for (size_t i = 0; i < plan_.bodies.size(); ++i) {
    if (!plan_.bodies[i].Moves()) continue;
    const Twist& left = unexplained_[i];
    momentum[i] = plan_.bodies[i].mass * left.linear.squaredNorm() +
                  left.angular.dot(inverse_inertia_[i].inverse() * left.angular);
  }
  std::vector<bool> touches(plan_.bodies.size(), false), settled = touches, collides = touches;
  for (const Fitted& c : contacts_) {
    const double square = c.response * (c.impulse - Project(c.impulse - c.slip / c.response, c.normal)).squaredNorm();
    const bool both = plan_.bodies[c.body_a].Moves() && plan_.bodies[c.body_b].Moves();
    map[c.body_a] += both ? 0.5 * square : square;
    map[c.body_b] += both ? 0.5 * square : square;
    touches[c.body_a] = touches[c.body_b] = true;
    if (c.closed) settled[c.body_a] = settled[c.body_b] = true;
    if (c.collides) collides[c.body_a] = collides[c.body_b] = true;
  }
  for (size_t i = 0; i < plan_.bodies.size(); ++i) {
    const peers::BodyPlan& body = plan_.bodies[i];
    if (!body.Moves()) continue;
    const double scale = 1 / (body.mass * unit * unit);
    if (!touches[i] && scale * momentum[i] < kFlies * kFlies) continue;
    ++result.candidates;
    if (collides[i]) continue;
    ++result.judged;
    const double share = dt / kUnitTime;
    const double displacement = 2 * share * share * Untold(static_cast<int>(i), before[i], after[i], dt, settled[i]);
    result.momentum += scale * momentum[i];
    result.natural_map += scale * map[i];
    result.displacement += scale * displacement;
    result.told += std::min(1.0, std::sqrt(scale * (momentum[i] + map[i])));
    result.error += std::min(1.0, std::sqrt(scale * (momentum[i] + map[i] + displacement)));
  }
  if (result.judged == 0) return result;
  result.error /= result.judged;
  result.told /= result.judged;
  result.momentum = std::sqrt(result.momentum / result.judged);
  result.natural_map = std::sqrt(result.natural_map / result.judged);
  result.displacement = std::sqrt(result.displacement / result.judged);
  return result;
}

double CoulombMeter::Untold(int body, const State& before, const State& after, double dt, bool settled) const {
  const Vector3 mean = (after.position_W - before.position_W) / dt;
  const Vector3& from = before.linear_velocity_W;
  const peers::BodyPlan& plan = plan_.bodies[body];
  const Vector3 fallen = settled ? from : (from + dt * (plan_.gravity + plan.push_W / plan.mass)).eval();
  const double rounding = kRounding * std::max(before.position_W.norm(), after.position_W.norm()) / dt;
  const double linear = std::max(0.0, DistanceToTriangle(mean, from, after.linear_velocity_W, fallen) - rounding);

  const Eigen::AngleAxisd turned(after.rotation_WB * before.rotation_WB.conjugate());
  const Vector3 &spin = before.angular_velocity_W, &spin_after = after.angular_velocity_W;
  const Vector3 mean_spin = turned.angle() / dt * turned.axis();
  const double fastest = std::max(spin.norm(), spin_after.norm());
  const double rule = fastest * fastest * fastest * dt * dt / 6;  // [rad/s] twice what a rule of first order leaves out
  const double angular = std::max(0.0, DistanceToSegment(mean_spin, spin, spin_after) - rule - 2 * kRounding / dt);
  const double moment = plan.Inertia().maxCoeff();
  return plan.mass * linear * linear + moment * angular * angular;
}

void CoulombMeter::MeasureMomentum(std::span<const State> before, std::span<const State> after, double dt) {
  inverse_mass_.assign(plan_.bodies.size(), 0);
  inverse_inertia_.assign(plan_.bodies.size(), Matrix3::Zero());
  gained_.assign(plan_.bodies.size(), {});
  for (size_t i = 0; i < plan_.bodies.size(); ++i) {
    const peers::BodyPlan& body = plan_.bodies[i];
    if (!body.Moves()) continue;
    const Vector3 moments = body.Inertia();
    const auto turned = [&](const State& s, const Vector3& diagonal) -> Matrix3 {
      const Matrix3 r = s.rotation_WB.toRotationMatrix();
      return r * diagonal.asDiagonal() * r.transpose();
    };
    inverse_mass_[i] = 1 / body.mass;
    inverse_inertia_[i] = turned(before[i], moments.cwiseInverse());
    gained_[i].linear =
        body.mass * (after[i].linear_velocity_W - before[i].linear_velocity_W - plan_.gravity * dt) - body.push_W * dt;
    gained_[i].angular = turned(after[i], moments) * after[i].angular_velocity_W -
                         turned(before[i], moments) * before[i].angular_velocity_W;
  }
}

void CoulombMeter::FindContacts(std::span<const State> before, std::span<const State> after, double dt) {
  double fastest = 0;  // [m/s] any point of any body, roughly
  for (size_t i = 0; i < before.size(); ++i) {
    if (plan_.bodies[i].Moves())
      fastest = std::max(fastest, before[i].linear_velocity_W.norm() + before[i].angular_velocity_W.norm());
  }
  const double falls = plan_.gravity.norm() * dt * dt;  // [m] what closes in a step from rest
  const double reach = kTouch + falls + 2 * fastest * dt;
  found_.clear();
  ForEachNearPair(plan_, before, reach, [&](int a, int b) { AppendContacts(plan_, before, a, b, reach, &found_); });
  contacts_.clear();
  for (const ContactPoint& point : found_) {
    Fitted c{.body_a = point.body_a, .body_b = point.body_b, .normal = point.normal_W};
    c.arm_a = point.point_W - before[c.body_a].position_W;
    c.arm_b = point.point_W - before[c.body_b].position_W;
    const auto relative = [&](std::span<const State> states) -> Vector3 {
      return VelocityAt(states[c.body_b], c.arm_b) - VelocityAt(states[c.body_a], c.arm_a);
    };
    const double approach = std::max(0.0, -c.normal.dot(relative(before)));
    if (point.gap > kTouch + falls + approach * dt) continue;
    const Vector3 u = relative(after);
    double normal_speed = c.normal.dot(u);
    const Vector3 tangential = u - normal_speed * c.normal;
    const double most = plan_.restitution * approach;
    if (normal_speed > 0) normal_speed = std::max(0.0, normal_speed - most);
    if (point.gap > kClosed) normal_speed = std::max(0.0, normal_speed);
    const Vector3 lifted = tangential + plan_.friction * tangential.norm() * c.normal;
    c.slip = dt / kUnitTime * (lifted + normal_speed * c.normal);
    c.offer = dt / kUnitTime * (lifted + std::max(0.0, normal_speed) * c.normal);
    c.closed = point.gap <= kClosed;
    c.collides = approach > kCollision * plan_.gravity.norm() && point.gap > -(kTouch + approach * dt);
    contacts_.push_back(c);
  }
  // Begin with the impulses that the same pairs had when last looked at, each point with that of the nearest one.
  for (Fitted& c : contacts_) {
    const auto known = remembered_.find({c.body_a, c.body_b});
    if (known == remembered_.end()) continue;
    const auto distance = [&](const Remembered& r) { return (r.arm_b - c.arm_b).squaredNorm(); };
    c.impulse = Project(std::ranges::min_element(known->second, {}, distance)->impulse, c.normal);
  }
}

// |sum of n terms|^2 <= n sum |term|^2 at each body bounds the curvature by one number a contact.
void CoulombMeter::SetSlopes() {
  std::vector<int> count(plan_.bodies.size(), 0);
  for (const Fitted& c : contacts_) {
    ++count[c.body_a];
    ++count[c.body_b];
  }
  for (Fitted& c : contacts_) {
    c.response = c.slope = 0;
    const auto add = [&](int body, const Vector3& arm) {
      Matrix3 cross;
      cross << 0, -arm.z(), arm.y(), arm.z(), 0, -arm.x(), -arm.y(), arm.x(), 0;
      const double turning = (cross.transpose() * inverse_inertia_[body] * cross).trace();
      c.response += inverse_mass_[body] + turning / 3;
      c.slope += count[body] * (inverse_mass_[body] + turning);
    };
    add(c.body_a, c.arm_a);
    add(c.body_b, c.arm_b);
  }
}

// Projected gradients with momentum, which is dropped when it points uphill. Returns the number of iterations.
int CoulombMeter::Fit(double unit_energy) {
  const int most =
      std::clamp(static_cast<int>(kWork / static_cast<double>(contacts_.size())), kLeastIterations, kMostIterations);
  double theta = 1;
  for (Fitted& c : contacts_) c.ahead = c.last = c.impulse;
  int done = 0;
  while (done < most) {
    ++done;
    Explain(&Fitted::ahead);
    double moved = 0, uphill = 0;
    for (Fitted& c : contacts_) {
      c.last = c.impulse;
      c.impulse = Project(c.ahead - (At(unexplained_, c) + c.offer) / c.slope, c.normal);
      moved += c.slope * (c.impulse - c.ahead).squaredNorm();
      uphill += c.slope * (c.ahead - c.impulse).dot(c.impulse - c.last);
    }
    if (moved < kConverged * kConverged * unit_energy) break;
    const double next = uphill > 0 ? 1 : 0.5 * (1 + std::sqrt(1 + 4 * theta * theta));
    const double share = uphill > 0 ? 0 : (theta - 1) / next;
    theta = next;
    for (Fitted& c : contacts_) c.ahead = c.impulse + share * (c.impulse - c.last);
  }
  remembered_.clear();
  for (const Fitted& c : contacts_) remembered_[{c.body_a, c.body_b}].push_back({c.arm_b, c.impulse});
  return done;
}

void CoulombMeter::Explain(Vector3 Fitted::*impulse) {
  unexplained_.assign(plan_.bodies.size(), {});
  for (const Fitted& c : contacts_) {
    const Vector3& f = c.*impulse;
    unexplained_[c.body_a].linear -= f;
    unexplained_[c.body_a].angular -= c.arm_a.cross(f);
    unexplained_[c.body_b].linear += f;
    unexplained_[c.body_b].angular += c.arm_b.cross(f);
  }
  for (size_t i = 0; i < unexplained_.size(); ++i) {
    unexplained_[i].linear = inverse_mass_[i] * (unexplained_[i].linear - gained_[i].linear);
    unexplained_[i].angular = inverse_inertia_[i] * (unexplained_[i].angular - gained_[i].angular);
  }
}

Vector3 CoulombMeter::At(const std::vector<Twist>& twists, const Fitted& c) const {
  const Twist &a = twists[c.body_a], &b = twists[c.body_b];
  return b.linear + b.angular.cross(c.arm_b) - a.linear - a.angular.cross(c.arm_a);
}

// Onto the cone |f_t| <= mu f_n.
Vector3 CoulombMeter::Project(const Vector3& impulse, const Vector3& normal) const {
  const double mu = plan_.friction, along = normal.dot(impulse);
  const Vector3 across = impulse - along * normal;
  const double length = across.norm();
  if (mu * length <= -along) return Vector3::Zero();
  if (length <= mu * along) return impulse;
  const double share = (along + mu * length) / (1 + mu * mu);
  return share * (normal + (length > 0 ? mu / length : 0) * across);
}

}  // namespace islet::charts
