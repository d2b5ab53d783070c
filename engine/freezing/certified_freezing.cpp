#include "engine/freezing/certified_freezing.h"

#include <algorithm>
#include <utility>

#include "islands/disjoint_sets.h"

namespace islet {
namespace {

constexpr double kMargin = 10;  // times the tolerance, or what an answer is wrong by: as much may be error

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

bool CertifiedFreezing::NoneIsFrozen(const SuiteFrame& frame) {
  return std::none_of(frame.bodies.begin(), frame.bodies.end(), [](const Body& body) { return body.frozen; });
}

void CertifiedFreezing::StartLoad(const SuiteFrame& frame, int i) {
  const Body& body = frame.bodies[i];
  if (body.kind != BodyKind::kDynamic) return;
  Load& load = loads_[i];
  load.linear = frame.dt * (body.mass * frame.gravity + body.force_W);
  load.angular = frame.dt * body.torque_W;
  load.own = load.size = load.linear.norm() + load.angular.norm() / body.radius;
}

void CertifiedFreezing::AddLoad(const SuiteFrame& frame, const Contact& contact, const Vector3& impulse_W) {
  const double size = impulse_W.norm();
  for (const auto& [i, sign] : {std::pair{contact.body_a, -1.0}, std::pair{contact.body_b, 1.0}}) {
    Load& load = loads_[i];
    load.linear += sign * impulse_W;
    load.angular += sign * (contact.point_W - frame.bodies[i].position_W).cross(impulse_W);
    load.size += size;
  }
}

// Impulses of frozen bodies can leave their cones: a material callback may have lowered the friction since.
void CertifiedFreezing::SumLoads(const SuiteFrame& frame) {
  loads_.assign(frame.bodies.size(), {});
  held_.assign(frame.bodies.size(), 0);
  for (size_t i = 0; i < frame.bodies.size(); ++i) StartLoad(frame, static_cast<int>(i));
  for (size_t c = 0; c < frame.contacts.contacts.size(); ++c) {
    const Contact& contact = frame.contacts.contacts[c];
    Vector3 local = frame.holding[c];
    if (whole_) local += frame.bounces[c] + frame.collisions[c];
    if (local.isZero(0)) continue;
    AddLoad(frame, contact, frame.frames[c] * local);
    const double outside = local.tail<2>().norm() - contact.friction * local[0];
    for (const int i : {contact.body_a, contact.body_b}) {
      loads_[i].outside = std::max(loads_[i].outside, outside);
      held_[i] = 1;
    }
  }
}

double CertifiedFreezing::Imbalance(const Body& body, const Load& load) {
  const double sum = load.linear.norm() + load.angular.norm() / body.radius;
  return load.size > 0 ? sum / load.size : 0;
}

// Who never holds has to see here what a load far above a body's own weight would hide.
bool CertifiedFreezing::IsBalanced(const Body& body, const Load& load, const Settings& settings) const {
  const double most = kMargin * settings.tolerance, imbalance = Imbalance(body, load);
  const bool shows = whole_ && imbalance * load.size > most * load.own && imbalance > kCalm;
  return load.outside <= most * load.size && imbalance <= most && !shows;
}

void CertifiedFreezing::TrackStillness(const Body& body, const Settings& settings, double dt, Stillness* still) {
  const Vector3 force_W = body.mass * settings.gravity + body.force_W;
  const auto size = [&](const Vector3& force, const Vector3& torque) {
    return force.norm() + torque.norm() / body.radius;
  };
  const bool alike =
      size(force_W - still->force_W, body.torque_W - still->torque_W) <= kTrembling * size(force_W, body.torque_W);
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

void CertifiedFreezing::BeginFrame(const SuiteFrame& frame, const Settings& settings, std::vector<Stillness>* still) {
  still->resize(frame.bodies.size());
  for (size_t i = 0; i < frame.bodies.size(); ++i) {
    const Body& body = frame.bodies[i];
    if ((*still)[i].seconds < 0)
      (*still)[i] = {body.position_W, body.rotation_WB, body.mass * settings.gravity + body.force_W, body.torque_W, 0};
    if (body.Moves()) TrackStillness(body, settings, frame.dt, &(*still)[i]);
  }
  share_ = 1;
  Wake(frame, {}, settings);
}

void CertifiedFreezing::Wake(const SuiteFrame& frame, std::span<const std::uint8_t> hit, const Settings& settings) {
  if (NoneIsFrozen(frame)) return;
  FindIslands(frame);
  SumLoads(frame);
  touched_.assign(frame.bodies.size(), 0);
  for (const Contact& contact : frame.contacts.contacts)
    if (frame.bodies[contact.body_a].Moves() || frame.bodies[contact.body_b].Moves())
      touched_[contact.body_a] = touched_[contact.body_b] = 1;
  const bool alone = !whole_ && hit.empty();
  for (size_t i = 0; i < frame.bodies.size(); ++i) {
    Body& body = frame.bodies[i];
    if (body.kind != BodyKind::kDynamic || body.removed) continue;
    if (!body.frozen) moves_[roots_[i]] = moves_[roots_[i]] || whole_;
    if (!body.frozen) continue;
    const bool is_hit = !hit.empty() && hit[i];
    if (!is_hit && held_[i] && (touched_[i] || IsBalanced(body, loads_[i], settings))) continue;
    if (alone) body.frozen = false;
    if (!alone) moves_[roots_[i]] = 1;
  }
  WakeIslands(frame);
}

void CertifiedFreezing::WakeIslands(const SuiteFrame& frame) {
  for (size_t i = 0; i < frame.bodies.size(); ++i)
    if (moves_[roots_[i]]) frame.bodies[i].frozen = false;
}

// Bodies that `of` names, by island, and the contacts that hold between them and at walls. One that hardly presses holds nothing: what two
// walls press a body with where nothing presses would hold any load.
template <typename F>
void CertifiedFreezing::CollectIslands(const SuiteFrame& frame, const F& of) {
  collected_.clear();
  holding_.clear();
  for (int i = 0; i < static_cast<int>(frame.bodies.size()); ++i)
    if (of(i)) collected_.emplace_back(roots_[i], i);
  if (collected_.empty()) return;
  const auto takes_part = [&](int i) { return frame.bodies[i].kind != BodyKind::kDynamic || of(i); };
  for (int c = 0; c < static_cast<int>(frame.contacts.contacts.size()); ++c) {
    const Contact& contact = frame.contacts.contacts[c];
    const int body = of(contact.body_a) ? contact.body_a : contact.body_b;
    if (!of(body) || !takes_part(contact.body_a) || !takes_part(contact.body_b)) continue;
    const auto load = [&](int i) { return of(i) ? loads_[i].size : INFINITY; };
    if (frame.holding[c][0] > kTrembling * std::min(load(contact.body_a), load(contact.body_b)))
      holding_.emplace_back(roots_[body], c);
  }
  std::sort(collected_.begin(), collected_.end());
  std::sort(holding_.begin(), holding_.end());
}

// f(root), with members_ and contacts_ those of the island.
template <typename F>
void CertifiedFreezing::ForEachCollected(const F& f) {
  for (size_t i = 0, c = 0; i < collected_.size();) {
    const int root = collected_[i].first;
    members_.clear();
    contacts_.clear();
    for (; i < collected_.size() && collected_[i].first == root; ++i) members_.push_back(collected_[i].second);
    for (; c < holding_.size() && holding_[c].first == root; ++c) contacts_.push_back(holding_[c].second);
    f(root);
  }
}

// What balances loads_ is wanted.
void CertifiedFreezing::AskForBalance(const SuiteFrame& frame) {
  wanted_.resize(members_.size());
  limits_.clear();
  for (size_t k = 0; k < members_.size(); ++k) {
    const Load& load = loads_[members_[k]];
    wanted_[k] << -load.linear, -load.angular / frame.bodies[members_[k]].radius;
    limits_.push_back(kCalm * load.size);
  }
}

// What is wanted_, within the cones of what holds. Returns whether it is given.
bool CertifiedFreezing::FindImpulses(const Settings& settings, StopImpulses::Reach reach,
                                     std::vector<Vector3>* impulses) {
  if (!stopping_.Find(wanted_, limits_, kMargin * settings.tolerance, reach, impulses)) return false;
  for (const double missed : stopping_.missed()) worst_imbalance_ = std::max(worst_imbalance_, missed * kCalm);
  return true;
}

// Of members_, whom the last search could not hold. Each attempt of a frame wakes slower ones, in the end all of the island; so does the
// first where one lacks more than its weight: it was struck.
void CertifiedFreezing::WakeWhatGivesWay(const SuiteFrame& frame) {
  const std::vector<double>& speeds = stopping_.speeds();
  double least = share_ * *std::max_element(speeds.begin(), speeds.end());
  for (size_t k = 0; k < members_.size(); ++k)
    if (wanted_[k].norm() > frame.bodies[members_[k]].mass * frame.rest_speed) least = 0;
  for (size_t k = 0; k < members_.size(); ++k)
    if (!(speeds[k] < least)) frame.bodies[members_[k]].frozen = false;
}

bool CertifiedFreezing::Hold(const SuiteFrame& frame, std::span<const LedgerImpulse> impulses,
                             const Settings& settings) {
  stops_.clear();
  worst_imbalance_ = 0;
  if (NoneIsFrozen(frame)) return true;
  const size_t n = frame.bodies.size();
  loads_.assign(n, {});
  for (size_t i = 0; i < n; ++i) StartLoad(frame, static_cast<int>(i));
  for (const LedgerImpulse& j : impulses) AddLoad(frame, j.contact, j.impulse_W);
  FindIslands(frame);
  asks_.assign(n, 0);
  for (size_t i = 0; i < n; ++i) {
    if (!frame.bodies[i].frozen) continue;
    const double imbalance = Imbalance(frame.bodies[i], loads_[i]);
    if (imbalance > kCalm) asks_[roots_[i]] = 1;
    if (imbalance <= kCalm) worst_imbalance_ = std::max(worst_imbalance_, imbalance);
  }
  bool held = true;
  share_ /= kMargin;
  CollectIslands(frame, [&](int i) { return frame.bodies[i].frozen && asks_[roots_[i]]; });
  ForEachCollected([&](int) {
    stopping_.Prepare(frame, members_, contacts_);
    AskForBalance(frame);
    if (!FindImpulses(settings, StopImpulses::Reach::kFar, &balance_)) {
      WakeWhatGivesWay(frame);
      held = false;
    }
    for (size_t k = 0; k < contacts_.size(); ++k) stops_.push_back({contacts_[k], Vector3::Zero(), balance_[k]});
  });
  return held;
}

void CertifiedFreezing::EndFrame(const SuiteFrame& frame, const std::vector<std::uint8_t>& was_frozen,
                                 const std::vector<double>& errors, const std::vector<Stillness>& still,
                                 const Settings& settings) {
  FindIslands(frame);
  SumLoads(frame);
  FindWhatRests(frame, was_frozen, errors, still, settings);
  if (whole_) worst_imbalance_ = 0;
  StopIslands(frame, settings);
  for (size_t i = 0; i < frame.bodies.size(); ++i) {
    Body& body = frame.bodies[i];
    if (body.kind != BodyKind::kDynamic || body.removed) continue;
    if (whole_ && body.frozen) worst_imbalance_ = std::max(worst_imbalance_, Imbalance(body, loads_[i]));
    body.frozen = rests_[i];
    if (body.frozen) SetTwist({}, &body);
  }
}

// Of an island that was solved to the tolerance. Whether contacts can balance what rests is asked when it stops.
void CertifiedFreezing::FindWhatRests(const SuiteFrame& frame, const std::vector<std::uint8_t>& was_frozen,
                                      const std::vector<double>& errors, const std::vector<Stillness>& still,
                                      const Settings& settings) {
  const size_t n = frame.bodies.size();
  const double calm = kMargin * settings.tolerance * std::max(frame.rest_speed, 1e-12);
  rests_.assign(n, 0);
  for (size_t i = 0; i < n; ++i) {
    const Body& body = frame.bodies[i];
    if (body.Moves() && errors[i] > calm) moves_[roots_[i]] = 1;
  }
  for (size_t i = 0; i < n; ++i) {
    const Body& body = frame.bodies[i];
    const bool stands =
        held_[i] && !moves_[roots_[i]] && (was_frozen[i] || still[i].seconds >= settings.freeze_seconds);
    rests_[i] = body.frozen ||
                (body.Moves() && stands && FastestPoint(TwistOf(body), body.radius) <= kMargin * errors[i] + calm);
  }
  if (!whole_) return;
  for (size_t i = 0; i < n; ++i)
    if (frame.bodies[i].Moves() && !rests_[i]) moves_[roots_[i]] = 1;
  for (size_t i = 0; i < n; ++i) rests_[i] = rests_[i] && !moves_[roots_[i]];
}

// Of the islands that freeze now.
void CertifiedFreezing::StopIslands(const SuiteFrame& frame, const Settings& settings) {
  stops_.clear();
  asks_.assign(frame.bodies.size(), 0);
  for (size_t i = 0; i < frame.bodies.size(); ++i)
    if (rests_[i] && !frame.bodies[i].frozen) asks_[roots_[i]] = 1;
  CollectIslands(frame, [&](int i) { return rests_[i] && asks_[roots_[i]]; });
  ForEachCollected([&](int) { StopIsland(frame, settings); });
}

// Stops it and balances what holds it. Whom impulses within their cones cannot hold moves on; so do all, unless each attempt leaves out at
// most half of what the one before might have.
void CertifiedFreezing::StopIsland(const SuiteFrame& frame, const Settings& settings) {
  for (size_t most = members_.size(); !members_.empty(); most /= 2) {
    stopping_.Prepare(frame, members_, contacts_);
    AskForBalance(frame);
    for (size_t k = 0; k < members_.size(); ++k) {
      const Body& body = frame.bodies[members_[k]];
      wanted_[k] << -body.mass * body.linear_velocity_W, -body.AngularMomentumW() / body.radius;
    }
    bool found = FindImpulses(settings, StopImpulses::Reach::kNear, &stop_);
    if (found) {
      AskForBalance(frame);
      found = FindImpulses(settings, StopImpulses::Reach::kNear, &balance_);
    }
    if (found) {
      for (size_t k = 0; k < contacts_.size(); ++k) stops_.push_back({contacts_[k], stop_[k], balance_[k]});
      return;
    }
    const size_t out = whole_ ? 0 : LeaveOut(frame);
    if (out == 0 || out > most) break;
  }
  for (const int i : members_) rests_[i] = frame.bodies[i].frozen && !whole_;
}

// Takes out who was not held. Returns how many they are.
size_t CertifiedFreezing::LeaveOut(const SuiteFrame& frame) {
  size_t out = 0;
  for (size_t k = 0; k < members_.size(); ++k) {
    const int i = members_[k];
    if (stopping_.missed()[k] <= 1 || frame.bodies[i].frozen) continue;
    rests_[i] = 0;
    ++out;
  }
  std::erase_if(members_, [&](int i) { return !rests_[i]; });
  std::erase_if(contacts_, [&](int c) {
    const Contact& contact = frame.contacts.contacts[c];
    return (frame.bodies[contact.body_a].kind == BodyKind::kDynamic && !rests_[contact.body_a]) ||
           (frame.bodies[contact.body_b].kind == BodyKind::kDynamic && !rests_[contact.body_b]);
  });
  return out;
}

}  // namespace islet
