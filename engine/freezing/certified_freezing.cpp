#include "engine/freezing/certified_freezing.h"

#include <algorithm>
#include <utility>

#include "islands/disjoint_sets.h"

namespace islet {
namespace {

constexpr double kBalanced =
    10;  // times the tolerance: imbalance that counts as none, of the impulses that act on the body
constexpr double kWrong = 10;    // times what the answer is wrong by: velocity that may be its error
constexpr double kAlike = 1e-2;  // of a force: a change that leaves it what it was

bool JoinsDynamic(const SuiteFrame& frame, const Contact& contact) {
  return frame.bodies[contact.body_a].kind == BodyKind::kDynamic &&
         frame.bodies[contact.body_b].kind == BodyKind::kDynamic;
}

}  // namespace

void CertifiedFreezing::FindIslands(const SuiteFrame& frame) {
  roots_.resize(frame.bodies.size());
  islands::DisjointSets islands(roots_);
  for (const Contact& contact : frame.contacts.contacts)
    if (JoinsDynamic(frame, contact)) islands.Union(contact.body_a, contact.body_b);
  for (size_t i = 0; i < roots_.size(); ++i) roots_[i] = islands.Find(static_cast<int>(i));
  moves_.assign(frame.bodies.size(), 0);
  for (const Contact& contact : frame.contacts.contacts) {
    if (JoinsDynamic(frame, contact)) continue;
    const Body &a = frame.bodies[contact.body_a], &b = frame.bodies[contact.body_b];
    const bool wall_moves =
        (a.kind != BodyKind::kDynamic && !StandsStill(a)) || (b.kind != BodyKind::kDynamic && !StandsStill(b));
    if (wall_moves) moves_[roots_[contact.body_a]] = moves_[roots_[contact.body_b]] = 1;
  }
}

// Impulses of frozen bodies can leave their cones: a material callback may have lowered the friction since.
void CertifiedFreezing::SumLoads(const SuiteFrame& frame) {
  loads_.assign(frame.bodies.size(), {});
  held_.assign(frame.bodies.size(), 0);
  for (size_t i = 0; i < frame.bodies.size(); ++i) {
    const Body& body = frame.bodies[i];
    if (body.kind != BodyKind::kDynamic) continue;
    Load& load = loads_[i];
    load.linear = frame.dt * (body.mass * frame.gravity + body.force_W);
    load.angular = frame.dt * body.torque_W;
    load.size = load.linear.norm() + load.angular.norm() / body.radius;
  }
  for (size_t c = 0; c < frame.contacts.contacts.size(); ++c) {
    const Contact& contact = frame.contacts.contacts[c];
    const Vector3 local = frame.bounces[c] + frame.collisions[c] + frame.holding[c];
    if (local.isZero(0)) continue;
    const Vector3 impulse_W = frame.frames[c] * local;
    const double size = local.norm(), outside = (local.tail<2>().norm() - contact.friction * local[0]) / size;
    for (const auto& [i, sign] : {std::pair{contact.body_a, -1.0}, std::pair{contact.body_b, 1.0}}) {
      Load& load = loads_[i];
      load.linear += sign * impulse_W;
      load.angular += sign * (contact.point_W - frame.bodies[i].position_W).cross(impulse_W);
      load.size += size;
      load.outside = std::max(load.outside, outside);
      held_[i] = 1;
    }
  }
}

double CertifiedFreezing::Imbalance(const Body& body, const Load& load) {
  const double sum = load.linear.norm() + load.angular.norm() / body.radius;
  return load.size > 0 ? sum / load.size : 0;
}

bool CertifiedFreezing::IsBalanced(const Body& body, const Load& load, const Settings& settings) {
  return std::max(load.outside, Imbalance(body, load)) <= kBalanced * settings.tolerance;
}

void CertifiedFreezing::TrackStillness(const Body& body, const Settings& settings, double dt, Stillness* still) {
  const Vector3 force_W = body.mass * settings.gravity + body.force_W;
  const auto size = [&](const Vector3& force, const Vector3& torque) {
    return force.norm() + torque.norm() / body.radius;
  };
  const bool alike =
      size(force_W - still->force_W, body.torque_W - still->torque_W) <= kAlike * size(force_W, body.torque_W);
  // Twice the chord between unit quaternions is the angle, where that is small; either sign is the same rotation.
  const double turned = 2 * std::min((body.rotation_WB.coeffs() - still->rotation_WB.coeffs()).norm(),
                                     (body.rotation_WB.coeffs() + still->rotation_WB.coeffs()).norm());
  const double travel = (body.position_W - still->position_W).norm() + body.radius * turned;
  if (alike && travel <= settings.freeze_travel * body.radius) {
    still->seconds += dt;
  } else {
    *still = {body.position_W, body.rotation_WB, force_W, body.torque_W, 0};
  }
}

void CertifiedFreezing::BeginFrame(const SuiteFrame& frame, const Settings& settings) {
  const size_t known = still_.size();
  still_.resize(frame.bodies.size());
  for (size_t i = 0; i < frame.bodies.size(); ++i) {
    const Body& body = frame.bodies[i];
    if (i >= known)
      still_[i] = {body.position_W, body.rotation_WB, body.mass * settings.gravity + body.force_W, body.torque_W, 0};
    if (body.Moves()) TrackStillness(body, settings, frame.dt, &still_[i]);
  }
  Wake(frame, settings);
}

void CertifiedFreezing::Wake(const SuiteFrame& frame, const Settings& settings) {
  if (std::none_of(frame.bodies.begin(), frame.bodies.end(), [](const Body& body) { return body.frozen; })) return;
  FindIslands(frame);
  SumLoads(frame);
  for (size_t i = 0; i < frame.bodies.size(); ++i) {
    const Body& body = frame.bodies[i];
    if (body.kind != BodyKind::kDynamic || body.removed) continue;
    if (!body.frozen || !held_[i] || !IsBalanced(body, loads_[i], settings)) moves_[roots_[i]] = 1;
  }
  for (size_t i = 0; i < frame.bodies.size(); ++i)
    if (moves_[roots_[i]]) frame.bodies[i].frozen = false;
}

// Of the islands that freeze now.
void CertifiedFreezing::StopIslands(const SuiteFrame& frame, const Settings& settings) {
  const int bodies = static_cast<int>(frame.bodies.size()), contacts = static_cast<int>(frame.contacts.contacts.size());
  const auto rests = [&](int i) {
    return frame.bodies[i].kind == BodyKind::kDynamic && !frame.bodies[i].removed && !moves_[roots_[i]];
  };
  stops_.clear();
  freezing_.clear();
  holding_.clear();
  fresh_.assign(frame.bodies.size(), 0);
  for (int i = 0; i < bodies; ++i)
    if (rests(i) && !frame.bodies[i].frozen) fresh_[roots_[i]] = 1;
  const auto freezes = [&](int i) { return rests(i) && fresh_[roots_[i]]; };
  for (int i = 0; i < bodies; ++i)
    if (freezes(i)) freezing_.emplace_back(roots_[i], i);
  if (freezing_.empty()) return;
  for (int c = 0; c < contacts; ++c) {
    const Contact& contact = frame.contacts.contacts[c];
    const int body = freezes(contact.body_a) ? contact.body_a : contact.body_b;
    if (freezes(body) && frame.holding[c][0] > 0) holding_.emplace_back(roots_[body], c);
  }
  std::sort(freezing_.begin(), freezing_.end());
  std::sort(holding_.begin(), holding_.end());
  for (size_t i = 0, c = 0; i < freezing_.size();) {
    const int root = freezing_[i].first;
    members_.clear();
    contacts_.clear();
    for (; i < freezing_.size() && freezing_[i].first == root; ++i) members_.push_back(freezing_[i].second);
    for (; c < holding_.size() && holding_[c].first == root; ++c) contacts_.push_back(holding_[c].second);
    StopIsland(frame, settings);
  }
}

// Stops it and balances what holds it, or lets it move on where impulses within their cones cannot.
void CertifiedFreezing::StopIsland(const SuiteFrame& frame, const Settings& settings) {
  stopping_.Prepare(frame, members_, contacts_);
  limits_.clear();
  wanted_.resize(members_.size());
  for (size_t k = 0; k < members_.size(); ++k) {
    const Body& body = frame.bodies[members_[k]];
    wanted_[k] << -body.mass * body.linear_velocity_W, -body.AngularMomentumW() / body.radius;
    limits_.push_back(kCalm * loads_[members_[k]].size);
  }
  if (!FindImpulses(frame, settings, &stop_)) {
    moves_[roots_[members_[0]]] = 1;
    return;
  }
  for (size_t k = 0; k < members_.size(); ++k) {
    const Load& load = loads_[members_[k]];
    wanted_[k] << -load.linear, -load.angular / frame.bodies[members_[k]].radius;
  }
  if (!FindImpulses(frame, settings, &balance_)) {
    moves_[roots_[members_[0]]] = 1;
    return;
  }
  for (size_t k = 0; k < contacts_.size(); ++k) stops_.push_back({contacts_[k], stop_[k], balance_[k]});
}

// None where they would leave their cones. Returns whether they give what is wanted.
bool CertifiedFreezing::FindImpulses(const SuiteFrame& frame, const Settings& settings,
                                     std::vector<Vector3>* impulses) {
  const bool found = stopping_.Find(wanted_, limits_, impulses);
  for (size_t k = 0; k < contacts_.size(); ++k) {
    const Vector3 all = frame.holding[contacts_[k]] + (*impulses)[k];
    const double outside = all.tail<2>().norm() - frame.contacts.contacts[contacts_[k]].friction * all[0];
    if (outside <= kBalanced * settings.tolerance * all.norm()) continue;
    std::fill(impulses->begin(), impulses->end(), Vector3::Zero());
    return false;
  }
  return found;
}

void CertifiedFreezing::EndFrame(const SuiteFrame& frame, const std::vector<std::uint8_t>& was_frozen,
                                 const std::vector<double>& errors, const Settings& settings) {
  FindIslands(frame);
  SumLoads(frame);
  worst_imbalance_ = 0;
  const double calm = kBalanced * settings.tolerance * std::max(frame.rest_speed, 1e-12);
  for (size_t i = 0; i < frame.bodies.size(); ++i) {
    const Body& body = frame.bodies[i];
    if (body.kind != BodyKind::kDynamic || body.removed || body.frozen) continue;
    const bool still = held_[i] && (was_frozen[i] || still_[i].seconds >= settings.freeze_seconds) &&
                       FastestPoint(TwistOf(body), body.radius) <= kWrong * errors[i] + calm &&
                       IsBalanced(body, loads_[i], settings);
    if (!still) moves_[roots_[i]] = 1;
  }
  StopIslands(frame, settings);
  for (size_t i = 0; i < frame.bodies.size(); ++i) {
    Body& body = frame.bodies[i];
    if (body.kind != BodyKind::kDynamic || body.removed) continue;
    body.frozen = !moves_[roots_[i]];
    if (!body.frozen) continue;
    SetTwist({}, &body);
    worst_imbalance_ = std::max(worst_imbalance_, Imbalance(body, loads_[i]));
  }
}

}  // namespace islet
