#include "engine/flight.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "engine/rotation.h"
#include "engine/suite_frame.h"

namespace islet {
namespace {

constexpr double kNever = std::numeric_limits<double>::infinity();
constexpr double kSameMoment = 1e-12;  // of a duration: two bodies fly on together
constexpr double kPolished = 1e-3;     // of the overlap tolerance: a gap that small is none
constexpr int kForwardRounds = 4;      // later ones only go back, so that they end
constexpr int kPatientRounds = 8;      // later ones put what still overlaps back to where it began
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
    const bool a_flies = flies(a), b_flies = flies(b);
    if (!a_flies && !b_flies) continue;
    if (GlidesOn(a, bodies[b]) || GlidesOn(b, bodies[a])) continue;
    const auto leaves_way = [&](int i) { return flies(i) || StandsStill(bodies[i]); };
    const bool alone = leaves_way(a) && leaves_way(b);
    handled->at(c) = alone;
    const double tolerance = std::min(tolerances[a], tolerances[b]);
    const double gap = gaps[c];
    const bool held = (a_flies && left_[a] > 0) || (b_flies && left_[b] > 0);
    const bool met = round == 0 ? gap < (contact.gap > kBegins * tolerance ? 0 : -0.5 * tolerance) : gap < -tolerance;
    if (!met && !held) continue;
    // Who has more time left has been stopped by something else and stands at that moment; the other one comes to meet it.
    const double same = kSameMoment * (a_flies ? paths_[a].duration : paths_[b].duration);
    const bool together = a_flies && b_flies && std::abs(left_[a] - left_[b]) <= same;
    const bool a_moves = a_flies && (together || !b_flies || left_[a] < left_[b]);
    const bool b_moves = b_flies && (together || !a_flies || left_[b] < left_[a]);
    double closing = 0;  // [m/s]
    if (a_moves) closing += contact.normal_W.dot(PointVelocity(a, contact, bodies[a]));
    if (b_moves) closing -= contact.normal_W.dot(PointVelocity(b, contact, bodies[b]));
    const int mover = a_moves ? a : b;
    const double earliest = std::min(a_moves ? paths_[a].duration : kNever, b_moves ? paths_[b].duration : kNever);
    if (closing <= 0 && !met) continue;
    double moment = closing > 0 ? left_[mover] - gap / closing : kNever;
    if (met && a_flies && b_flies && !together) moment = std::min(moment, std::max(left_[a], left_[b]));
    if (!(moment <= earliest) || (met && alone && round >= kPatientRounds)) {
      if (!met || !alone) continue;
      // Their own ways do not part them soon: they go back towards where they began, where nothing overlapped.
      const double share = round < kForwardRounds ? 0.5 : 1;
      for (const int i : {a, b})
        if (flies(i)) wanted_[i] = std::max(wanted_[i], left_[i] + share * (paths_[i].duration - left_[i]));
      changes = true;
      continue;
    }
    handled->at(c) = 1;
    if (a_moves) wanted_[a] = std::max(wanted_[a], moment);
    if (b_moves) wanted_[b] = std::max(wanted_[b], moment);
    changes = changes || met || std::abs(gap) > kPolished * tolerance;
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
