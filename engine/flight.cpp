#include "engine/flight.h"

#include <algorithm>
#include <cmath>

#include "engine/rotation.h"

namespace islet {
namespace {

// Two that fly side by side and touch, closing at less than this share of their speed, are parted by a correction: to stop both
// would cost more than to move them aside, and in a falling crowd everyone would wait for everyone.
constexpr double kHeadOn = 0.5;
constexpr double kSameMoment = 1e-12;  // of a duration: two bodies fly on together
constexpr double kPolished = 1e-3;     // of the overlap tolerance: a gap that small is none
constexpr int kForwardRounds = 4;      // later ones only go back, so that they end
constexpr double kBegins = 1e-2;  // of the overlap tolerance: contacts open by more at the start are met on the way

}  // namespace

void Flights::Begin(std::span<const double> durations, std::span<const Motion> motions, std::span<const Twist> before,
                    std::span<const Body> bodies) {
  motions_.assign(motions.begin(), motions.end());
  left_.assign(bodies.size(), 0.0);
  paths_.resize(bodies.size());
  for (size_t i = 0; i < bodies.size(); ++i) {
    const Body& body = bodies[i];
    if (!body.Moves()) Ground(static_cast<int>(i));
    if (!flies(static_cast<int>(i))) continue;
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

bool Flights::GlidesOn(int body, const Body& other) const {
  return motions_[body] == Motion::kGlides && other.kind != BodyKind::kDynamic;
}

bool Flights::FindMoments(int round, std::span<const Contact> contacts, std::span<const double> gaps,
                          std::span<const double> tolerances, std::span<const Body> bodies,
                          std::vector<std::uint8_t>* handled) {
  wanted_.assign(left_.size(), 0.0);
  handled->assign(contacts.size(), 0);
  bool changes = false;
  for (size_t c = 0; c < contacts.size(); ++c) {
    const Contact& contact = contacts[c];
    const int a = contact.body_a, b = contact.body_b;
    if (!flies(a) && !flies(b)) continue;
    if (GlidesOn(a, bodies[b]) || GlidesOn(b, bodies[a])) continue;
    // Who has more time left was stopped by something else and stands; the other one comes to meet it.
    const bool both = flies(a) && flies(b);
    const bool together = both && std::abs(left_[a] - left_[b]) <= kSameMoment * paths_[a].duration;
    const bool a_moves = together || (both ? left_[a] < left_[b] : flies(a));
    const bool b_moves = together || (both ? left_[b] < left_[a] : flies(b));
    const int mover = a_moves ? a : b;
    const double tolerance = std::min(tolerances[a], tolerances[b]);
    const bool on_the_way = round == 0 && contact.gap > kBegins * tolerance;
    const bool met = gaps[c] < (on_the_way ? 0 : -0.5 * tolerance);
    if (!met && left_[mover] == 0) continue;
    double closing = 0;  // [m/s]
    if (a_moves) closing += contact.normal_W.dot(PointVelocity(a, contact, bodies[a]));
    if (b_moves) closing -= contact.normal_W.dot(PointVelocity(b, contact, bodies[b]));
    if (closing <= 0 || (together && closing < kHeadOn * std::max(Speed(a), Speed(b)))) continue;
    const double moment = left_[mover] - gaps[c] / closing;
    const double begin = together ? std::min(paths_[a].duration, paths_[b].duration) : paths_[mover].duration;
    if (!(moment <= (both && !together ? std::max(left_[a], left_[b]) : begin))) continue;
    (*handled)[c] = 1;
    if (a_moves) wanted_[a] = std::max(wanted_[a], moment);
    if (b_moves) wanted_[b] = std::max(wanted_[b], moment);
    changes = changes || met || std::abs(gaps[c]) > kPolished * tolerance;
  }
  bool moved = false;
  for (size_t i = 0; i < left_.size(); ++i) {
    if (round >= kForwardRounds) wanted_[i] = std::max(wanted_[i], left_[i]);
    if (!flies(static_cast<int>(i)) || wanted_[i] == left_[i]) continue;
    if (wanted_[i] == 0) changes = true;
    moved = true;
  }
  if (!changes || !moved) return false;
  for (size_t i = 0; i < left_.size(); ++i)
    if (flies(static_cast<int>(i))) left_[i] = wanted_[i];
  return true;
}

}  // namespace islet
