#include "engine/motion/crowd.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "engine/freezing/paper_freezing.h"
#include "engine/motion/tuning.h"
#include "engine/motion/visible_turn.h"
#include "engine/rotation.h"
#include "engine/slice.h"
#include "engine/stopwatch.h"
#include "islands/disjoint_sets.h"
#include "qp/smallness.h"

namespace islet::motion {
namespace {

constexpr int kLevels = 3;        // times that a piece is halved
constexpr int kLettingGo = 3;     // of these, that go on because something was let go
constexpr double kDeep = 2e-3;    // of a size: overlap that a piece may not make
constexpr int kOpenings = 2;      // of a pair that an old plane presses: then that plane is let go
constexpr double kMoving = 0.1;   // of the tolerance: what of their speed answers may be wrong by where bodies move
constexpr int kAttempts = 3;      // of blows, before none rebounds
constexpr double kReach = 0.02;   // of a size: contacts nearer than that may carry in a pass
constexpr double kGain = 1e-7;    // of the energy at hand: what a piece may make
constexpr double kAstray = 0.01;  // of a size: an overlap whose way out begins so far inside is not that of the way in
constexpr double kAlike = 0.999;  // cosine: normals that are the same

bool SamePair(const Contact& x, const Contact& y) { return x.body_a == y.body_a && x.body_b == y.body_b; }

// [m] of the contacts of a pair; infinite if there are none.
double LeastGap(std::span<const Contact> of_pair) {
  double gap = INFINITY;
  for (const Contact& c : of_pair) gap = std::min(gap, c.gap);
  return gap;
}

// Calls f(first and last place in x, the same in y) for each pair of bodies that has contacts in x, in y or in both.
template <typename F>
void ForEachPair(std::span<const Contact> x, std::span<const Contact> y, const F& f) {
  for (size_t i = 0, k = 0; i < x.size() || k < y.size();) {
    const bool from_y = i == x.size() || (k < y.size() && EarlierPair(y[k], x[i]));
    const Contact& pair = from_y ? y[k] : x[i];
    const size_t first_i = i, first_k = k;
    while (i < x.size() && SamePair(x[i], pair)) ++i;
    while (k < y.size() && SamePair(y[k], pair)) ++k;
    f(first_i, i, first_k, k);
  }
}

}  // namespace

Crowd::Crowd(const Settings& settings, parallel::WorkerPool* pool)
    : settings_(settings), pool_(pool), workers_(pool->num_workers()) {
  for (Worker& worker : workers_) worker.responder.SetSpeedShare(kMoving * settings.tolerance);
}

double Crowd::Size(const Contact& c) const { return std::min(shapes_[c.body_a].size(), shapes_[c.body_b].size()); }

template <typename F>
void Crowd::ForEachIsland(const F& f) {
  costs_.resize(partition_.num_islands());
  for (int i = 0; i < partition_.num_islands(); ++i)
    costs_[i] = 1.0 + static_cast<double>(partition_.contacts_of(i).size());
  pool_->ForEachByCost(costs_, kBatchCost, &schedule_, [&](int island, int worker) { f(island, &workers_[worker]); });
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
  double fastest = 0;
  driven_ = false;
  for (size_t i = 0; i < n; ++i) {
    cut_[i] = !bodies_[i].Moves();
    driven_ = driven_ || (bodies_[i].kind == BodyKind::kKinematic && !StandsStill(bodies_[i]));
    if (!cut_[i]) fastest = std::max(fastest, FastestPoint(TwistOf(bodies_[i]), bodies_[i].radius));
  }
  floor_ = std::max({settings_.gravity.norm() * dt, 1e-3 * fastest, 1e-12});
  threshold_ = 10 * settings_.tolerance * floor_;
  least_energy_ = 0.5 * std::max(floor_ * floor_, settings_.gravity.squaredNorm() * dt * whole_dt_);
  pool_->ForEachOf(n, [&](size_t i) {
    const Body& b = bodies_[i];
    begin_[i] = StateOf(b);
    if (!b.Moves()) {
      mean_W_[i] = b.linear_velocity_W;
      travel_[i] = dt * b.linear_velocity_W;
      mean_spin_W_[i] = b.angular_velocity_W;
      middle_[i] = {b.position_W + 0.5 * dt * b.linear_velocity_W,
                    Turned(0.5 * dt * b.angular_velocity_W, b.rotation_WB)};
      return;
    }
    Free& free = free_[i];
    free.linear_W = b.linear_velocity_W + 0.5 * dt * (settings_.gravity + b.force_W / b.mass);
    free.half_WB = Turned(FreeRotation(b.inertia_B, b.rotation_WB, b.angular_velocity_W, 0.5 * dt), b.rotation_WB);
    free.spin_W = AngularVelocityAfter(b.inertia_B, b.rotation_WB, b.angular_velocity_W, free.half_WB);
  });
}

// The forces that held where the step before ended, at the same contacts or the nearest of the same bodies.
void Crowd::Recall(const CrowdMemory& memory) {
  start_force_W_.assign(start_.size(), Vector3::Zero());
  ForEachPair(memory.contacts, start_, [&](size_t old, size_t old_end, size_t now, size_t now_end) {
    if (old == old_end || now == now_end) return;
    for (size_t o = old; o < old_end; ++o) {
      if (memory.forces_W[o].isZero(0)) continue;
      const Contact& gone = memory.contacts[o];
      const int heir = FindAgain(std::span(start_).subspan(now, now_end - now), gone.feature, gone.point_W,
                                 kSamePlace * Size(gone), INFINITY);
      start_force_W_[now + std::max(heir, 0)] += memory.forces_W[o];
    }
  });
}

// [m] what a piece takes back of an overlap.
double Crowd::PushOf(double gap) const { return std::min(-kPushOut * gap, kFastest * floor_ * dt_); }

// Overlaps are pushed out by who lost as much energy in the piece before as that costs.
void Crowd::AllowPushes(const CrowdMemory& memory) {
  pushes_.assign(bodies_.size(), 1);
  gained_.assign(bodies_.size(), 0);
  for (size_t c = 0; c < start_.size(); ++c) {
    const Contact& contact = start_[c];
    const double cost = PushOf(contact.gap) * contact.normal_W.dot(start_force_W_[c]);
    for (const int i : {contact.body_a, contact.body_b})
      if (!cut_[i] && contact.gap < -settings_.overlap_tolerance * Size(contact) && cost > memory.lost[i])
        pushes_[i] = 0;
  }
}

// What may close within the step, on the course that the velocities of its start give.
void Crowd::Select() {
  const double near =
      settings_.model == Model::kCoulomb ? kSamePoint : INFINITY;  // by the convex models what comes near parts
  held_.clear();
  held_of_.clear();
  impulse_W_.clear();
  centre_.clear();
  for (size_t c = 0; c < start_.size(); ++c) {
    const Contact& contact = start_[c];
    const Body &a = bodies_[contact.body_a], &b = bodies_[contact.body_b];
    if (!a.Moves() && !b.Moves()) continue;
    const auto free = [&](const Body& body, int i) -> Vector3 {
      return body.Moves() ? Vector3(free_[i].linear_W + free_[i].spin_W.cross(contact.point_W - body.position_W))
                          : body.VelocityAt(contact.point_W);
    };
    const double opening = contact.normal_W.dot(free(b, contact.body_b) - free(a, contact.body_a));
    const double size = Size(contact);
    if (start_force_W_[c].isZero(0) && (contact.gap > near * size || contact.gap + dt_ * opening > kReach * size))
      continue;
    // What is closed stays as far apart as it is; what is open may close; an overlap that shows is pushed out.
    const double tolerance = settings_.overlap_tolerance * size;
    const bool pushed = contact.gap < -tolerance && pushes_[contact.body_a] && pushes_[contact.body_b];
    const double gap = contact.gap > tolerance ? contact.gap : pushed ? -PushOf(contact.gap) : 0;
    held_.push_back(contact);
    Held held;
    held.target = -gap / dt_ - YieldOf(contact);
    held.allowed = contact.gap - gap - dt_ * YieldOf(contact);
    held.push = gap < 0 ? -gap : 0;
    const Vector3 half = 0.5 * contact.gap * contact.normal_W;
    held.in_a = Inside(contact.body_a, begin_[contact.body_a].pose, contact.point_W - half);
    held.in_b = Inside(contact.body_b, begin_[contact.body_b].pose, contact.point_W + half);
    held_of_.push_back(held);
    impulse_W_.push_back(WithinCone(contact, dt_ * start_force_W_[c]));
    const double share = Share(contact);
    // At the lever of halfway, as far as bodies move and turn on.
    const auto ahead = [&](const Body& body) -> Vector3 { return 0.5 * dt_ * body.linear_velocity_W; };
    const auto halfway = [&](const Body& body, int i) -> Vector3 {
      const Vector3 spin = VisibleSpin(shapes_[i], body.rotation_WB, body.angular_velocity_W);
      if (TurnsInItself(i) || spin.isZero(0)) return contact.point_W + ahead(body);
      return contact.point_W + ahead(body) + 0.5 * (TurnLessOne(dt_ * spin) * (contact.point_W - body.position_W));
    };
    centre_.push_back(share * (a.position_W + ahead(a)) + (1 - share) * (b.position_W + ahead(b)));
    held_.back().point_W = share * halfway(a, contact.body_a) + (1 - share) * halfway(b, contact.body_b);
  }
}

// [m] of the pair; infinite where it was out of reach.
double Crowd::GapAtStart(const Contact& pair) const {
  const auto [first, last] = std::equal_range(start_.begin(), start_.end(), pair, EarlierPair);
  return LeastGap({first, last});
}

// Whether its normal turns as the bodies pass each other.
bool Crowd::IsRound(const Contact& c) const {
  const ShapeKind a = shapes_[c.body_a].kind(), b = shapes_[c.body_b].kind();
  return a != ShapeKind::kHalfSpace && b != ShapeKind::kHalfSpace &&
         (a == ShapeKind::kSphere || b == ShapeKind::kSphere);
}

double Crowd::Share(const Contact& c) const {
  return ShareOfA(!cut_[c.body_a], TurnsInItself(c.body_a), !cut_[c.body_b], TurnsInItself(c.body_b));
}

void Crowd::Part(std::span<const Contact> contacts) {
  edges_.clear();
  frames_.resize(contacts.size());
  for (size_t c = 0; c < contacts.size(); ++c) {
    edges_.emplace_back(contacts[c].body_a, contacts[c].body_b);
    frames_[c] = ContactFrame(contacts[c].normal_W);
  }
  PartEdges();
}

// Islands of a problem, and room for their answers.
void Crowd::PartEdges() {
  islands::BuildPartition({cut_, edges_}, &partition_);
  outcomes_.assign(partition_.num_islands(), {});
  records_.resize(partition_.num_islands());
}

// Impulses that keep contacts open at the end of the step, of the islands that are disturbed. Unknown: the mean velocity, after half of
// each impulse.
void Crowd::Carry(bool first, StepReport* report) {
  frames_.resize(held_.size());
  edges_.clear();
  active_.clear();
  for (size_t c = 0; c < held_.size(); ++c) {
    if (!disturbed_[held_[c].body_a] && !disturbed_[held_[c].body_b]) continue;
    frames_[c] = ContactFrame(held_[c].normal_W);
    edges_.emplace_back(held_[c].body_a, held_[c].body_b);
    active_.push_back(static_cast<int>(c));
  }
  PartEdges();
  pool_->ForEachOf(bodies_.size(), [&](size_t i) {
    Body& p = posed_[i];
    p.position_W = first ? Vector3(begin_[i].pose.position_W + 0.5 * dt_ * begin_[i].linear_W) : middle_[i].position_W;
    if (cut_[i]) return;
    p.rotation_WB = free_[i].half_WB;
    p.linear_velocity_W = free_[i].linear_W;
    p.angular_velocity_W = free_[i].spin_W;
    if (!bodies_[i].torque_W.isZero(0))
      p.angular_velocity_W += 0.5 * dt_ * SpinOf(bodies_[i], p.rotation_WB, bodies_[i].torque_W);
  });
  targets_.resize(held_.size());
  given_.assign(held_.size(), 0.0);
  local_.resize(held_.size());
  for (const int c : active_) {
    targets_[c] = held_of_[c].target;
    local_[c] = 0.5 * (frames_[c].transpose() * impulse_W_[c]);
  }
  const double start = Seconds();
  ForEachIsland([&](int island, Worker* worker) {
    worker->contacts.clear();
    for (const int k : partition_.contacts_of(island)) worker->contacts.push_back(active_[k]);
    const IslandView view{partition_.bodies_of(island), worker->contacts};
    if (view.contacts.empty()) return;
    outcomes_[island] =
        worker->responder.ResolveTargets(view, {held_, frames_}, targets_, settings_, floor_, posed_, local_);
    for (const int c : view.contacts) {
      impulse_W_[c] = 2 * (frames_[c] * local_[c]);
      if (impulse_W_[c].norm() <= settings_.tolerance * floor_ * LighterMass(held_[c]))
        impulse_W_[c].setZero();  // or what is open is held
    }
    for (size_t k = 0; k < view.contacts.size() && outcomes_[island].status == QpStatus::kInfeasible; ++k)
      given_[view.contacts[k]] = worker->responder.given()[k];
    for (const int i : view.bodies) errors_[i] = outcomes_[island].certificate.natural_map_max;
    Record(island, Stage::kStatic, outcomes_[island], *worker);
  });
  TellObserver();
  const double solved = Seconds();
  TellSlice({"solve", start, solved});
  Report(outcomes_, &report->static_qp, solved - start, &report->seconds.static_qp, report);
  GiveWay();
}

// Pairs that moving walls press together faster than anything keeps them apart close at that speed for the rest of the step.
void Crowd::GiveWay() {
  ForEachPair(held_, {}, [&](size_t h, size_t h_end, size_t, size_t) {
    const double given = *std::max_element(given_.begin() + static_cast<std::ptrdiff_t>(h),
                                           given_.begin() + static_cast<std::ptrdiff_t>(h_end));
    if (given <= threshold_) return;
    const auto known =
        std::find_if(yields_.begin(), yields_.end(), [&](const Yield& y) { return SamePair(y.pair, held_[h]); });
    if (known != yields_.end())
      known->speed += given;
    else
      yields_.push_back({held_[h], given});
  });
}

// [m/s] at which a pair gives way.
double Crowd::YieldOf(const Contact& pair) const {
  for (const Yield& y : yields_)
    if (SamePair(y.pair, pair)) return y.speed;
  return 0;
}

// [kg] of the lighter of those that contacts move.
double Crowd::LighterMass(const Contact& contact) const {
  const auto mass = [&](int i) { return cut_[i] ? INFINITY : bodies_[i].mass; };
  return std::min(mass(contact.body_a), mass(contact.body_b));
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

// The step under these impulses: parabolas, free turns, and half-way a kick to each angular momentum.
void Crowd::Fly() {
  const size_t n = bodies_.size();
  for (size_t i = 0; i < n; ++i) {
    Body& b = bodies_[i];
    if (!b.Moves()) continue;
    mean_W_[i] = free_[i].linear_W;
    mean_spin_W_[i] = dt_ * b.torque_W;  // [N m s] so far
  }
  for (size_t c = 0; c < held_.size(); ++c) {
    if (impulse_W_[c].isZero(0)) continue;
    const int a = held_[c].body_a, b = held_[c].body_b;
    if (!cut_[a]) mean_W_[a] -= 0.5 / bodies_[a].mass * impulse_W_[c];
    if (!cut_[b]) mean_W_[b] += 0.5 / bodies_[b].mass * impulse_W_[c];
  }
  for (size_t i = 0; i < n; ++i)
    if (!cut_[i]) middle_[i].position_W = begin_[i].pose.position_W + 0.5 * dt_ * mean_W_[i];
  acted_at_.resize(held_.size());
  for (size_t c = 0; c < held_.size(); ++c) {
    const int a = held_[c].body_a, b = held_[c].body_b;
    const double share = Share(held_[c]);
    acted_at_[c] =
        held_[c].point_W + (share * middle_[a].position_W + (1 - share) * middle_[b].position_W - centre_[c]);
    if (impulse_W_[c].isZero(0)) continue;
    if (!cut_[a]) mean_spin_W_[a] -= (acted_at_[c] - middle_[a].position_W).cross(impulse_W_[c]);
    if (!cut_[b]) mean_spin_W_[b] += (acted_at_[c] - middle_[b].position_W).cross(impulse_W_[c]);
  }
  pool_->ForEachOf(n, [&](size_t i) {
    Body& b = bodies_[i];
    if (b.kind == BodyKind::kKinematic) {
      b.position_W = begin_[i].pose.position_W + dt_ * b.linear_velocity_W;
      b.rotation_WB = Turned(dt_ * b.angular_velocity_W, begin_[i].pose.rotation_WB);
    }
    if (!b.Moves()) return;
    const Free& free = free_[i];
    const Vector3 after =
        mean_spin_W_[i].isZero(0) ? free.spin_W : Vector3(free.spin_W + SpinOf(b, free.half_WB, mean_spin_W_[i]));
    b.position_W = begin_[i].pose.position_W + dt_ * mean_W_[i];
    b.linear_velocity_W = 2 * mean_W_[i] - begin_[i].linear_W;
    b.rotation_WB = Turned(FreeRotation(b.inertia_B, free.half_WB, after, 0.5 * dt_), free.half_WB);
    b.angular_velocity_W = AngularVelocityAfter(b.inertia_B, free.half_WB, after, b.rotation_WB);
    mean_spin_W_[i] = 0.5 * (free.spin_W + after);
    travel_[i] = dt_ * b.linear_velocity_W;
  });
}

// [m/s] of a body's point halfway.
Vector3 Crowd::MeanVelocity(int i, const Vector3& point) const {
  return mean_W_[i] + mean_spin_W_[i].cross(point - middle_[i].position_W);
}

// [m] that a body takes a held contact on from halfway to the end.
Vector3 Crowd::TakesOn(int i, size_t c) const {
  const Vector3 moved = bodies_[i].position_W - middle_[i].position_W;
  if (TurnsInItself(i)) return moved;
  const Vector3 turn = 0.5 * dt_ * VisibleSpin(shapes_[i], bodies_[i].rotation_WB, mean_spin_W_[i]);
  const Vector3 along = turn.cross(acted_at_[c] - middle_[i].position_W);
  return moved + along + 0.5 * turn.cross(along);
}

// Where a held contact is at the end: between where its two bodies took it, or as far from there as they may have moved against each other.
Crowd::Place Crowd::PlaceAtEnd(size_t c) const {
  const int a = held_[c].body_a, b = held_[c].body_b;
  const Vector3 with_a = TakesOn(a, c), with_b = TakesOn(b, c);
  return {acted_at_[c] + 0.5 * (with_a + with_b),
          0.5 * (with_a - with_b).norm() + dt_ * ((begin_[b].linear_W - begin_[a].linear_W).norm() +
                                                  (mean_W_[b] - mean_W_[a]).norm() + SlipOf(c).norm())};
}

// Where held contacts are found again, what they carried, and the overlap that each pair began with.
void Crowd::FollowHeld() {
  follows_.assign(held_.size(), -1);
  carried_W_.assign(near_->size(), Vector3::Zero());
  before_.assign(near_->size(), 0.0);
  ForEachPair(held_, *near_, [&](size_t h, size_t h_end, size_t e, size_t e_end) {
    if (e == e_end) return;
    for (size_t c = h; c < h_end; ++c) {
      const std::span<const Contact> of_pair = std::span(*near_).subspan(e, e_end - e);
      const double far = kSamePlace * Size(held_[c]);
      const Place place = PlaceAtEnd(c);
      const int found = FindAgain(of_pair, held_[c].feature, place.point_W, far + place.reach, far);
      if (found < 0) continue;
      follows_[c] = static_cast<int>(e) + found;
      carried_W_[follows_[c]] += impulse_W_[c];
    }
  });
  ForEachPair(start_, *near_, [&](size_t s, size_t s_end, size_t e, size_t e_end) {
    double deepest = 0;
    for (size_t c = s; c < s_end; ++c) deepest = std::min(deepest, start_[c].gap);
    for (size_t k = e; k < e_end; ++k) before_[k] = deepest;
  });
}

// Returns whether gaps meet their end, and marks the islands in which they do not.
bool Crowd::Judge(int pass) {
  const std::vector<Contact>& end = *near_;
  FollowHeld();
  disturbed_.assign(bodies_.size(), 0);
  bool met = true;
  for (size_t e = 0; e < end.size(); ++e) {
    const double size = Size(end[e]);
    if (cut_[end[e].body_a] && cut_[end[e].body_b]) continue;
    // What rolls on a rim or a cap, whose points do not go with it, would add a little in every step: who is beyond the tolerance goes no
    // deeper.
    const double tolerance = settings_.overlap_tolerance * size;
    const bool rolls = shapes_[end[e].body_a].HasAxis() || shapes_[end[e].body_b].HasAxis();
    const double deepest = before_[e] - (rolls && before_[e] < -tolerance ? kSamePoint * size : tolerance);
    if (end[e].gap >= deepest - dt_ * YieldOf(end[e])) continue;
    met = false;
    Disturb(end[e]);
  }
  met = (!LetGo() || pass > kLettingGo) && met;
  met = !Gains() && met;
  if (met) return true;
  // All of an island that misses its end somewhere.
  edges_.clear();
  for (const Contact& contact : held_) edges_.emplace_back(contact.body_a, contact.body_b);
  islands::BuildPartition({cut_, edges_}, &partition_);
  for (int island = 0; island < partition_.num_islands(); ++island) {
    const std::span<const int> members = partition_.bodies_of(island);
    if (std::none_of(members.begin(), members.end(), [&](int i) { return disturbed_[i] != 0; })) continue;
    for (const int i : members) disturbed_[i] = 1;
  }
  return false;
}

// Its bodies are solved again.
void Crowd::Disturb(const Contact& contact) {
  for (const int i : {contact.body_a, contact.body_b})
    if (!cut_[i]) disturbed_[i] = 1;
}

// What presses a pair that ends open holds by a plane that is not the pair's at the end. It is posed once more as it ends, then let go.
// Returns whether there is any. (By the convex models what rubs parts.)
bool Crowd::LetGo() {
  if (settings_.model != Model::kCoulomb) return false;
  bool any = false;
  ForEachPair(held_, *near_, [&](size_t h, size_t h_end, size_t e, size_t e_end) {
    if (h == h_end) return;
    const double gap = LeastGap(std::span(*near_).subspan(e, e_end - e));
    if (gap <= std::max(0.0, GapAtStart(held_[h])) + settings_.overlap_tolerance * Size(held_[h])) return;
    for (size_t c = h; c < h_end; ++c) {
      if (impulse_W_[c].isZero(0)) continue;
      ++held_of_[c].opened;
      any = true;
      Disturb(held_[c]);
    }
  });
  return any;
}

// Whether a held contact is there at the end, in much the same plane.
bool Crowd::IsFoundAgain(size_t c) const {
  const Contact& contact = held_[c];
  const double alike = TurnsInItself(contact.body_a) || TurnsInItself(contact.body_b) ? -1 : kAlike;
  return follows_[c] >= 0 && (*near_)[follows_[c]].normal_W.dot(contact.normal_W) > alike;
}

// [J] of a body, its height counted from where the step began.
double Crowd::EnergyOf(size_t i, bool at_end) const {
  const Body& b = bodies_[i];
  const State& s = begin_[i];
  const Quaternion& rotation = at_end ? b.rotation_WB : s.pose.rotation_WB;
  const Vector3 v = at_end ? b.linear_velocity_W : s.linear_W,
                w = rotation.conjugate() * (at_end ? b.angular_velocity_W : s.angular_W);
  const double height = at_end ? (b.mass * settings_.gravity + b.force_W).dot(b.position_W - s.pose.position_W) : 0;
  return 0.5 * b.mass * v.squaredNorm() + 0.5 * w.dot(b.inertia_B * w) - height;
}

// [m/s] mean velocity of a held contact.
Vector3 Crowd::SlipOf(size_t c) const {
  return MeanVelocity(held_[c].body_b, acted_at_[c]) - MeanVelocity(held_[c].body_a, acted_at_[c]) +
         SurfaceSlip(held_[c]);
}

// [J] of what a contact carried.
double Crowd::WorkOf(size_t c) const { return impulse_W_[c].dot(SlipOf(c)); }

// [J] that moving walls and belts do by an impulse on body_b, halfway or at the end.
double Crowd::WorkOfWalls(const Contact& c, const Vector3& point, const Vector3& impulse_W, bool at_end) const {
  double work = -impulse_W.dot(SurfaceSlip(c));
  for (const auto& [i, sign] : {std::pair{c.body_a, 1.0}, std::pair{c.body_b, -1.0}}) {
    const Body& wall = bodies_[i];
    if (wall.kind != BodyKind::kKinematic) continue;
    const Vector3 centre = at_end ? wall.position_W : middle_[i].position_W;
    work += sign * impulse_W.dot(wall.linear_velocity_W + wall.angular_velocity_W.cross(point - centre));
  }
  return work;
}

// Whether bodies that press each other gained energy, by contacts whose levers are not those of the step, or by what pushed an overlap
// out; marks the bodies of these contacts.
bool Crowd::Gains() {
  edges_.clear();
  pressing_.clear();
  for (size_t c = 0; c < held_.size(); ++c) {
    if (impulse_W_[c].isZero(0)) continue;
    edges_.emplace_back(held_[c].body_a, held_[c].body_b);
    pressing_.push_back(static_cast<int>(c));
  }
  islands::BuildPartition({cut_, edges_}, &gaining_);
  lost_.assign(bodies_.size(), INFINITY);
  gain_.resize(bodies_.size());
  at_hand_.resize(bodies_.size());
  pool_->ForEachOf(bodies_.size(), [&](size_t i) {
    if (cut_[i]) return;
    const double before = EnergyOf(i, false);
    gain_[i] = EnergyOf(i, true) - before;
    at_hand_[i] = before + bodies_[i].mass * least_energy_;
  });
  bool gains = false;
  for (int island = 0; island < gaining_.num_islands(); ++island) {
    double gain = 0, at_hand = 0;
    for (const int i : gaining_.bodies_of(island)) gain += gain_[i], at_hand += at_hand_[i];
    for (const int k : gaining_.contacts_of(island)) {
      const int c = pressing_[k];
      gain -= WorkOfWalls(held_[c], acted_at_[c], impulse_W_[c], false);
    }
    for (const int i : gaining_.bodies_of(island)) lost_[i] = -gain;
    if (gain <= kGain * at_hand) continue;
    for (const int i : gaining_.bodies_of(island)) pushes_[i] = 0, gained_[i] = 1;  // what it costs is not there
    for (const int k : gaining_.contacts_of(island)) {
      const int c = pressing_[k];
      const double push = std::exchange(held_of_[c].push, 0.0);
      held_of_[c].allowed -= push;
      if (push == 0 && WorkOf(c) <= 0.1 * kGain * at_hand) continue;
      gains = true;
      Disturb(held_[c]);
    }
  }
  return gains;
}

// A point of a body in its frame, and back; what turns in itself has none of its own.
Vector3 Crowd::Inside(int i, const Pose& pose, const Vector3& point) const {
  const Vector3 r = point - pose.position_W;
  return TurnsInItself(i) ? r : Vector3(SeenAs(i, pose.rotation_WB).conjugate() * r);
}
Vector3 Crowd::Outside(int i, const Pose& pose, const Vector3& point) const {
  return pose.position_W + (TurnsInItself(i) ? point : Vector3(SeenAs(i, pose.rotation_WB) * point));
}

// [m] between the points of a contact at the end, along its normal.
double Crowd::GapAlong(const Contact& c, const Held& held) const {
  const auto end = [&](int i) -> Pose { return {bodies_[i].position_W, bodies_[i].rotation_WB}; };
  return c.normal_W.dot(Outside(c.body_b, end(c.body_b), held.in_b) - Outside(c.body_a, end(c.body_a), held.in_a));
}

Vector3 Crowd::Centre(const Contact& c) const {
  const double share = Share(c);
  return share * middle_[c.body_a].position_W + (1 - share) * middle_[c.body_b].position_W;
}

// [m/s] mean normal velocity with which a contact that ends at this gap would end at the one that is allowed.
double Crowd::TargetOf(const Contact& contact, double gap, double allowed) const {
  const double u = contact.normal_W.dot(MeanVelocity(contact.body_b, contact.point_W) -
                                        MeanVelocity(contact.body_a, contact.point_W));
  return u - (gap - allowed) / dt_;
}

Path Crowd::PathOf(int i) const {
  const State& s = begin_[i];
  return PathThrough(s.pose, s.linear_W, (1 / dt_) * (mean_W_[i] - s.linear_W),
                     VisibleSpin(shapes_[i], s.pose.rotation_WB, s.angular_W), SeenAs(i, bodies_[i].rotation_WB), dt_,
                     TurnsInItself(i) ? 0 : shapes_[i].radius());
}

// A contact that is not found again, or was not disturbed, as it is.
void Crowd::Keep(size_t c) {
  Held old = held_of_[c];
  Contact contact = held_[c];
  contact.point_W = acted_at_[c];
  const int a = contact.body_a, b = contact.body_b;
  if (disturbed_[a] || disturbed_[b])
    old.target = std::min(TargetOf(contact, GapAlong(contact, old), old.allowed), 0.0);  // what is past pushes nobody
  next_.push_back(contact);
  next_of_.push_back(old);
  next_impulse_W_.push_back(impulse_W_[c]);
  next_centre_.push_back(Centre(contact));
}

// The contact where the step began, if it was there.
const Contact* Crowd::AtStart(const Contact& end) const {
  const auto [first, last] = std::equal_range(start_.begin(), start_.end(), end, EarlierPair);
  const int a = end.body_a, b = end.body_b;
  const auto back = [&](int i) -> Vector3 {
    return Outside(i, begin_[i].pose, Inside(i, {bodies_[i].position_W, bodies_[i].rotation_WB}, end.point_W));
  };
  const Vector3 with_a = back(a), with_b = back(b);
  const double far = kSamePlace * Size(end);
  const int found =
      FindAgain({first, last}, end.feature, 0.5 * (with_a + with_b), far + 0.5 * (with_a - with_b).norm(), far);
  return found >= 0 && first[found].normal_W.dot(end.normal_W) > 0 ? &first[found] : nullptr;
}

// Of a body, in the pass as it is now.
Course Crowd::CourseOf(int i) const {
  return {begin_[i].pose,
          middle_[i],
          {bodies_[i].position_W, SeenAs(i, bodies_[i].rotation_WB)},
          mean_W_[i],
          mean_spin_W_[i],
          TurnsInItself(i),
          shapes_[i].kind() == ShapeKind::kSphere};
}

// A contact at the end, at the lever of halfway: on the chord of each body's point.
void Crowd::Aim(size_t e) {
  Contact contact = (*near_)[e];
  const double size = Size(contact);
  if (contact.gap > kReach * size && carried_W_[e].isZero(0)) return;
  const int a = contact.body_a, b = contact.body_b;
  const auto halfway = [&](int i) -> Vector3 {
    const Vector3 r = contact.point_W - bodies_[i].position_W;
    if (TurnsInItself(i)) return middle_[i].position_W + r;
    const Vector3 before = begin_[i].pose.rotation_WB * (SeenAs(i, bodies_[i].rotation_WB).conjugate() * r);
    return middle_[i].position_W + 0.5 * (r + before);
  };
  const Vector3 half = 0.5 * contact.gap * contact.normal_W;
  Held held;
  held.in_a = Inside(a, {bodies_[a].position_W, bodies_[a].rotation_WB}, contact.point_W - half);
  held.in_b = Inside(b, {bodies_[b].position_W, bodies_[b].rotation_WB}, contact.point_W + half);
  const double share = Share(contact);
  const Contact* const start = AtStart(contact);
  if (shapes_[a].kind() == ShapeKind::kSphere && shapes_[b].kind() == ShapeKind::kSphere) {
    contact.normal_W = (middle_[b].position_W - middle_[a].position_W).normalized();
    contact.point_W = middle_[a].position_W + shapes_[a].radius() * contact.normal_W;
  } else if (start && start->gap <= kReach * size) {
    const Course course_a = CourseOf(a), course_b = CourseOf(b);
    const Vector3 end = contact.point_W;
    contact.point_W = share * OnArc(course_a, start->point_W, end) + (1 - share) * OnArc(course_b, start->point_W, end);
    const double turn = (contact.normal_W - start->normal_W).norm();
    contact.normal_W = (start->normal_W + contact.normal_W).normalized();
    TurnLever((contact.gap - start->gap) / dt_, turn, course_a, course_b, size, &contact);
  } else {
    contact.point_W = share * halfway(a) + (1 - share) * halfway(b);
  }
  held.push = before_[e] < -settings_.overlap_tolerance * size && pushes_[a] && pushes_[b] ? PushOf(before_[e]) : 0;
  held.allowed = start && std::abs(start->gap) <= settings_.overlap_tolerance * size ? std::max(before_[e], start->gap)
                                                                                     : before_[e] + held.push;
  held.allowed -= dt_ * YieldOf(contact);
  // What is asked to part may gain by it: who did in this piece is not asked again.
  const double most = gained_[a] || gained_[b] ? 0 : kFastest * floor_;
  held.target = std::min(TargetOf(contact, contact.gap, held.allowed), most);
  next_.push_back(contact);
  next_of_.push_back(held);
  next_impulse_W_.push_back(WithinCone(contact, carried_W_[e]));
  next_centre_.push_back(Centre(contact));
}

// A pair that ends in an overlap from which the nearest way out is not the way in: it carries where it met.
bool Crowd::Guard(size_t e, size_t e_end) {
  const Contact& pair = (*near_)[e];
  const int a = pair.body_a, b = pair.body_b;
  const double size = Size(pair);
  bool astray = false;
  if (YieldOf(pair) > 0) return false;
  for (size_t k = e; k < e_end; ++k) {
    const Contact& c = (*near_)[k];
    if (c.gap >= before_[k] - settings_.overlap_tolerance * size) continue;
    astray = astray || TargetOf(c, c.gap, before_[k]) * dt_ > kAstray * size;
  }
  if (!astray) return false;
  const Path path_a = PathOf(a), path_b = PathOf(b);
  const double t = meeting_.First(
      {&shapes_[a], &shapes_[b], path_a, path_b, dt_, before_[e], 0.5 * settings_.overlap_tolerance * size});
  if (t >= dt_) return false;
  const Pose at_a = path_a.At(t), at_b = path_b.At(t);
  // What closing walls squeeze may have no way out: it is sent back no faster than it came. Who would gain by it is not sent back.
  const double most = driven_ ? kFastest * floor_ + (begin_[b].linear_W - begin_[a].linear_W).norm()
                              : (gained_[a] || gained_[b] ? 0 : INFINITY);
  probe_.clear();
  CollideShapes(shapes_[a], at_a.placement(), shapes_[b], at_b.placement(), settings_.overlap_tolerance * size,
                &probe_);
  for (Contact c : probe_) {
    c.body_a = a;
    c.body_b = b;
    c.friction = pair.friction;
    c.restitution = pair.restitution;
    c.surface_W = pair.surface_W;
    const Vector3 half = 0.5 * c.gap * c.normal_W;
    Held held;
    held.in_a = Inside(a, at_a, c.point_W - half);
    held.in_b = Inside(b, at_b, c.point_W + half);
    held.pressed = true;
    const double share = Share(c);
    const Vector3 with_a = c.point_W + (middle_[a].position_W - at_a.position_W),
                  with_b = c.point_W + (middle_[b].position_W - at_b.position_W);
    c.point_W = share * with_a + (1 - share) * with_b;
    held.allowed = before_[e];
    held.target = std::min(TargetOf(c, GapAlong(c, held), held.allowed), most);
    next_.push_back(c);
    next_of_.push_back(held);
    next_impulse_W_.push_back(Vector3::Zero());
    next_centre_.push_back(Centre(c));
  }
  return !probe_.empty();
}

// The contacts of the next pass: what is disturbed is posed anew, as it ends now.
void Crowd::NextTargets() {
  next_.clear();
  next_of_.clear();
  next_impulse_W_.clear();
  next_centre_.clear();
  ForEachPair(held_, *near_, [&](size_t h, size_t h_end, size_t e, size_t e_end) {
    const Contact& pair = h < h_end ? held_[h] : (*near_)[e];
    const bool disturbed = disturbed_[pair.body_a] || disturbed_[pair.body_b];
    for (size_t c = h; c < h_end; ++c) {
      held_of_[c].pressed = held_of_[c].pressed || !impulse_W_[c].isZero(0);
      if (!disturbed || (!IsFoundAgain(c) && held_of_[c].pressed && held_of_[c].opened < kOpenings)) Keep(c);
    }
    if (!disturbed || e == e_end || Guard(e, e_end)) return;
    for (size_t k = e; k < e_end; ++k) Aim(k);
  });
  std::swap(held_, next_);
  std::swap(held_of_, next_of_);
  std::swap(impulse_W_, next_impulse_W_);
  std::swap(centre_, next_centre_);
}

// Velocities at the end pose: contacts that are closed hold what does not come as a blow; then blows.
void Crowd::Settle(StepReport* report) {
  const std::vector<Contact>& end = *near_;
  problem_.clear();
  closed_.clear();
  for (size_t e = 0; e < end.size(); ++e) {
    if (cut_[end[e].body_a] && cut_[end[e].body_b]) continue;
    const Contact& contact = end[e];
    const double size = Size(contact), tolerance = settings_.overlap_tolerance * size;
    const bool pressed = !carried_W_[e].isZero(0);
    if (contact.gap > (pressed ? kReach * size : tolerance)) continue;
    // Near, and not pressed, is closed only where the pair was near all the time, or what passes by would be caught.
    if (!pressed && contact.gap > kSamePoint * size && (IsRound(contact) || GapAtStart(contact) > tolerance)) continue;
    problem_.push_back(contact);
    closed_.push_back(static_cast<int>(e));
  }
  Part(problem_);
  std::copy(bodies_.begin(), bodies_.end(), posed_.begin());
  // What these carried is taken back, as far as their law allows it.
  beyond_W_.resize(problem_.size());
  local_.resize(problem_.size());
  for (size_t c = 0; c < problem_.size(); ++c) {
    Vector3& carried = carried_W_[closed_[c]];
    beyond_W_[c] = carried - WithinCone(problem_[c], carried);
    carried -= beyond_W_[c];
    local_[c] = frames_[c].transpose() * carried;
    if (carried.isZero(0)) continue;
    Body &a = posed_[problem_[c].body_a], &b = posed_[problem_[c].body_b];
    if (a.Moves()) a.ApplyImpulse(carried, problem_[c].point_W);
    if (b.Moves()) b.ApplyImpulse(-carried, problem_[c].point_W);
  }
  hits_.assign(problem_.size(), 0);
  targets_.assign(problem_.size(), 0.0);
  pool_->ForEachOf(problem_.size(), [&](size_t c) {
    const Contact& contact = problem_[c];
    targets_[c] = -YieldOf(contact);
    if (targets_[c] < 0) return;
    // What it had as the step began, and fell on a wall by then.
    const auto velocity = [&](int i) -> Vector3 {
      return begin_[i].linear_W + begin_[i].angular_W.cross(contact.point_W - bodies_[i].position_W);
    };
    const int a = contact.body_a, b = contact.body_b;
    double least = std::max(0.0, -contact.normal_W.dot(velocity(b) - velocity(a)));
    if (cut_[a] || cut_[b]) {
      const Body& body = bodies_[cut_[a] ? b : a];
      const double fall = (cut_[a] ? -1 : 1) * contact.normal_W.dot(settings_.gravity + body.force_W / body.mass);
      const double way = -dt_ * contact.normal_W.dot(mean_W_[b] - mean_W_[a]);
      least = std::sqrt(least * least + 2 * std::max(0.0, fall * way));
    }
    if (contact.restitution == 0 || least <= std::max(threshold_, SlightApproach(contact, settings_.gravity, dt_)))
      return;
    hits_[c] = 1;
    targets_[c] = ReboundSpeed(contact, least);
  });
  rebounds_.assign(problem_.size(), 0.0);
  blows_.assign(problem_.size(), Vector3::Zero());
  collisions_.assign(problem_.size(), Vector3::Zero());
  struck_.assign(partition_.num_islands(), {});
  bounces_of_.assign(partition_.num_islands(), 0);
  const double start = Seconds();
  ForEachIsland([&](int island, Worker* worker) { SettleIsland(island, worker); });
  const double solved = Seconds(), took = solved - start;
  TellSlice({"solve", start, solved});
  TellObserver();
  double held = 0, struck = 0;
  for (const auto& o : outcomes_) held += o.seconds;
  for (const auto& o : struck_) struck += o.seconds;
  const double share = held + struck > 0 ? held / (held + struck) : 1;
  Report(outcomes_, &report->static_qp, share * took, &report->seconds.static_qp, report);
  Report(struck_, &report->collision_qp, (1 - share) * took, &report->seconds.collision_qp, report);
  for (const int b : bounces_of_) report->bounces += b;
  for (int island = 0; island < partition_.num_islands(); ++island) {
    const double error =
        std::max(outcomes_[island].certificate.natural_map_max, struck_[island].certificate.natural_map_max);
    for (const int i : partition_.bodies_of(island)) errors_[i] = std::max(errors_[i], error);
  }
  for (size_t i = 0; i < bodies_.size(); ++i)
    if (!cut_[i]) SetTwist(TwistOf(posed_[i]), &bodies_[i]);
}

// Marks the bodies of an island that impulses join, as far as they have more energy together than carrying left them and took from them.
// Returns whether there are any.
bool Crowd::MarkGains(int island, Worker* worker) const {
  const std::span<const int> contacts = partition_.contacts_of(island), bodies = partition_.bodies_of(island);
  const auto place = [&](int i) {
    return static_cast<int>(std::lower_bound(bodies.begin(), bodies.end(), i) - bodies.begin());
  };
  const auto first_of = [&](int c) {
    return place(cut_[problem_[c].body_a] ? problem_[c].body_b : problem_[c].body_a);
  };
  worker->parents.resize(bodies.size());
  worker->gains.assign(bodies.size(), 0.0);
  worker->works.assign(bodies.size(), 0.0);
  islands::DisjointSets parts(worker->parents);
  for (const int c : contacts) {
    const Contact& contact = problem_[c];
    const bool acts = !carried_W_[closed_[c]].isZero(0) || !(local_[c] + blows_[c] + collisions_[c]).isZero(0);
    if (acts && !cut_[contact.body_a] && !cut_[contact.body_b])
      parts.Union(place(contact.body_a), place(contact.body_b));
  }
  for (size_t k = 0; k < bodies.size(); ++k) {
    const Body& left = bodies_[bodies[k]];
    worker->gains[parts.Find(static_cast<int>(k))] +=
        posed_[bodies[k]].KineticEnergy() - (1 + kGain) * left.KineticEnergy() - kGain * left.mass * least_energy_;
  }
  for (const int c : contacts) {
    const int part = parts.Find(first_of(c));
    const Vector3 change = frames_[c] * (local_[c] + blows_[c] + collisions_[c]) - carried_W_[closed_[c]];
    worker->gains[part] -= WorkOfWalls(problem_[c], problem_[c].point_W, change, true);
    worker->works[part] += work_[closed_[c]];
  }
  bool any = false;
  worker->gaining.assign(bodies.size(), 0);
  for (size_t k = 0; k < bodies.size(); ++k) {
    const int part = parts.Find(static_cast<int>(k));
    worker->gaining[k] = worker->gains[part] + std::min(0.0, worker->works[part]) > 0;
    any = any || worker->gaining[k];
  }
  return any;
}

// What hits is first left out; blows follow in order of their speed, then at once. What bodies that gain energy by them hit is held with
// the rest: with the least speeds at which it rebounds, then with none. Where friction would make some even so, velocities stay those that
// the carrying impulses left.
void Crowd::SettleIsland(int island, Worker* worker) {
  const std::span<const int> contacts = partition_.contacts_of(island), bodies = partition_.bodies_of(island);
  if (contacts.empty()) return;
  worker->before.clear();
  worker->guess.clear();
  for (const int i : bodies) worker->before.push_back(TwistOf(posed_[i]));
  for (const int c : contacts) worker->guess.push_back(local_[c]);
  const auto gains = [&](int i) {
    return !cut_[i] && worker->gaining[std::lower_bound(bodies.begin(), bodies.end(), i) - bodies.begin()];
  };
  const auto take_back = [&](size_t k) {
    local_[contacts[k]] = worker->guess[k];
    blows_[contacts[k]].setZero();
    collisions_[contacts[k]].setZero();
  };
  for (int attempt = 1;; ++attempt) {
    const bool rebounds = std::any_of(contacts.begin(), contacts.end(), [&](int c) { return targets_[c] > 0; });
    Strike(island, worker);
    outcomes_[island].restitution_lowered = attempt > 1;
    if (!MarkGains(island, worker)) break;
    if (!rebounds) {
      for (size_t k = 0; k < bodies.size(); ++k)
        if (worker->gaining[k]) SetTwist(TwistOf(bodies_[bodies[k]]), &posed_[bodies[k]]);
      for (size_t k = 0; k < contacts.size(); ++k)
        if (gains(problem_[contacts[k]].body_a) || gains(problem_[contacts[k]].body_b)) take_back(k);
      break;
    }
    for (const int c : contacts) {
      if (attempt < kAttempts && !gains(problem_[c].body_a) && !gains(problem_[c].body_b)) continue;
      if (!hits_[c] || attempt >= kAttempts) targets_[c] = 0;
      hits_[c] = 0;
    }
    for (size_t k = 0; k < contacts.size(); ++k) take_back(k);
    for (size_t k = 0; k < bodies.size(); ++k) SetTwist(worker->before[k], &posed_[bodies[k]]);
  }
  const bool held_only = struck_[island].status == QpStatus::kNone;
  Record(island, held_only ? Stage::kStatic : Stage::kCollision, held_only ? outcomes_[island] : struck_[island],
         *worker);
}

// What does not hit is held, then blows follow.
void Crowd::Strike(int island, Worker* worker) {
  const std::span<const int> contacts = partition_.contacts_of(island), bodies = partition_.bodies_of(island);
  const ContactFrames all{problem_, frames_};
  worker->contacts.clear();
  for (const int c : contacts) {
    if (!hits_[c]) worker->contacts.push_back(c);
    if (hits_[c]) local_[c].setZero(), std::swap(targets_[c], rebounds_[c]);
  }
  outcomes_[island] =
      worker->responder.ResolveTargets({bodies, worker->contacts}, all, targets_, settings_, floor_, posed_, local_);
  struck_[island] = {};
  if (worker->contacts.size() == contacts.size()) return;
  // Weight has acted for the whole piece, but a blow has the speed of the moment in which it came.
  for (const int c : contacts) {
    Contact& contact = problem_[c];
    contact.restitution = (*near_)[closed_[c]].restitution;
    const double approach = -NormalVelocity(contact, posed_[contact.body_a], posed_[contact.body_b]);
    if (hits_[c] && approach > 0) contact.restitution = std::min(contact.restitution, rebounds_[c] / approach);
  }
  bounces_of_[island] = worker->sequential.Resolve(bodies, contacts, all, settings_.bounce_law,
                                                   {threshold_, settings_.bounce_limit, true}, posed_, blows_);
  struck_[island] =
      worker->responder.ResolveCollisions({bodies, contacts}, all, settings_, floor_, threshold_, posed_, collisions_);
  for (const int c : contacts)
    if (hits_[c]) std::swap(targets_[c], rebounds_[c]);
}

// Of a size: the deepest overlap that the piece made.
double Crowd::FreshOverlap() const {
  double worst = 0;
  for (size_t e = 0; e < near_->size(); ++e) {
    const Contact& c = (*near_)[e];
    if (!cut_[c.body_a] || !cut_[c.body_b]) worst = std::max(worst, (before_[e] - c.gap - dt_ * YieldOf(c)) / Size(c));
  }
  return worst;
}

// One piece of the step, from time t on. Where it misses its end and may be shortened it has done nothing; where something frozen was hit
// the step begins anew.
Crowd::Outcome Crowd::Piece(double t, double h, bool last, const FindContacts& find, CrowdMemory* memory,
                            StepReport* report) {
  start_ = *near_;
  Recall(*memory);
  Load(h);
  AllowPushes(*memory);
  Select();
  disturbed_.assign(bodies_.size(), 1);
  int pass = 1;
  for (;; ++pass) {
    Carry(pass == 1, report);
    Fly();
    const double looking = Seconds();
    find(travel_, near_);
    const double found = Seconds();
    report->seconds.detect += found - looking;
    TellSlice({"detect", looking, found});
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
  carried_at_.assign(near_->size(), -1);
  work_.assign(near_->size(), 0.0);
  for (size_t c = 0; c < held_.size(); ++c) {
    if (impulse_W_[c].isZero(0)) continue;
    if (follows_[c] >= 0) {
      carried_at_[follows_[c]] = static_cast<int>(impulses_.size());
      work_[follows_[c]] += WorkOf(c);
    }
    Contact contact = held_[c];
    contact.point_W = acted_at_[c];
    impulses_.push_back({contact, impulse_W_[c], t, h});
  }
  Settle(report);
  if (settings_.freezing == Freezing::kCertified && HitsFrozen()) return Outcome::kHitFrozen;
  Remember(h, memory);
  for (size_t c = 0; c < problem_.size(); ++c) {
    const int e = closed_[c];
    const Vector3 change = frames_[c] * (local_[c] + blows_[c] + collisions_[c]) - carried_W_[e];
    if (!change.isZero(0)) impulses_.push_back({(*near_)[e], change, t + h, 0, carried_at_[e]});
  }
  return Outcome::kDone;
}

void Crowd::Return(std::span<const State> states) {
  for (size_t i = 0; i < bodies_.size(); ++i) {
    Body& b = bodies_[i];
    b.position_W = states[i].pose.position_W;
    b.rotation_WB = states[i].pose.rotation_WB;
    SetTwist({states[i].linear_W, states[i].angular_W}, &b);
  }
}

// Marks what stands still as frozen and took a blow. One that would give it less speed than its weight does is a load like others.
// Returns whether any did.
bool Crowd::HitsFrozen() {
  hit_.assign(bodies_.size(), 0);
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
    memory->forces_W[closed_[c]] = 1 / h * (frames_[c] * local_[c] + beyond_W_[c]);
    blow_W_[closed_[c]] = frames_[c] * (blows_[c] + collisions_[c]);
  }
  ForEachPair(start_, *near_, [&](size_t s, size_t s_end, size_t e, size_t e_end) {
    if (s == s_end || e == e_end || !cut_[start_[s].body_a] || !cut_[start_[s].body_b]) return;
    for (size_t k = e; k < e_end; ++k)
      for (size_t c = s; c < s_end; ++c)
        if (start_[c].feature == (*near_)[k].feature) memory->forces_W[k] = start_force_W_[c];
  });
}

// What freezing looks at: the contacts that join bodies, now or before the step ends, and what acts at them.
void Crowd::FillFrame(double dt, std::span<const Vector3> forces_W) {
  frame_.dt = dt;
  frame_.gravity = settings_.gravity;
  frame_.rest_speed = settings_.gravity.norm() * dt;
  frame_.bodies = bodies_;
  joined_.clear();
  joined_at_.clear();
  frame_.frames.clear();
  frame_.holding.clear();
  frame_.collisions.clear();
  for (size_t c = 0; c < near_->size(); ++c) {
    const Contact& contact = (*near_)[c];
    const Body &a = bodies_[contact.body_a], &b = bodies_[contact.body_b];
    const bool known = c < forces_W.size() && !forces_W[c].isZero(0);
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
  Recall(memory);
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

// What moved pressed on what is frozen. Returns false where nothing holds that: it is frozen no more.
bool Crowd::Hold(double dt, CrowdMemory* memory) {
  if (settings_.freezing != Freezing::kCertified) return true;
  FillFrame(dt, memory->forces_W);
  bool held = true;
  pool_->ForEach(1, [&](int, int) { held = freezing_.Hold(frame_, impulses_, settings_); });  // idle workers help
  if (!held) return false;
  for (const CertifiedFreezing::Stop& s : freezing_.stops()) {
    const Vector3 balance_W = frame_.frames[s.contact] * s.balance;
    impulses_.push_back({joined_[s.contact], balance_W, 0, dt});
    memory->forces_W[joined_at_[s.contact]] += 1 / dt * balance_W;
  }
  return true;
}

void Crowd::Freeze(double dt, CrowdMemory* memory, StepReport* report) {
  FillFrame(dt, memory->forces_W);
  if (settings_.freezing == Freezing::kCertified) {
    pool_->ForEach(1, [&](int, int) { freezing_.EndFrame(frame_, was_frozen_, errors_, memory->still, settings_); });
    for (const CertifiedFreezing::Stop& s : freezing_.stops()) {
      impulses_.push_back({joined_[s.contact], frame_.frames[s.contact] * s.stop, dt, 0});
      memory->forces_W[joined_at_[s.contact]] += 1 / dt * (frame_.frames[s.contact] * s.balance);
    }
  }
  if (settings_.freezing == Freezing::kPaper) FreezeLikePaper(frame_, settings_, &memory->freeze_counters);
  for (size_t i = 0; i < bodies_.size(); ++i) {
    const Body& body = bodies_[i];
    if (body.kind != BodyKind::kDynamic || body.removed) continue;
    report->newly_frozen += body.frozen && !was_frozen_[i];
    report->woken += !body.frozen && was_frozen_[i];
    (body.frozen ? report->frozen : report->awake) += 1;
    report->kinetic_energy += body.KineticEnergy();
  }
  if (settings_.freezing == Freezing::kCertified && report->frozen > 0)
    report->frozen_imbalance = std::max(report->frozen_imbalance, freezing_.worst_imbalance());
}

// Of the last piece.
void Crowd::ReportIslands(StepReport* report) const {
  for (int i = 0; i < partition_.num_islands(); ++i) {
    if (partition_.contacts_of(i).empty()) continue;
    IslandReport island;
    island.first_body = partition_.bodies_of(i)[0];
    island.bodies = static_cast<int>(partition_.bodies_of(i).size());
    island.contacts = static_cast<int>(partition_.contacts_of(i).size());
    island.collision_status = struck_[i].status;
    island.static_status = outcomes_[i].status;
    island.collision_iterations = struck_[i].iterations;
    island.static_iterations = outcomes_[i].iterations;
    island.map = std::max(struck_[i].map, outcomes_[i].map);
    island.certificate = struck_[i].certificate;
    island.certificate.Include(outcomes_[i].certificate);
    report->islands.push_back(island);
    report->largest_island_contacts = std::max(report->largest_island_contacts, island.contacts);
    report->active_contacts += island.contacts;
  }
}

// The step, piece by piece. Returns false where something frozen was hit, and is frozen no more.
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
  double t = 0, most = dt;
  for (int level = 0; dt - t > 1e-9 * dt;) {
    const double h = std::min(most, dt - t);
    const Outcome outcome = Piece(t, h, level == kLevels, find, memory, report);
    if (outcome == Outcome::kHitFrozen) return false;
    if (outcome == Outcome::kDone) {
      t += h;
    } else {
      ++level;
      most = 0.5 * h;
    }
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
  first_.resize(bodies.size());
  for (size_t i = 0; i < bodies.size(); ++i) first_[i] = StateOf(bodies[i]);
  first_near_ = *near;
  yields_.clear();
  Wake(dt, memory);
  first_contacts_ = memory->contacts;
  first_forces_W_ = memory->forces_W;
  first_lost_ = memory->lost;
  for (hit_.clear(); !Pieces(dt, find, memory, report) || !Hold(dt, memory); hit_.clear()) {
    yields_.clear();
    Return(first_);
    *near = first_near_;
    memory->contacts = first_contacts_;
    memory->forces_W = first_forces_W_;
    memory->lost = first_lost_;
    LookAtStart(dt, *memory);
    freezing_.Wake(frame_, hit_, settings_);
  }
  Freeze(dt, memory, report);
  for (const Contact& c : *near) report->penetration_max = std::max(report->penetration_max, -c.gap);
  report->overlapping += CountOverlapping(*near, [this](const Contact& c) { return Size(c); });
}

}  // namespace islet::motion
