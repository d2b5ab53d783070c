// In: poses. Out: the contacts there, which is which of another moment, and what gaps missed.
#include "engine/motion/group/stepper.h"

#include <algorithm>
#include <cmath>

#include "engine/geometry/support.h"
#include "engine/rotation.h"
#include "islands/disjoint_sets.h"
#include "qp/smallness.h"

namespace islet::motion {
namespace {

constexpr double kNearby = 0.1;  // of a size: how far what presses is looked for

}  // namespace

// [m] at least between the bodies of a pair, by the spheres around them.
double Stepper::Apart(const GroupPair& pair, std::span<const State> at) const {
  const Vector3 way = at[pair.b].pose.position_W - at[pair.a].pose.position_W;
  const bool plane_a = group_->shapes[pair.a]->kind() == ShapeKind::kHalfSpace,
             plane_b = group_->shapes[pair.b]->kind() == ShapeKind::kHalfSpace;
  const auto up = [&](int i) -> Vector3 { return at[i].pose.rotation_WB * Vector3::UnitZ(); };
  if (plane_a) return up(pair.a).dot(way) - group_->bodies[pair.b].radius;
  if (plane_b) return -up(pair.b).dot(way) - group_->bodies[pair.a].radius;
  return way.norm() - group_->bodies[pair.a].radius - group_->bodies[pair.b].radius;
}

void Stepper::DetectPair(int number, std::span<const State> at, double reach, std::vector<Contact>* contacts,
                         std::vector<int>* pair_of) {
  const GroupPair& pair = group_->pairs[number];
  if (Apart(pair, at) > reach) return;
  const size_t first = contacts->size();
  CollideShapes(*group_->shapes[pair.a], at[pair.a].pose.placement(), *group_->shapes[pair.b],
                at[pair.b].pose.placement(), reach, contacts);
  for (size_t c = first; c < contacts->size(); ++c) {
    Contact& contact = (*contacts)[c];
    Mix(pair, &contact);
    pair_of->push_back(number);
  }
  Turn(pair, at[pair.a], at[pair.b], {contacts->begin() + static_cast<std::ptrdiff_t>(first), contacts->end()});
  if (!SlidesBy(pair, at, {contacts->begin() + static_cast<std::ptrdiff_t>(first), contacts->end()})) return;
  contacts->resize(first);
  pair_of->resize(first);
}

// What hits at a corner is a contact of the side on which it passes.
void Stepper::Turn(const GroupPair& pair, const State& a, const State& b, std::span<Contact> found) const {
  const double level = 4 * kTouching * Size(pair) + std::max(sunk_[pair.a], sunk_[pair.b]);
  TurnToOpenSide(
      {*group_->shapes[pair.a], group_->bodies[pair.a], a}, {*group_->shapes[pair.b], group_->bodies[pair.b], b},
      kTogether * Size(pair), level, [this](const Contact& c) { return CutSpeed(c); }, found);
}

// Whether a pair that touches by edges alone is level along two sides that face each other, and does not close along one of them. It passes by
// there, so nothing presses along the other: cubes of a wall touch those beside, above and below, but push none that is diagonal.
bool Stepper::SlidesBy(const GroupPair& pair, std::span<const State> at, std::span<const Contact> found) {
  const double level = 2 * kTouching * Size(pair);  // gaps at both ends of a piece may miss as much
  const auto passes = [&](const Vector3& n) {
    return std::all_of(found.begin(), found.end(), [&](Contact c) {
      c.normal_W = n;
      return n.dot(at[pair.a].VelocityAt(c.point_W) - at[pair.b].VelocityAt(c.point_W)) <= CutSpeed(c);
    });
  };
  return TouchByLevelEdges(found, *group_->shapes[pair.a], at[pair.a].pose.placement(), *group_->shapes[pair.b],
                           at[pair.b].pose.placement(), level, &sides_W_) &&
         std::any_of(sides_W_.begin(), sides_W_.end(), passes);
}

// Materials are the world's to choose, by the bodies' numbers there.
void Stepper::Mix(const GroupPair& pair, Contact* contact) const {
  contact->body_a = group_->numbers[pair.a];
  contact->body_b = group_->numbers[pair.b];
  (*mix_)(contact, group_->bodies[pair.a], group_->bodies[pair.b]);
  contact->body_a = pair.a;
  contact->body_b = pair.b;
}

void Stepper::FindTouching() {
  now_.clear();
  now_pair_.clear();
  joined_.assign(group_->bodies.size(), 0);  // all, as long as it is not known
  for (size_t p = 0; p < group_->pairs.size(); ++p)
    DetectPair(static_cast<int>(p), state_, 4 * settings_.overlap_tolerance * Size(group_->pairs[p]), &now_,
               &now_pair_);
  MeasureGaps();
}

// Of each body that moves: how deep it is in others. So deep it is in what lies flush with them, too.
void Stepper::MeasureSunk(std::span<const Contact> contacts) {
  sunk_.assign(group_->bodies.size(), 0.0);
  for (const Contact& c : contacts) {
    const double deep = std::min(-c.gap, 2 * settings_.overlap_tolerance * Size({c.body_a, c.body_b}));
    for (const int i : {c.body_a, c.body_b})
      if (group_->bodies[i].Moves()) sunk_[i] = std::max(sunk_[i], deep);
  }
}

// As the piece begins: of each pair the least gap, and which bodies that move touch each other, directly or by others.
void Stepper::MeasureGaps() {
  least_gap_.assign(group_->pairs.size(), kFar);
  for (size_t c = 0; c < now_.size(); ++c) {
    double& least = least_gap_[now_pair_[c]];
    least = std::min(least, now_[c].gap);
  }
  MeasureSunk(now_);
  joined_.resize(group_->bodies.size());
  islands::DisjointSets sets(joined_);
  for (const Contact& c : now_)
    if (group_->bodies[c.body_a].Moves() && group_->bodies[c.body_b].Moves()) sets.Union(c.body_a, c.body_b);
  for (size_t i = 0; i < joined_.size(); ++i) joined_[i] = sets.Find(static_cast<int>(i));
}

void Stepper::DetectEnd() {
  end_.clear();
  end_pair_.clear();
  for (size_t p = 0; p < group_->pairs.size(); ++p) {
    double reach = 4 * settings_.overlap_tolerance * Size(group_->pairs[p]);
    for (size_t c = 0; c < held_.size(); ++c) {
      if (held_of_[c].pair != static_cast<int>(p) || impulse_W_[c].isZero(0)) continue;
      const auto at_end = [&](int i) -> Vector3 { return CarriedWith(i, acted_at_[c], Moment::kMiddle, Moment::kEnd); };
      const double parted = held_[c].normal_W.dot(at_end(held_[c].body_b) - at_end(held_[c].body_a));
      reach = std::max(reach, kNearby * Size(group_->pairs[p]) + std::abs(parted));
    }
    DetectPair(static_cast<int>(p), end_state_, reach, &end_, &end_pair_);
  }
  FollowHeld();
}

bool Stepper::Touches(int pair) const {
  return least_gap_[pair] <= settings_.overlap_tolerance * Size(group_->pairs[pair]);
}

// [m] of a pair's contacts: at what gap one is closed as the piece begins. Where another is, or pressed, so is all that is as near as gaps
// meet their end: a bar that lies down at one of its ends, and not at the other, tilts.
double Stepper::ClosedGap(int pair) const {
  const double size = Size(group_->pairs[pair]);
  for (size_t c = 0; c < now_.size(); ++c)
    if (now_pair_[c] == pair && (now_[c].gap <= kExact * size || !force_W_[c].isZero(0))) return kTouching * size;
  return kExact * size;
}

// [m] <= 0: overlap as the piece begins.
double Stepper::GapBefore(int pair) const { return std::min(0.0, least_gap_[pair]); }

// Of the pair's overlap, what the piece takes back: where it shows, and the pair itself has paid for it.
double Stepper::PushOut(int pair) const {
  return pays_[pair] && GapBefore(pair) < -kTouching * Size(group_->pairs[pair]) ? kPushOut : 0;
}

// Of a size: overlap that the piece made.
double Stepper::FreshOverlap() const {
  double worst = 0;
  for (size_t c = 0; c < end_.size(); ++c)
    if (end_[c].gap < 0 && yields_[end_pair_[c]] == 0)
      worst = std::max(worst, (GapBefore(end_pair_[c]) - end_[c].gap) / Size(group_->pairs[end_pair_[c]]));
  return worst;
}

// The same since the step began.
double Stepper::DeepestSinceStart() const {
  double worst = 0;
  for (size_t c = 0; c < end_.size(); ++c)
    if (yields_[end_pair_[c]] == 0)
      worst = std::max(worst, (step_gap_[end_pair_[c]] - end_[c].gap) / Size(group_->pairs[end_pair_[c]]));
  return worst;
}

// [m] with which a contact that presses ends the piece: its own as the piece began, if it was closed then (start), or the pair's.
double Stepper::GapToMeet(size_t at_end, const Contact* start) const {
  const int pair = end_pair_[at_end];
  const double before = start ? std::min(start->gap, kTouching * Size(group_->pairs[pair])) : GapBefore(pair);
  return (1 - PushOut(pair)) * before;
}

// Of a size: what the piece missed of gap(x1) = gap(x0), or >=, by. Infinite where something pressed a pair that it left open.
double Stepper::Missed() const {
  double worst = 0;
  for (size_t e = 0; e < end_.size(); ++e) {
    const int pair = end_pair_[e];
    const double size = Size(group_->pairs[pair]);
    if (end_[e].gap < 0 && yields_[pair] == 0 && !Hits(e))
      worst = std::max(worst, (GapBefore(pair) - end_[e].gap) / size);
    const double rose = end_[e].gap - GapToMeet(e, ClosedAtStart(e));
    if (rose > 0 && !CarriedBy(e).isZero(0)) worst = std::max(worst, rose / size);
  }
  for (size_t c = 0; c < held_.size(); ++c)
    if (follows_[c] < 0 && !impulse_W_[c].isZero(0) && IsOpenAtEnd(held_of_[c].pair)) return INFINITY;
  return worst;
}

bool Stepper::IsOpenAtEnd(int pair) const {
  for (size_t e = 0; e < end_.size(); ++e)
    if (end_pair_[e] == pair && end_[e].gap <= kTouching * Size(group_->pairs[pair])) return false;
  return true;
}

// Of a size: by how much levers are not those that the problem had, since middles came to lie elsewhere.
double Stepper::Shifted() const {
  double worst = 0;
  for (size_t c = 0; c < held_.size(); ++c)
    if (!impulse_W_[c].isZero(0))
      worst = std::max(worst, (acted_at_[c] - held_[c].point_W).norm() / Size(group_->pairs[held_of_[c].pair]));
  return worst;
}

// Of the contacts at another time of the piece the one that this contact is; -1: none. The same feature is the same
// place only as far as the two bodies' points have parted, or as a piece may turn: the lowest point of a rim goes around it.
int Stepper::FindAt(int pair, const Contact& contact, Moment from, Moment to, std::span<const Contact> there) const {
  const auto [a, b] = group_->pairs[pair];
  const auto [first, last] = std::equal_range(there.begin(), there.end(), contact, EarlierPair);
  const Vector3 with_a = CarriedWith(a, contact.point_W, from, to), with_b = CarriedWith(b, contact.point_W, from, to);
  const double far = kSamePlace * Size(group_->pairs[pair]);
  const double around = kLargestTurn * std::min(group_->bodies[a].radius, group_->bodies[b].radius);
  const double moved = std::max(around, far + 0.5 * (with_a - with_b).norm());
  int found = FindAgain({first, last}, contact.feature, Shared(contact, with_a, with_b), moved, far);
  // A corner that slides goes with its body, whatever the other does.
  for (const Vector3& place : {with_a, with_b})
    if (found < 0) found = FindAgain({first, last}, contact.feature, place, around, far);
  return found < 0 ? -1 : static_cast<int>(first - there.begin()) + found;
}

// A held contact where its impulse acted. Its problem had it there only if its bodies went as far as was foreseen.
Contact Stepper::AsActed(size_t held) const {
  Contact contact = held_[held];
  contact.point_W = acted_at_[held];
  return contact;
}

// Where a held contact is found again at the end: by its feature, or by its place, where faces take turns.
void Stepper::FollowHeld() {
  follows_.assign(held_.size(), -1);
  carried_to_W_.assign(end_.size(), Vector3::Zero());
  for (size_t c = 0; c < held_.size(); ++c) {
    follows_[c] = FindAt(held_of_[c].pair, AsActed(c), Moment::kMiddle, Moment::kEnd, end_);
    if (follows_[c] >= 0) carried_to_W_[follows_[c]] += impulse_W_[c];
  }
}

// Who takes back at the end what a held contact gave too much: itself, or another of its pair.
int Stepper::HeirOf(size_t held) const {
  if (follows_[held] >= 0) return follows_[held];
  const auto [first, last] = std::equal_range(end_.begin(), end_.end(), held_[held], EarlierPair);
  const Vector3 there = Carried(AsActed(held), Moment::kMiddle, Moment::kEnd);
  const int heir = FindHeir({first, last}, held_[held].normal_W, there);
  if (heir < 0) return -1;
  const int found = static_cast<int>(first - end_.begin()) + heir;
  return CutFor(found) ? -1 : found;
}

// [m/s] at which a contact closes where the piece ends.
double Stepper::ClosingAtEnd(const Contact& c) const {
  return c.normal_W.dot(end_state_[c.body_a].VelocityAt(c.point_W) - end_state_[c.body_b].VelocityAt(c.point_W));
}

// Whether the piece ends for this contact: one of the pair that meets, it was not closed as the piece began, and comes as a blow.
bool Stepper::CutFor(size_t at_end) const {
  const Contact& c = end_[at_end];
  return end_pair_[at_end] == cut_pair_ && !ClosedAtStart(at_end) &&
         c.gap <= kTogether * Size(group_->pairs[cut_pair_]) && ClosingAtEnd(c) > CutSpeed(c);
}

bool Stepper::IsCutForNew() const {
  for (size_t e = 0; e < end_.size(); ++e)
    if (CutFor(e)) return true;
  return false;
}

// The contact as the piece began, if it was closed.
const Contact* Stepper::ClosedAtStart(int pair, const Contact& end) const {
  const int found = FindAt(pair, end, Moment::kEnd, Moment::kStart, now_);
  return found >= 0 && closed_[found] ? &now_[found] : nullptr;
}

// [N s] what a contact at the end held in the piece.
Vector3 Stepper::CarriedBy(size_t at_end) const { return carried_to_W_[at_end]; }

// The same, as it lies at the end, where the contact has this velocity, as far as its law allows it there.
Vector3 Stepper::AllowedOf(size_t at_end, const Vector3& velocity_W) const {
  Vector3 sum = Vector3::Zero();
  for (size_t c = 0; c < held_.size(); ++c)
    if (heirs_[c] == static_cast<int>(at_end))
      sum += TurnedAlong(held_[c], end_[at_end], impulse_W_[c], velocity_W, LighterMass(held_[c]));
  return WithinCone(end_[at_end], sum);
}

// [N s] by how much friction of all that acted at a contact in the piece is beyond its cone. Where a slide turned, and pressed less at the end, a
// part of what it carried is taken back along another direction than it acted in.
Vector3 Stepper::BeyondCone(size_t at_end, const Vector3& change_W) const {
  if (end_[at_end].friction == 0) return Vector3::Zero();
  const Vector3& n = end_[at_end].normal_W;
  double press = n.dot(change_W);
  Vector3 friction = change_W - press * n;
  for (size_t c = 0; c < held_.size(); ++c) {
    if (heirs_[c] != static_cast<int>(at_end)) continue;
    const double pressed = held_[c].normal_W.dot(impulse_W_[c]);
    press += pressed;
    friction += impulse_W_[c] - pressed * held_[c].normal_W;
  }
  return Beyond(end_[at_end].friction * std::max(0.0, press), friction);
}

bool Stepper::WasHeld(size_t at_end) const {
  return std::find(follows_.begin(), follows_.end(), static_cast<int>(at_end)) != follows_.end();
}

// Whether any contact of a pair presses in the piece, or that of a feature.
bool Stepper::Presses(int pair, std::optional<std::uint32_t> feature) const {
  for (size_t c = 0; c < held_.size(); ++c)
    if (held_of_[c].pair == pair && held_[c].feature == feature.value_or(held_[c].feature) && !impulse_W_[c].isZero(0))
      return true;
  return false;
}

}  // namespace islet::motion
