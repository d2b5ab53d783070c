// In: poses at the end, and what was carried. Out: the velocities there, after a blow.
#include "engine/motion/group/stepper.h"

#include <algorithm>
#include <cmath>

#include "engine/response/suite_frame.h"
#include "qp/smallness.h"

namespace islet::motion {
namespace {

// of a size: gap below which a contact is closed beside one that presses, or about to hit
constexpr double kMet = 1e-8;
// restitution below which a blow is as brief: what does not rebound rocks over to where it did not press
constexpr double kRocks = 0.25;

}  // namespace

// Whether a force on a body may move one of a contact: it is one of them, or pushes it through what touches as the piece begins.
bool Stepper::ActsOn(int body, const Contact& contact) const {
  return joined_[body] == joined_[contact.body_a] || joined_[body] == joined_[contact.body_b];
}

// [m/s^2] fastest that weight and forces bring the bodies of a contact together. A force on one of them acts in its own sense, one on another
// in any that contacts may turn it to. What is held by others feels a little of it along any normal.
double Stepper::PullAlong(const Contact& contact) const {
  const Vector3& n = contact.normal_W;
  const Vector3 arcs_W = group_->bodies[contact.body_a].arc_W - group_->bodies[contact.body_b].arc_W;
  double along = std::abs(n.dot(settings_.gravity)) + std::max(0.0, n.dot(arcs_W)), twist = 0;
  for (const Pull& pull : pulls_) {
    if (!ActsOn(pull.body, contact)) continue;
    const double towards = n.dot(pull.along_W);
    along = std::max(along, pull.body == contact.body_a   ? towards
                            : pull.body == contact.body_b ? -towards
                                                          : std::abs(towards));
    twist = std::max(twist, pull.twist);
  }
  return std::max(kTrembling * pull_, along + twist);
}

// [m/s] a slower one is none, since weight ends it at once.
double Stepper::LeastRebound(const Contact& contact) const { return 0.5 * brief_ * PullAlong(contact); }

// [m/s] approaches above it are blows: what they do is not over at once. Where there have been too many in the step, it takes more
// and more.
double Stepper::CutSpeed(const Contact& contact) const {
  const double brief = 0.5 * brief_ / std::max(contact.restitution, kRocks);  // [s]
  const int beyond = std::clamp(cuts_ - budget_, 0, 60);
  return std::max(threshold_, std::ldexp(PullAlong(contact) * brief, beyond));
}

// Whether it is a blow, when it gets there: as fast as it is, or falls by then.
bool Stepper::WillHit(const Contact& contact, double opening) const {
  const double approach = std::max(0.0, -opening), cut = CutSpeed(contact);
  const bool closed = contact.gap <= kMet * Size({contact.body_a, contact.body_b});
  return approach * approach + (closed ? 0 : 2 * PullAlong(contact) * contact.gap) > cut * cut;
}

// Whether the impulse of a contact that presses is one that its velocity allows: closed, and stuck or rubbing.
bool Stepper::Agrees(const Contact& contact, const Vector3& impulse, const Vector3& velocity, double still) {
  const Vector3& n = contact.normal_W;
  const double press = n.dot(impulse), opening = n.dot(velocity);
  const Vector3 friction = impulse - press * n, slip = velocity - opening * n;
  if (std::abs(opening) > still) return false;
  if (slip.norm() <= still) return friction.norm() <= (1 + kNegligible) * contact.friction * press;
  return (friction + contact.friction * press / slip.norm() * slip).norm() <= kNegligible * press;
}

// The bodies of the contact problems, as they are at the end.
void Stepper::PoseAtEnd() {
  for (size_t i = 0; i < posed_.size(); ++i) SetState(end_state_[i], &posed_[i]);
}

// The impulses of contacts that still touch, redone at the end pose: what presses stays closed, what sticks stays. Contacts that
// hit are left to Strike. All that acted stays in its cone.
void Stepper::Settle() {
  settle_W_.assign(end_.size(), Vector3::Zero());
  PoseAtEnd();
  problem_.clear();
  problem_of_.clear();
  carried_W_.clear();
  bool settled = true;
  const double still = kSettled * settings_.tolerance * floor_;
  heirs_.resize(held_.size());
  for (size_t c = 0; c < held_.size(); ++c) heirs_[c] = impulse_W_[c].isZero(0) ? -1 : HeirOf(c);
  targets_.clear();
  for (size_t e = 0; e < end_.size(); ++e) {
    const Vector3 u = RelativeVelocity(end_[e], posed_[end_[e].body_a], posed_[end_[e].body_b]);
    const Vector3 carried = AllowedOf(e, u);
    const double size = Size(group_->pairs[end_pair_[e]]), normal = end_[e].normal_W.dot(u);
    if (carried.isZero(0)) {  // it takes part where it is closed, and no blow to come
      const double closed = Presses(end_pair_[e]) || WasHeld(e) ? kMet : kExact;
      if (end_[e].gap > closed * size || WillHit(end_[e], normal)) continue;
    }
    settled = settled && (carried.isZero(0) ? normal >= -still : Agrees(end_[e], carried, u, still));
    problem_.push_back(end_[e]);
    problem_of_.push_back(static_cast<int>(e));
    targets_.push_back(
        -std::max(yields_[end_pair_[e]], end_[e].gap > kTouching * size ? ClosingSpeed(end_[e], dt_) : 0));
    carried_W_.push_back(carried);
  }
  if (settled) return;
  local_impulses_.resize(problem_.size());
  for (size_t c = 0; c < problem_.size(); ++c) {
    ApplyImpulse(problem_[c], -carried_W_[c], posed_);
    local_impulses_[c] = ContactFrame(problem_[c].normal_W).transpose() * carried_W_[c];
  }
  SolveParts(targets_, floor_, &out_->settled);
  for (size_t c = 0; c < problem_.size(); ++c) {
    const int e = problem_of_[c];
    const Vector3 change = frames_[c] * local_impulses_[c] - carried_W_[c];
    settle_W_[e] = change - BeyondCone(e, change);
  }
  ApplyAtEnd(settle_W_);
}

// Velocities follow from the impulses, not from the solver that found them.
void Stepper::ApplyAtEnd(std::span<const Vector3> impulses_W) {
  PoseAtEnd();
  for (size_t e = 0; e < end_.size(); ++e)
    if (!impulses_W[e].isZero(0)) ApplyImpulse(end_[e], impulses_W[e], posed_);
  for (size_t i = 0; i < posed_.size(); ++i) {
    if (!posed_[i].Moves()) continue;
    end_state_[i].linear_W = posed_[i].linear_velocity_W;
    end_state_[i].angular_W = posed_[i].angular_velocity_W;
  }
}

// Near enough to a blow to take part in it. A ball has one point on each wall: before the seam of two floors it is near the edge of the next.
bool Stepper::IsThere(size_t at_end) const {
  const GroupPair& pair = group_->pairs[end_pair_[at_end]];
  const bool ball = (TurnsInItself(pair.a) && cut_[pair.b]) || (TurnsInItself(pair.b) && cut_[pair.a]);
  return end_[at_end].gap <= (ball ? kMet : kTogether) * Size(pair);
}

// Whether a contact is a blow where the piece ends: it strikes now, or when the next one begins, and carries nothing. What a push
// of the piece threw against it does not strike: Settle stops that. What the way was cut for strikes, however slowly it set out.
bool Stepper::Hits(size_t at_end) const {
  const Contact& c = end_[at_end];
  if (yields_[end_pair_[at_end]] > 0 || !CarriedBy(at_end).isZero(0)) return false;
  if (ClosedAtStart(at_end) && (cut_pair_ < 0 || (end_pair_[at_end] == cut_pair_ && IsCutForNew()))) return false;
  const double now = ClosingAtEnd(c);
  if (end_pair_[at_end] == cut_pair_) return now > CutSpeed(c);
  const auto mean = [&](int i) { return MeanVelocity(i, CarriedWith(i, c.point_W, Moment::kEnd, Moment::kMiddle)); };
  return std::min(now, c.normal_W.dot(mean(c.body_a) - mean(c.body_b))) > CutSpeed(c);
}

// Whether something hit before the piece ends, on the way that a pass has changed.
bool Stepper::HitsEarlier() const {
  for (size_t e = 0; e < end_.size(); ++e)
    if (end_[e].gap < GapBefore(end_pair_[e]) - 2 * kExact * Size(group_->pairs[end_pair_[e]]) && Hits(e)) return true;
  return false;
}

// Blows at the end pose: the queue, then the collision problem.                                     [SM04 Fig. 1, 1 and 2]
void Stepper::Strike() {
  problem_.clear();
  problem_of_.clear();
  strikes_.clear();
  for (size_t e = 0; e < end_.size(); ++e) {
    if (end_[e].gap > settings_.overlap_tolerance * Size(group_->pairs[end_pair_[e]])) continue;
    const double approach = -NormalVelocity(end_[e], posed_[end_[e].body_a], posed_[end_[e].body_b]);
    const bool hits = approach > CutSpeed(end_[e]) && yields_[end_pair_[e]] == 0;
    if (hits && !IsThere(e)) continue;
    problem_.push_back(end_[e]);
    problem_of_.push_back(static_cast<int>(e));
    strikes_.push_back(hits);
  }
  if (std::find(strikes_.begin(), strikes_.end(), true) == strikes_.end()) return;
  PartProblem();
  least_rebounds_.clear();
  resting_.clear();
  for (size_t c = 0; c < problem_.size(); ++c) {
    least_rebounds_.push_back(LeastRebound(problem_[c]));
    // What pressed in the piece rests, though its gap changes as it slides or turns.
    resting_.push_back(CarriedBy(problem_of_[c]).isZero(0) ? threshold_ : std::max(threshold_, least_rebounds_.back()));
  }
  bounces_.assign(problem_.size(), Vector3::Zero());
  local_impulses_.assign(problem_.size(), Vector3::Zero());
  for (int island = 0; island < partition_.num_islands(); ++island) {
    const IslandView view{partition_.bodies_of(island), partition_.contacts_of(island)};
    // What nothing hits has settled.
    if (std::none_of(view.contacts.begin(), view.contacts.end(), [&](int c) { return strikes_[c]; })) continue;
    const ContactFrames contacts{problem_, frames_};
    out_->bounces += sequential_.Resolve(view.bodies, view.contacts, contacts, settings_.bounce_law,
                                         {threshold_, settings_.bounce_limit, true, resting_, least_rebounds_, dt_},
                                         posed_, bounces_);
    for (const int c : view.contacts) {
      const double approach = -NormalVelocity(problem_[c], posed_[problem_[c].body_a], posed_[problem_[c].body_b]);
      if (ReboundSpeed(problem_[c], approach, least_rebounds_[c]) == 0) problem_[c].restitution = 0;
    }
    out_->struck.push_back(
        responder_.ResolveCollisions(view, contacts, settings_, floor_, threshold_, posed_, local_impulses_, dt_));
    Record(Stage::kCollision, out_->struck.back().status);
    out_->restitution_lowered |= out_->struck.back().restitution_lowered;
  }
  for (size_t c = 0; c < problem_.size(); ++c) {
    strike_W_[problem_of_[c]] = frames_[c] * (bounces_[c] + local_impulses_[c]);
    const double approach = -NormalVelocity(problem_[c], posed_[problem_[c].body_a], posed_[problem_[c].body_b]);
    double& yields = yields_[end_pair_[problem_of_[c]]];
    if (approach > CutSpeed(problem_[c]) + ClosingSpeed(problem_[c], dt_)) yields = std::max(yields, approach);
  }
  ApplyAtEnd(strike_W_);
}

}  // namespace islet::motion
