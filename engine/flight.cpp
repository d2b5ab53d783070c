#include "engine/flight.h"

#include <algorithm>
#include <cmath>

#include "engine/rotation.h"
#include "engine/suite_frame.h"

namespace islet {
namespace {

constexpr double kPolished = 1e-5;  // of the overlap tolerance: a gap that small is none
constexpr int kForwardRounds = 4;   // later ones only go back, so that they end
constexpr double kBegins = 1e-2;    // of the overlap tolerance: contacts open by more at the start are met on the way

}  // namespace

void Flights::Begin(std::span<const double> durations, std::span<const std::uint8_t> flies,
                    std::span<const Twist> before, std::span<const Body> bodies) {
  flies_.assign(flies.begin(), flies.end());
  left_.assign(bodies.size(), 0.0);
  paths_.resize(bodies.size());
  walls_.resize(bodies.size());
  for (size_t i = 0; i < bodies.size(); ++i) {
    const Body& body = bodies[i];
    if (!body.Moves()) Ground(static_cast<int>(i));
    if (!flies_[i]) continue;
    paths_[i] = {
        body.position_W, body.rotation_WB, before[i], {body.linear_velocity_W, body.angular_velocity_W}, durations[i]};
  }
}

Twist Flights::VelocityAt(int body) const {
  const Path& path = paths_[body];
  const double share = 1 - left_[body] / path.duration;
  return {path.begin.linear_W + share * (path.end.linear_W - path.begin.linear_W),
          path.begin.angular_W + share * (path.end.angular_W - path.begin.angular_W)};
}

Vector3 Flights::PointVelocity(int body, const Contact& contact, const Body& now) const {
  const Twist twist = VelocityAt(body);
  return twist.linear_W + twist.angular_W.cross(contact.point_W - now.position_W);
}

void Flights::Place(int body, Body* moved) const {
  const Path& path = paths_[body];
  const Twist now = VelocityAt(body);
  const double flown = path.duration - left_[body];
  moved->position_W = path.position_W + 0.5 * flown * (path.begin.linear_W + now.linear_W);
  moved->linear_velocity_W = now.linear_W;
  const Vector3 turn =
      FreeRotation(moved->inertia_B, path.rotation_WB, 0.5 * (path.begin.angular_W + now.angular_W), flown);
  moved->rotation_WB = path.rotation_WB;
  if (!turn.isZero(0)) moved->rotation_WB = Quaternion(Exp(turn) * path.rotation_WB).normalized();
  moved->angular_velocity_W =
      AngularVelocityAfter(moved->inertia_B, path.rotation_WB, now.angular_W, moved->rotation_WB);
}

bool Flights::AnyStopped() const {
  return std::any_of(left_.begin(), left_.end(), [](double left) { return left > 0; });
}

Vector3 Flights::Missing(int body, double mass) const {
  const Path& path = paths_[body];
  return -mass * left_[body] / path.duration * (path.end.linear_W - path.begin.linear_W);
}

bool Flights::FindMoments(int round, std::span<const Contact> contacts, std::span<const double> gaps,
                          std::span<const double> tolerances, std::span<const Body> bodies,
                          std::vector<std::uint8_t>* handled) {
  wanted_.assign(left_.size(), 0.0);
  handled->assign(contacts.size(), 0);
  bool changes = false;
  for (size_t c = 0; c < contacts.size(); ++c) {
    const Contact& contact = contacts[c];
    const bool a_flies = flies(contact.body_a);
    if (!a_flies && !flies(contact.body_b)) continue;
    const int mover = a_flies ? contact.body_a : contact.body_b, wall = a_flies ? contact.body_b : contact.body_a;
    if (bodies[wall].kind == BodyKind::kDynamic || !StandsStill(bodies[wall])) continue;
    const double tolerance = std::min(tolerances[mover], tolerances[wall]);
    const bool on_the_way = round == 0 && contact.gap > kBegins * tolerance;
    const bool met = gaps[c] < (on_the_way ? 0 : -0.5 * tolerance);
    if (!met && left_[mover] == 0) continue;
    const double speed = contact.normal_W.dot(PointVelocity(mover, contact, bodies[mover]));
    const double closing = a_flies ? speed : -speed;
    if (closing <= 0) continue;
    const double moment = left_[mover] - gaps[c] / closing;
    if (!(moment <= paths_[mover].duration)) continue;
    (*handled)[c] = 1;
    if (moment > wanted_[mover]) {
      wanted_[mover] = moment;
      walls_[mover] = contact;
    }
    changes = changes || met || std::abs(gaps[c]) > kPolished * tolerance;
  }
  bool moved = false;
  for (size_t i = 0; i < left_.size(); ++i) {
    if (round >= kForwardRounds) wanted_[i] = std::max(wanted_[i], left_[i]);
    if (!flies_[i] || wanted_[i] == left_[i]) continue;
    if (wanted_[i] == 0) changes = true;
    moved = true;
  }
  if (!changes || !moved) return false;
  for (size_t i = 0; i < left_.size(); ++i)
    if (flies_[i]) left_[i] = wanted_[i];
  return true;
}

}  // namespace islet
