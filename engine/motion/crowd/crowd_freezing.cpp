// What of a crowd is frozen: who wakes as the step begins, who is held, who freezes as it ends.
#include "engine/motion/crowd/crowd.h"

#include <algorithm>
#include <cmath>

#include "engine/freezing/paper_freezing.h"

namespace islet::motion {

// What freezing looks at: the contacts that join bodies, now or before the step ends, and what acts at them.
void Crowd::FillFrame(double dt, std::span<const Vector3> forces_W) {
  frame_.dt = dt;
  frame_.gravity = settings_.gravity;
  frame_.rest_speed = MeanPull() * dt;
  frame_.bodies = bodies_;
  joined_.clear();
  joined_at_.clear();
  frame_.frames.clear();
  frame_.holding.clear();
  frame_.collisions.clear();
  for (size_t c = 0; c < near_->size(); ++c) {
    const Contact& contact = (*near_)[c];
    const Body &a = bodies_[contact.body_a], &b = bodies_[contact.body_b];
    // What is open, by more than gaps may miss, holds nothing: somebody has moved its support.
    const bool known =
        c < forces_W.size() && !forces_W[c].isZero(0) && contact.gap <= 4 * settings_.overlap_tolerance * Size(contact);
    const double way = dt * (std::max(0.0, -NormalVelocity(contact, a, b)) + frame_.rest_speed);
    if (!known && contact.gap > settings_.overlap_tolerance * Size(contact) &&
        (a.frozen == b.frozen || contact.gap > way))
      continue;
    joined_.push_back(contact);
    joined_at_.push_back(static_cast<int>(c));
    frame_.frames.push_back(ContactFrame(contact.normal_W));
    frame_.holding.push_back(known ? Vector3(dt * (frame_.frames.back().transpose() * forces_W[c]))
                                   : Vector3(Vector3::Zero()));
    frame_.collisions.push_back(c < blow_W_.size() ? Vector3(frame_.frames.back().transpose() * blow_W_[c])
                                                   : Vector3(Vector3::Zero()));
  }
  frame_.bounces.assign(joined_.size(), Vector3::Zero());
  frame_.contacts = {joined_, frame_.frames};
}

// For freezing: the contacts as the step begins, and what held there.
void Crowd::LookAtStart(double dt, const CrowdMemory& memory) {
  start_ = *near_;
  RecallForces(
      memory.contacts, memory.forces_W, start_, [this](const Contact& c) { return Size(c); }, &start_force_W_);
  blow_W_.clear();
  FillFrame(dt, start_force_W_);
}

// Frozen bodies that something may move in this step wake; by the paper's freezing what is hit.
void Crowd::Wake(double dt, CrowdMemory* memory) {
  was_frozen_.resize(bodies_.size());
  for (size_t i = 0; i < bodies_.size(); ++i) was_frozen_[i] = bodies_[i].frozen;
  memory->freeze_counters.resize(bodies_.size(), 0);
  memory->lost.resize(bodies_.size(), INFINITY);
  LookAtStart(dt, *memory);
  if (settings_.freezing == Freezing::kCertified) freezing_.BeginFrame(frame_, settings_, &memory->still);
  if (settings_.freezing != Freezing::kPaper) return;
  for (const Contact& contact : joined_) {
    Body &a = bodies_[contact.body_a], &b = bodies_[contact.body_b];
    if (a.frozen == b.frozen || -NormalVelocity(contact, a, b) <= frame_.rest_speed) continue;
    a.frozen = b.frozen = false;
  }
}

// Impulses that were told of the step so far, by their pairs.
void Crowd::SortTold() {
  told_.clear();
  for (size_t k = 0; k < impulses_.size(); ++k)
    if (impulses_[k].corrects < 0) told_.push_back(static_cast<int>(k));
  std::stable_sort(told_.begin(), told_.end(),
                   [&](int x, int y) { return EarlierPair(impulses_[x].contact, impulses_[y].contact); });
}

// The place of the nearest of those of a pair that faces the same way, or -1. What freezing does at a contact takes some of that back.
int Crowd::ToldAt(const Contact& contact) const {
  double nearest = INFINITY;
  int found = -1;
  for (auto k = std::lower_bound(told_.begin(), told_.end(), contact,
                                 [&](int x, const Contact&c) { return EarlierPair(impulses_[x].contact, c); });
       k != told_.end() && SamePair(impulses_[*k].contact, contact); ++k) {
    const Contact& told = impulses_[*k].contact;
    const double away = (told.point_W - contact.point_W).squaredNorm();
    if (told.normal_W.dot(contact.normal_W) <= 0 || away >= nearest) continue;
    nearest = away;
    found = *k;
  }
  return found;
}

// What moved pressed on what is frozen. Returns false where nothing holds that: it is frozen no more.
bool Crowd::Hold(double dt, CrowdMemory* memory) {
  if (settings_.freezing != Freezing::kCertified) return true;
  FillFrame(dt, memory->forces_W);
  bool held = true;
  pool_->ForEach(1, [&](int, int) { held = freezing_.Hold(frame_, impulses_, settings_); });  // idle workers help
  if (!held) return false;
  SortTold();
  for (const CertifiedFreezing::Stop& s : freezing_.stops()) {
    const Vector3 balance_W = frame_.frames[s.contact] * s.balance;
    impulses_.push_back({joined_[s.contact], balance_W, 0, dt, ToldAt(joined_[s.contact])});
    memory->forces_W[joined_at_[s.contact]] += 1 / dt * balance_W;
  }
  return true;
}

void Crowd::Freeze(double dt, CrowdMemory* memory, StepReport* report) {
  FillFrame(dt, memory->forces_W);
  if (settings_.freezing == Freezing::kCertified) {
    pool_->ForEach(1, [&](int, int) { freezing_.EndFrame(frame_, was_frozen_, errors_, memory->still, settings_); });
    SortTold();
    for (const CertifiedFreezing::Stop& s : freezing_.stops()) {
      const Contact& stopped = joined_[s.contact];
      impulses_.push_back({stopped, frame_.frames[s.contact] * s.stop, dt, 0, ToldAt(stopped)});
      memory->forces_W[joined_at_[s.contact]] += 1 / dt * (frame_.frames[s.contact] * s.balance);
    }
  }
  if (settings_.freezing == Freezing::kPaper) FreezeLikePaper(frame_, settings_, &memory->freeze_counters);
  for (size_t i = 0; i < bodies_.size(); ++i) {
    const Body& body = bodies_[i];
    if (body.kind != BodyKind::kDynamic || body.removed) continue;
    (body.frozen ? report->frozen : report->awake) += 1;
    report->kinetic_energy += body.KineticEnergy();
  }
  if (settings_.freezing == Freezing::kCertified && report->frozen > 0)
    report->frozen_imbalance = std::max(report->frozen_imbalance, freezing_.worst_imbalance());
}

}  // namespace islet::motion
