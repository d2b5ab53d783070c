// The step of a small group: pieces, and the passes of a piece. Read Step at the end first.
#include "engine/motion/group/stepper.h"

#include <algorithm>
#include <cmath>

#include "engine/response/suite_frame.h"
#include "engine/rotation.h"
#include "qp/smallness.h"

namespace islet::motion {
namespace {

constexpr int kLevels = 10;  // times that a piece is halved

}  // namespace

void GroupOutcome::Clear() {
  pieces = bounces = passes = 0;
  unstepped = overlap = 0;
  overlapping = 0;
  restitution_lowered = record = false;
  impulses.clear();
  ends.clear();
  paths.clear();
  touching.clear();
  touching_force_W.clear();
  for (auto* answers : {&carried, &settled, &struck}) answers->clear();
  records.clear();
}

double Stepper::Size(const GroupPair& pair) const {
  return std::min(group_->shapes[pair.a]->size(), group_->shapes[pair.b]->size());
}

void Stepper::LoadState() {
  const size_t n = group_->bodies.size();
  state_.resize(n);
  for (size_t i = 0; i < n; ++i) state_[i] = StateOf(group_->bodies[i]);
  PlaceWalls(0, &state_);
  end_state_ = state_;
  middle_.resize(n);
  turned_.resize(n);
  spun_after_.resize(n);
  mean_W_.resize(n);
  ways_.assign(n, {});
  posed_ = group_->bodies;
  cut_.resize(n);
  for (size_t i = 0; i < n; ++i) cut_[i] = !posed_[i].Moves();
}

Vector3 Stepper::VisibleSpinOf(int i) const {
  return VisibleSpin(*group_->shapes[i], state_[i].pose.rotation_WB, state_[i].angular_W);
}

// [rad/s] at which what shows of a pair turns against each other.
double Stepper::TurnAgainst(const GroupPair& pair) const {
  const auto spin = [&](int i) -> Vector3 { return TurnsInItself(i) ? Vector3(Vector3::Zero()) : VisibleSpinOf(i); };
  return (spin(pair.b) - spin(pair.a)).norm();
}

// [rad/s] at which a round body rolls, or its axis circles its angular momentum.
double Stepper::RoundTurn(int i) const {
  const Body& b = group_->bodies[i];
  if (!group_->shapes[i]->HasAxis() || !b.Moves()) return 0;
  const Vector3 spin_B = state_[i].pose.rotation_WB.conjugate() * state_[i].angular_W;
  return std::max(std::abs(spin_B.z()), (b.inertia_B * spin_B).norm() / b.inertia_B(0, 0));
}

// Normals and levers are those of the middle of a piece. So nothing that is near turns by more than the way of one lever describes, and what
// touches turns against each other by much less: what it carries is right to the second order of that. What is round and touches rolls by
// 2 rad at most, and its axis circles as much: from about pi on, what contacts give it halfway ends on the other side.
double Stepper::ChooseLength(double rest) {
  double most = rest;
  for (const GroupPair& pair : group_->pairs) {
    const double apart = std::max(0.0, Apart(pair, state_)),
                 speed = (state_[pair.b].linear_W - state_[pair.a].linear_W).norm();
    const double near_at = apart > 0 ? 2 * apart / (speed + std::sqrt(speed * speed + 8 * pull_ * apart)) : 0;  // [s]
    for (const int i : {pair.a, pair.b}) {
      if (near_at >= most) break;
      if (TurnsInItself(i)) continue;
      const double turn = VisibleSpinOf(i).norm();
      if (turn * most > kLargestTurn) most = std::max(near_at, kLargestTurn / turn);
    }
  }
  for (size_t p = 0; p < group_->pairs.size(); ++p) {
    if (least_gap_[p] >= kFar) continue;
    const double turn = TurnAgainst(group_->pairs[p]),
                 round = std::max(RoundTurn(group_->pairs[p].a), RoundTurn(group_->pairs[p].b));
    if (turn * most > kTouchingTurn) most = std::min(most, std::max(kTouchingTurn / turn, brief_));
    if (round * most > 2) most = std::min(most, std::max(2 / round, brief_));
  }
  return most;
}

void Stepper::Commit(double t, double h) {
  carried_at_.assign(end_.size(), -1);
  last_ = end_;
  for (size_t c = 0; c < held_.size(); ++c) {
    if (impulse_W_[c].isZero(0)) continue;
    Contact contact = AsActed(c);
    contact.surface_W = held_of_[c].belt_W;
    if (follows_[c] >= 0) {
      carried_at_[follows_[c]] = static_cast<int>(out_->impulses.size());
      // What carried is remembered where it did. Of two edges that are all but parallel detection finds now this point and now that one,
      // and what rests would not balance.
      last_[follows_[c]].point_W = Carried(contact, Moment::kMiddle, Moment::kEnd);
    }
    out_->impulses.push_back({contact, impulse_W_[c], t, h});
  }
  force_W_.resize(end_.size());
  for (size_t e = 0; e < end_.size(); ++e) {
    force_W_[e] = (CarriedBy(e) + settle_W_[e]) / h;
    if (!settle_W_[e].isZero(0)) out_->impulses.push_back({end_[e], settle_W_[e], t + h, 0, carried_at_[e]});
    if (!strike_W_[e].isZero(0)) out_->impulses.push_back({end_[e], strike_W_[e], t + h, 0});
  }
  out_->ends.push_back(t + h);
  for (int i = 0; i < static_cast<int>(state_.size()); ++i) out_->paths.push_back(PathOf(i, h));
  state_ = end_state_;
  now_ = end_;
  now_pair_ = end_pair_;
  MeasureGaps();
}

void Stepper::Begin(double dt, const Settings& settings, const MixMaterial& mix, Group* group, GroupOutcome* outcome) {
  dt_ = dt;
  settings_ = settings;
  mix_ = &mix;
  group_ = group;
  out_ = outcome;
  int movers = 0;  // bodies that contacts can move
  pull_ = settings.gravity.norm();
  pulls_.clear();
  for (size_t i = 0; i < group->bodies.size(); ++i) {
    const Body& b = group->bodies[i];
    pull_ = std::max(pull_, b.arc_W.norm());
    if (!b.Moves()) continue;
    ++movers;
    if (b.force_W.isZero(0) && b.torque_W.isZero(0)) continue;
    pulls_.push_back({static_cast<int>(i), settings.gravity + b.force_W / b.mass,
                      b.radius * SpinOf(b, b.rotation_WB, b.torque_W).norm()});
    pull_ = std::max(pull_, pulls_.back().along_W.norm() + pulls_.back().twist);
  }
  const auto drives = [&](size_t i) { return group->bodies[i].kind == BodyKind::kKinematic; };
  floor_ = std::max({pull_ * dt, 1e-3 * FastestPoint(group->bodies, drives), 1e-12});
  threshold_ = 10 * settings.tolerance * floor_;
  const double brief = std::min(0.5, kBrief * std::max(1, movers));  // of the step
  brief_ = brief * dt;
  budget_ = static_cast<int>(4 / brief);
  LoadState();
  MeasureSunk(group->remembered);
  cuts_ = 0;
  FindTouching();
  RecallForces(
      group->remembered, group->remembered_force_W, now_,
      [&](const Contact& c) {
        return Size({c.body_a, c.body_b});
      },
      &force_W_);
  step_gap_.resize(group->pairs.size());
  for (size_t p = 0; p < group->pairs.size(); ++p) step_gap_[p] = GapBefore(static_cast<int>(p));
  work_ = 0;
  yields_.assign(group->pairs.size(), 0.0);
  pays_.assign(group->pairs.size(), false);
  taken_.assign(group->pairs.size(), 0.0);
  purse_.assign(group->pairs.size(), 0.0);
}

// What carries in a piece of this length, with those that meet slowly within it, and the course that follows. Returns the moment of the
// first blow; h: none.
double Stepper::FindCourse(double h) {
  double moment = h;
  freed_.assign(group_->pairs.size(), kStays);
  guards_.clear();
  guard_of_.clear();
  for (int round = 0; round < kPasses; ++round) {
    SelectHeld(h);
    for (size_t g = 0; g < guards_.size(); ++g) {
      const int pair = guard_of_[g].pair;
      const double target = ((1 - PushOut(pair)) * GapBefore(pair) - guard_of_[g].gap) / h;
      Hold(pair, target, guard_of_[g].faces_a, guard_of_[g].faces_b, guards_[g], Vector3::Zero(), h);
    }
    Carry(h, true);
    Fly(h);
    moment = FindMeeting(h);
    if (!returned_ && !guarded_) break;
  }
  return moment;
}

// Passes until gaps meet their end, and what follows there: the velocities, and the blow that ends the piece. What gaps miss is work:
// where that is too much, they miss less. A blow that is found on the way ends the piece earlier. Returns whether an overlap is left
// that is too deep; where the piece may be halved nothing is settled then.
bool Stepper::Refine(bool may_halve, bool* cut, double* h) {
  DetectEnd();
  double missed = Missed();
  const bool moves = LeversMove(*h) || NormalsMove() || SinksFreely();
  bool redone = met_;  // what is on the way was left to what carries, or the way is not the one that was searched
  int pass = 1;
  lifts_ = true;
  // Where pieces before have missed as much as the step may, this one misses nothing.
  double enough = DeepestSinceStart() > kTouching ? kExact : kTouching;
  for (bool gained = false;;
       gained = true, enough = kExact) {  // then nothing is lifted that gets no deeper than its pair is
    while (pass < kPasses && (missed > enough || (pass == 1 && moves) || (gained && lifts_))) {
      lifts_ = !gained;
      ++out_->passes;
      redone = true;
      NextTargets(*h);
      Carry(*h, false);
      Fly(*h);
      // The blow has moved. A little later at most: the way was searched up to h.
      if (*cut) *h = EndAtBlow(*h, *h, std::min((1 + kBrief) * *h, dt_ - time_of_piece_));
      DetectEnd();
      if (HitsEarlier()) {
        const int blow = cut_pair_;
        const double moment = FindMeeting(*h);
        if (moment < *h) {
          *cut = true;
          *h = EndAtBlow(*h, moment, *h);
          DetectEnd();
        } else {
          cut_pair_ = blow;
        }
      }
      missed = std::max(Missed(), gained ? Shifted() : 0);
      ++pass;
    }
    const double fresh = FreshOverlap();
    const bool deep =
        fresh > kTouching || (fresh > kExact && DeepestSinceStart() > kTouching) || (redone && WayIsBarred(*h));
    if (may_halve && deep) return true;
    Settle();
    strike_W_.assign(end_.size(), Vector3::Zero());
    if (*cut) Strike();
    KeepAccounts(*h);
    missed = std::max(missed, Shifted());
    if (!gains_ || (missed <= kExact && !lifts_) || pass >= kPasses) return deep;
    Fly(*h);  // as fast as before the blow, or what hit would carry
  }
}

// One try at the next piece: it is done, or to be done again. Returns false if there is no way on.
bool Stepper::Piece(Progress* p) {
  work_ += kSolveWork + static_cast<int>(group_->pairs.size()) / kSolveWork;
  yields_before_ = yields_;
  const auto try_again = [this] {
    yields_ = yields_before_;
    return true;
  };
  time_of_piece_ = p->t;
  PlaceWalls(p->t, &state_);
  const double rest = dt_ - p->t;
  double h = ChooseLength(std::min(rest, p->most));
  if (rest - h < 0.2 * h && p->events == 0) h = std::min(rest, 1.2 * h);
  if (h < kBrief * dt_) pays_.assign(group_->pairs.size(), false);  // a fifth of an overlap at once would be a blow
  const double moment = FindCourse(h);
  bool cut = moment < h;
  if (cut) h = EndAtBlow(h, moment, h);
  const bool may_halve = p->level < kLevels, deep = Refine(may_halve, &cut, &h);
  const bool yields = std::any_of(yields_.begin(), yields_.end(), [](double y) { return y > 0; });
  if (!(deep && may_halve) && gains_ && Pushed()) {  // it cost more than that: not now
    pays_.assign(group_->pairs.size(), false);
    return try_again();
  }
  if (may_halve && (deep || (gains_ && !yields))) {
    ++p->level;
    p->most = 0.5 * h;
    return try_again();
  }
  if (deep || (creates_ && !yields)) return false;
  if (p->events == 0 || work_ < group_->most_work / 2) {  // a step is one without more of them, too
    // Impulses of a piece before that was that short are no forces.
    double end = std::min(SlipEnds(h), p->before < kBrief * dt_ ? h : SupportEnds(h));
    if (end == h && h > kBrief * dt_ && (WasThereInPart(h) || SlipTurns(h))) end = 0.5 * h;
    if (end < h) {
      ++p->events;
      p->most = end;
      return try_again();
    }
  }
  Commit(p->t, h);
  p->before = h;
  p->t += h;
  cuts_ += cut;
  SeeWhoPays(h);
  p->most = p->level == 0 ? dt_ : 2 * std::max(h, p->most);
  p->level = std::max(0, p->level - 1);
  return true;
}

// What touches at the end, and the bodies there.
void Stepper::End() {
  out_->touching = out_->unstepped == 0 ? last_ : now_;
  out_->touching_force_W = force_W_;
  out_->overlap = 0;
  for (const Contact& c : now_) out_->overlap = std::max(out_->overlap, -c.gap);
  out_->overlapping = CountOverlapping(out_->touching, [&](const Contact& c) { return Size({c.body_a, c.body_b}); });
  for (size_t i = 0; i < group_->bodies.size(); ++i)
    if (group_->bodies[i].Moves()) SetState(state_[i], &group_->bodies[i]);
}

void Stepper::Step(double dt, const Settings& settings, const MixMaterial& mix, Group* group, GroupOutcome* outcome) {
  Begin(dt, settings, mix, group, outcome);
  Progress progress{.most = dt, .before = dt};
  while (dt - progress.t > kExact * dt) {
    ++outcome->pieces;
    if (work_ > group->most_work || !Piece(&progress)) {  // they stay where they are for the rest of the step
      outcome->unstepped = dt - progress.t;
      break;
    }
  }
  outcome->work = work_;
  End();
}

}  // namespace islet::motion
