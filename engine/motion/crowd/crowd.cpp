// The step of a crowd: pieces, and the passes of a piece.
#include "engine/motion/crowd/crowd.h"

#include <algorithm>
#include <cmath>

#include "engine/contact_pairs.h"
#include "engine/geometry/support.h"
#include "engine/motion/tuning.h"
#include "engine/rotation.h"
#include "engine/slice.h"
#include "engine/stopwatch.h"
#include "qp/smallness.h"

namespace islet::motion {

Crowd::Crowd(const Settings& settings, parallel::WorkerPool* pool)
    : settings_(settings), pool_(pool), workers_(pool->num_workers()) {
  for (Worker& worker : workers_) worker.responder.SetSpeedShare(settings.tolerance);
}

double Crowd::Size(const Contact& c) const { return std::min(shapes_[c.body_a].size(), shapes_[c.body_b].size()); }

// [m/s^2] that gravity and forces give the bodies in the mean of their masses.
double Crowd::MeanPull() const {
  double force = 0, mass = 0;
  bool any = false;
  for (const Body& b : bodies_) {
    if (b.kind != BodyKind::kDynamic || b.removed) continue;
    any = any || !b.force_W.isZero(0);
    force += (b.mass * settings_.gravity + b.force_W).norm();
    mass += b.mass;
  }
  return any ? force / mass : settings_.gravity.norm();
}

// [m/s^2] What goes in a circle is held by more than its weight: mean of what contacts gave as the step before ended. 0 if no wall is on an arc.
double Crowd::MeanHold() {
  if (std::all_of(bodies_.begin(), bodies_.end(), [](const Body& b) { return b.arc_W.isZero(0); })) return 0;
  held_by_W_.assign(bodies_.size(), Vector3::Zero());
  for (size_t c = 0; c < start_.size(); ++c) {
    held_by_W_[start_[c].body_a] -= start_force_W_[c];
    held_by_W_[start_[c].body_b] += start_force_W_[c];
  }
  double force = 0, mass = 0;
  for (size_t i = 0; i < bodies_.size(); ++i) {
    if (bodies_[i].kind != BodyKind::kDynamic || bodies_[i].removed) continue;
    force += held_by_W_[i].norm();
    mass += bodies_[i].mass;
  }
  return mass > 0 ? force / mass : 0;
}

// States where the step begins, and the course under forces alone.
void Crowd::Load(double dt) {
  const size_t n = bodies_.size();
  dt_ = dt;
  begin_.resize(n);
  free_.resize(n);
  middle_.resize(n);
  mean_W_.resize(n);
  mean_spin_W_.resize(n);
  travel_.resize(n);
  posed_.assign(bodies_.begin(), bodies_.end());
  cut_.resize(n);
  for (size_t i = 0; i < n; ++i) cut_[i] = !bodies_[i].Moves();
  near_to_.assign(n, 0);
  for (const Contact& c : *near_)
    if (!cut_[c.body_a] || !cut_[c.body_b]) near_to_[c.body_a] = near_to_[c.body_b] = 1;
  const auto drives = [&](size_t i) { return near_to_[i] && bodies_[i].kind == BodyKind::kKinematic; };
  driven_ = false;
  for (size_t i = 0; i < n; ++i) driven_ = driven_ || (drives(i) && !StandsStill(bodies_[i]));
  const double mean = std::max(MeanPull(), MeanHold());
  floor_ = std::max({mean * dt, 1e-3 * FastestPoint(bodies_, drives), 1e-12});
  threshold_ = 10 * settings_.tolerance * floor_;
  least_energy_ = 0.5 * std::max(floor_ * floor_, mean * mean * dt * whole_dt_);
  pool_->ForEachOf(n, [&](size_t i) {
    const Body& b = bodies_[i];
    begin_[i] = StateOf(b);
    if (!b.Moves()) {
      mean_W_[i] = b.linear_velocity_W + 0.5 * dt * b.arc_W;
      travel_[i] = dt * mean_W_[i];
      mean_spin_W_[i] = b.angular_velocity_W;
      middle_[i] = {b.position_W + 0.5 * dt * mean_W_[i], Turned(0.5 * dt * b.angular_velocity_W, b.rotation_WB)};
      return;
    }
    free_[i] = {b.linear_velocity_W + 0.5 * dt * (settings_.gravity + b.force_W / b.mass),
                TurnFreely(b, b.rotation_WB, b.angular_velocity_W, 0.5 * dt)};
  });
}

void Crowd::Report(std::span<const ResponseOutcome> outcomes, QpSummary* summary, double seconds, double* stage,
                   StepReport* report) {
  *stage += seconds;
  for (const ResponseOutcome& outcome : outcomes) {
    outcome.AddTo(summary, &report->ladder);
    report->certificate.Include(outcome.certificate);
    report->restitution_lowered += outcome.restitution_lowered;
  }
}

void Crowd::Record(int island, Stage stage, const ResponseOutcome& outcome, const Worker& worker) {
  if (!*observer_ || outcome.status == QpStatus::kNone) return;
  records_[island].push_back(
      {0, island, stage, outcome.status, worker.responder.problem(), worker.responder.solution()});
}

void Crowd::TellObserver() {
  if (!*observer_) return;
  for (auto& records : records_) {
    for (const ProblemRecord& record : records) (*observer_)(record);
    records.clear();
  }
}

// Of a size: the deepest overlap that the piece made; where it made one deeper, all of that.
double Crowd::FreshOverlap() const {
  double worst = 0;
  for (size_t e = 0; e < near_->size(); ++e) {
    const Contact& c = (*near_)[e];
    if (cut_[c.body_a] && cut_[c.body_b]) continue;
    const double size = Size(c), deeper = (before_[e] - c.gap - dt_ * YieldOf(c)) / size;
    worst = std::max(worst, deeper > settings_.overlap_tolerance ? std::max(deeper, -c.gap / size) : deeper);
  }
  return worst;
}

// One piece of the step, from time t on. Where it misses its end and may be shortened bodies and contacts are as before; who gives way still
// does, and what was solved is counted. Where something frozen was hit the step begins anew.
Crowd::Outcome Crowd::Piece(double t, double h, bool last, const FindContacts& find, CrowdMemory* memory,
                            StepReport* report) {
  start_ = *near_;
  RecallForces(
      memory->contacts, memory->forces_W, start_, [this](const Contact& c) { return Size(c); }, &start_force_W_);
  Load(h);
  AllowPushes(*memory);
  Select();
  disturbed_.assign(bodies_.size(), 1);
  int pass = 1;
  for (;; ++pass) {
    Carry(pass == 1, report);
    Fly();
    const double looking = Seconds();
    find(travel_);
    CountStage("detect", looking, Seconds(), &report->seconds.detect);
    const bool met = Judge(pass);
    if (met || pass == kPasses) break;
    NextTargets();
  }
  report->motion_passes = std::max(report->motion_passes, pass);
  const bool misses = pass == kPasses && (FreshOverlap() > kDeep || Gains());
  report->motion_failures += misses && last;
  if (misses && !last) {
    Return(begin_);
    *near_ = start_;
    return Outcome::kMissed;
  }
  Inherit();
  pressed_.assign(near_->size(), 0.0);
  acted_as_.assign(held_.size(), -1);
  work_.assign(near_->size(), 0.0);
  for (size_t c = 0; c < held_.size(); ++c) {
    if (impulse_W_[c].isZero(0)) continue;
    if (follows_[c] >= 0) {
      pressed_[follows_[c]] += std::max(0.0, (*near_)[follows_[c]].normal_W.dot(impulse_W_[c]));
      work_[follows_[c]] += WorkOf(c);
    }
    Contact contact = held_[c];
    contact.point_W = acted_at_[c];
    contact.surface_W = held_of_[c].belt_W;
    acted_as_[c] = static_cast<int>(impulses_.size());
    impulses_.push_back({contact, impulse_W_[c], t, h});
  }
  Settle(report);
  if (settings_.freezing == Freezing::kCertified && HitsFrozen()) return Outcome::kHitFrozen;
  Remember(h, memory);
  for (size_t c = 0; c < problem_.size(); ++c) {
    const int e = closed_[c];
    const Vector3 change = ChangeAt(c);
    if (!change.isZero(0) && pressed_[e] == 0) impulses_.push_back({(*near_)[e], change, t + h, 0});
  }
  for (size_t c = 0; c < held_.size(); ++c) {
    if (given_back_[c]) impulses_.push_back({WhereTaken(c), -impulse_W_[c], t + h, 0, acted_as_[c]});
    const int e = follows_[c];
    if (e < 0 || impulse_W_[c].isZero(0) || problem_at_[e] < 0) continue;
    // Those that one contact follows share what it changes, or one of them would pull.
    const double press = (*near_)[e].normal_W.dot(impulse_W_[c]);
    const Vector3 change = ChangeAt(problem_at_[e]);
    if (press > 0 && !change.isZero(0))
      impulses_.push_back({(*near_)[e], press / pressed_[e] * change, t + h, 0, acted_as_[c]});
  }
  return Outcome::kDone;
}

void Crowd::Return(std::span<const State> states) {
  for (size_t i = 0; i < bodies_.size(); ++i) SetState(states[i], &bodies_[i]);
}

// Marks what stands still as frozen and took a blow, or would have to give way. A blow that would give it less speed than its weight does is a load like others.
// Returns whether any did.
bool Crowd::HitsFrozen() {
  hit_ = closed_upon_;
  for (size_t c = 0; c < problem_.size(); ++c) {
    const double blow = (blows_[c] + collisions_[c]).norm();
    for (const int i : {problem_[c].body_a, problem_[c].body_b})
      hit_[i] = hit_[i] || (bodies_[i].frozen && blow > bodies_[i].mass * floor_);
  }
  return std::any_of(hit_.begin(), hit_.end(), [](std::uint8_t hit) { return hit != 0; });
}

// What held as the piece ended, also between bodies that stood still all the while.
void Crowd::Remember(double h, CrowdMemory* memory) {
  memory->contacts = *near_;
  memory->lost = lost_;
  memory->forces_W.assign(near_->size(), Vector3::Zero());
  blow_W_.assign(near_->size(), Vector3::Zero());
  for (size_t c = 0; c < problem_.size(); ++c) {
    const int e = closed_[c];
    memory->forces_W[e] += 1 / h * (frames_[c] * local_[c] + beyond_W_[c]);
    blow_W_[e] += frames_[c] * (blows_[c] + collisions_[c]);
  }
  ForEachPair(start_, memory->contacts, [&](size_t s, size_t s_end, size_t e, size_t e_end) {
    if (s == s_end || e == e_end || !cut_[start_[s].body_a] || !cut_[start_[s].body_b]) return;
    for (size_t k = e; k < e_end; ++k)
      for (size_t c = s; c < s_end; ++c)
        if (start_[c].feature == (*near_)[k].feature) memory->forces_W[k] = start_force_W_[c];
  });
}

// Of the last piece.
void Crowd::ReportIslands(StepReport* report) const {
  for (int i = 0; i < partition_.num_islands(); ++i) {
    if (partition_.contacts_of(i).empty()) continue;
    IslandReport island{.first_body = partition_.bodies_of(i)[0],
                        .bodies = static_cast<int>(partition_.bodies_of(i).size()),
                        .contacts = static_cast<int>(partition_.contacts_of(i).size())};
    struck_[i].AddTo(Stage::kCollision, &island);
    outcomes_[i].AddTo(Stage::kStatic, &island);
    report->Add(island);
  }
}

// What hits at a corner by more than gaps may miss in the piece is a contact of the side on which it passes.
void Crowd::TurnCorners() {
  const auto is_polytope = [&](int i) { return !shapes_[i].polytope().vertices.empty(); };
  ForEachPair(*near_, {}, [&](size_t c, size_t end, size_t, size_t) {
    const std::span<Contact> found = std::span(*near_).subspan(c, end - c);
    const int a = found[0].body_a, b = found[0].body_b;
    const double level = 2 * settings_.overlap_tolerance * Size(found[0]), cut = level / dt_;
    if (is_polytope(a) && is_polytope(b))
      TurnToOpenSide(
          {shapes_[a], bodies_[a], StateOf(bodies_[a])}, {shapes_[b], bodies_[b], StateOf(bodies_[b])}, level, level,
          [cut](const Contact&) { return cut; }, found);
  });
}

// Takes out what touches by edges alone, and is level along two sides that face each other. Nothing presses there: cubes of a wall touch those
// beside, above and below, but push none that is diagonal. What closes along both shows as an overlap at the end.
void Crowd::DropLevelEdges() {
  const auto presses_nothing = [&](const Contact* first, const Contact* last) {
    const Body &a = bodies_[first->body_a], &b = bodies_[first->body_b];
    const double level = 2 * settings_.overlap_tolerance * Size(*first);  // what gaps may miss at both ends
    return TouchByLevelEdges({first, last}, shapes_[first->body_a], Pose{a.position_W, a.rotation_WB}.placement(),
                             shapes_[first->body_b], Pose{b.position_W, b.rotation_WB}.placement(), level, &sides_W_);
  };
  size_t kept = 0;
  for (size_t c = 0, end = 0; c < near_->size(); c = end) {
    for (end = c + 1; end < near_->size() && SamePair((*near_)[c], (*near_)[end]);) ++end;
    if (presses_nothing(near_->data() + c, near_->data() + end)) continue;
    for (size_t k = c; k < end; ++k) (*near_)[kept++] = (*near_)[k];
  }
  near_->resize(kept);
}

// The step, piece by piece. Returns false where something frozen was hit: it is to wake.
bool Crowd::Pieces(double dt, const FindContacts& find, CrowdMemory* memory, StepReport* report) {
  impulses_.clear();
  for (size_t c = 0; c < start_.size(); ++c) {  // what holds frozen bodies
    const Body &a = bodies_[start_[c].body_a], &b = bodies_[start_[c].body_b];
    if (!a.Moves() && !b.Moves() && !start_force_W_[c].isZero(0))
      impulses_.push_back({start_[c], dt * start_force_W_[c], 0, dt});
  }
  if (AllStandStill(bodies_)) {
    memory->contacts = *near_;
    memory->forces_W = start_force_W_;
    return true;
  }
  // In parts of 1/64 of the step. What missed is done in halves; after both the next piece is as long as they were together.
  const int whole = 1 << kMostHalvings;
  for (int done = 0, parts = whole; done < whole;) {
    const Outcome outcome = Piece(
        dt * done / whole, dt * parts / whole, parts == 1,
        [&](std::span<const Vector3> travel_W) {
          find(travel_W);
          TurnCorners();
          DropLevelEdges();
        },
        memory, report);
    if (outcome == Outcome::kHitFrozen) return false;
    if (outcome == Outcome::kMissed) {
      parts /= 2;
      continue;
    }
    done += parts;
    if (parts < whole && done % (2 * parts) == 0) parts *= 2;
  }
  ReportIslands(report);
  return true;
}

void Crowd::Step(double dt, const FindContacts& find, const ProblemObserver& observer, std::span<Body> bodies,
                 std::span<const Shape> shapes, std::vector<Contact>* near, CrowdMemory* memory, StepReport* report) {
  bodies_ = bodies;
  shapes_ = shapes;
  near_ = near;
  observer_ = &observer;
  errors_.assign(bodies.size(), 0.0);
  for (Body& b : bodies) b.linear_velocity_W -= 0.5 * dt * b.arc_W;  // as the step begins
  dt_ = dt;
  TurnCorners();
  DropLevelEdges();
  first_.resize(bodies.size());
  for (size_t i = 0; i < bodies.size(); ++i) first_[i] = StateOf(bodies[i]);
  first_near_ = *near;
  yields_.clear();
  Wake(dt, memory);
  first_memory_ = *memory;
  closed_upon_.assign(bodies.size(), 0);
  for (hit_.clear(); !Pieces(dt, find, memory, report) || !Hold(dt, memory); hit_.clear()) {
    yields_.clear();
    closed_upon_.assign(bodies.size(), 0);
    Return(first_);
    *near = first_near_;
    *memory = first_memory_;
    LookAtStart(dt, *memory);
    freezing_.Wake(frame_, hit_, settings_);
  }
  Freeze(dt, memory, report);
  for (Body& b : bodies) b.linear_velocity_W -= 0.5 * dt * b.arc_W;  // of the chord again
  for (const Contact& c : *near) report->penetration_max = std::max(report->penetration_max, -c.gap);
  report->overlapping += CountOverlapping(*near, [this](const Contact& c) { return Size(c); });
}

}  // namespace islet::motion
