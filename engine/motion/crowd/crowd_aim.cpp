// In: contacts at the end of a pass. Out: those of the next, with points, targets and guesses.
#include "engine/motion/crowd/crowd.h"

#include <algorithm>
#include <cmath>

#include "engine/contact_pairs.h"
#include "engine/motion/tuning.h"
#include "engine/rotation.h"

namespace islet::motion {
namespace {

constexpr int kOpenings = 2;      // of a pair that an old plane presses: then that plane is let go
constexpr double kAlike = 0.999;  // cosine: normals that are the same

}  // namespace

// Where a held contact is at the end: between where its two bodies took it, or as far from there as they may have moved against each other.
Crowd::Place Crowd::PlaceAtEnd(size_t c) const {
  const int a = held_[c].body_a, b = held_[c].body_b;
  const Vector3 with_a = TakesOn(a, c), with_b = TakesOn(b, c);
  const Matrix3 share = Share(held_[c]);
  return {acted_at_[c] + Shared(held_[c], with_a, with_b),
          std::max(share.diagonal().maxCoeff(), 1 - share.diagonal().minCoeff()) * (with_a - with_b).norm() +
              dt_ * ((begin_[b].linear_W - begin_[a].linear_W).norm() + (mean_W_[b] - mean_W_[a]).norm() +
                     SlipOf(c).norm())};
}

// Where held contacts are found again, what they carried, and the overlap that each pair began with.
void Crowd::FollowHeld() {
  follows_.assign(held_.size(), -1);
  carried_W_.assign(near_->size(), Vector3::Zero());
  before_.assign(near_->size(), 0.0);
  ListPairs(held_, *near_, &pairs_);
  pool_->ForEachOf(pairs_.size(), [&](size_t p) {
    const PairPlaces& pair = pairs_[p];
    if (pair.y == pair.y_end) return;
    for (size_t c = pair.x; c < pair.x_end; ++c) {
      const std::span<const Contact> of_pair = std::span(*near_).subspan(pair.y, pair.y_end - pair.y);
      const double far = kSamePlace * Size(held_[c]);
      const Place place = PlaceAtEnd(c);
      const int found = FindAgain(of_pair, held_[c].feature, place.point_W, far + place.reach, far);
      if (found < 0) continue;
      follows_[c] = static_cast<int>(pair.y) + found;
      carried_W_[follows_[c]] += impulse_W_[c];
    }
  });
  ForEachPair(start_, *near_, [&](size_t s, size_t s_end, size_t e, size_t e_end) {
    double deepest = 0;
    for (size_t c = s; c < s_end; ++c) deepest = std::min(deepest, start_[c].gap);
    for (size_t k = e; k < e_end; ++k) before_[k] = deepest;
  });
}

// Whether a held contact is there at the end, in much the same plane.
bool Crowd::IsFoundAgain(size_t c) const {
  const Contact& contact = held_[c];
  const double alike = TurnsInItself(contact.body_a) || TurnsInItself(contact.body_b) ? -1 : kAlike;
  return follows_[c] >= 0 && (*near_)[follows_[c]].normal_W.dot(contact.normal_W) > alike;
}

// [m] between the points of a contact at the end, along its normal.
double Crowd::GapAlong(const Contact& c, const Held& held) const {
  const auto end = [&](int i) -> Pose { return {bodies_[i].position_W, bodies_[i].rotation_WB}; };
  return c.normal_W.dot(Outside(c.body_b, end(c.body_b), held.in_b) - Outside(c.body_a, end(c.body_a), held.in_a));
}

// [m/s] mean normal velocity with which a contact that ends at this gap would end at the one that is allowed.
double Crowd::TargetOf(const Contact& contact, double gap, double allowed) const {
  const double u = contact.normal_W.dot(MeanVelocity(contact.body_b, contact.point_W) -
                                        MeanVelocity(contact.body_a, contact.point_W));
  return u - (gap - allowed) / dt_;
}

// A contact that is not found again, or was not disturbed, as it is.
void Crowd::Keep(size_t c, std::vector<Carrier>* next) const {
  Held old = held_of_[c];
  Contact contact = held_[c];
  contact.point_W = acted_at_[c];
  const int a = contact.body_a, b = contact.body_b;
  if (disturbed_[a] || disturbed_[b])
    old.target = std::min(TargetOf(contact, GapAlong(contact, old), old.allowed), 0.0);  // what is past pushes nobody
  next->push_back({contact, old, impulse_W_[c], Centre(contact)});
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
  return found >= 0 && (first[found].normal_W - end.normal_W).norm() < kLargestTurn ? &first[found] : nullptr;
}

// A contact at the end, at the lever of halfway: on the chord of each body's point.
void Crowd::Aim(size_t e, std::vector<Carrier>* next) const {
  Contact contact = (*near_)[e];
  const double size = Size(contact);
  if (contact.gap > kReach * size && carried_W_[e].isZero(0)) return;
  const int a = contact.body_a, b = contact.body_b;
  const auto halfway = [&](int i, const Vector3& point) -> Vector3 {
    const Vector3 r = point - bodies_[i].position_W;
    if (TurnsInItself(i)) return middle_[i].position_W + r;
    const Vector3 before = begin_[i].pose.rotation_WB * (SeenAs(i, bodies_[i].rotation_WB).conjugate() * r);
    return middle_[i].position_W + 0.5 * (r + before);
  };
  const Vector3 half = 0.5 * contact.gap * contact.normal_W;
  Held held;
  held.in_a = Inside(a, {bodies_[a].position_W, bodies_[a].rotation_WB}, contact.point_W - half);
  held.in_b = Inside(b, {bodies_[b].position_W, bodies_[b].rotation_WB}, contact.point_W + half);
  held.faces_a = FacesAxis(shapes_[a], {bodies_[a].position_W, bodies_[a].rotation_WB}, contact);
  held.faces_b = FacesAxis(shapes_[b], {bodies_[b].position_W, bodies_[b].rotation_WB}, contact);
  const auto face = [&] { Face(held, middle_[a].position_W, middle_[b].position_W, &contact); };
  const Contact* const start = AtStart(contact);
  if (start && start->gap <= kReach * size) {
    Course course_a = CourseOf(a), course_b = CourseOf(b);
    course_a.axis_W = AxisOf(a, held.faces_a);
    course_b.axis_W = AxisOf(b, held.faces_b);
    // At the surface of each: where it lands, not between the two, which may be deep in each other so far.
    const Vector3 end = contact.point_W, before = 0.5 * start->gap * start->normal_W;
    contact.point_W = Shared(contact, OnArc(course_a, start->point_W - before, end - half),
                             OnArc(course_b, start->point_W + before, end + half));
    const double turn = (contact.normal_W - start->normal_W).norm();
    contact.normal_W = (start->normal_W + contact.normal_W).normalized();
    face();
    TurnLever((contact.gap - start->gap) / dt_, turn, course_a, course_b, size, &contact);
  } else {
    contact.point_W = Shared(contact, halfway(a, contact.point_W - half), halfway(b, contact.point_W + half));
    face();
  }
  held.push = before_[e] < -settings_.overlap_tolerance * size && pushes_[a] && pushes_[b] ? PushOf(before_[e]) : 0;
  held.allowed = start && std::abs(start->gap) <= settings_.overlap_tolerance * size ? std::max(before_[e], start->gap)
                                                                                     : before_[e] + held.push;
  held.allowed -= dt_ * YieldOf(contact);
  // What is asked to part may gain by it: who did in this piece is not asked again.
  const double most = gained_[a] || gained_[b] ? 0 : kFastest * floor_;
  const Vector3 slip_W = WallSlip(contact, bodies_, off_, ways_);
  held.target = std::min(TargetOf(contact, contact.gap, held.allowed), most - contact.normal_W.dot(slip_W));
  held.belt_W = contact.surface_W;
  contact.surface_W += slip_W;
  next->push_back({contact, held, WithinCone(contact, carried_W_[e]), Centre(contact)});
}

// A pair that ends in an overlap from which the nearest way out is not the way in: it carries where it met.
bool Crowd::Guard(size_t e, size_t e_end, Worker* worker, std::vector<Carrier>* next) const {
  const Contact& pair = (*near_)[e];
  const int a = pair.body_a, b = pair.body_b;
  const double size = Size(pair);
  const Contact* astray = nullptr;
  if (YieldOf(pair) > 0) return false;
  for (size_t k = e; k < e_end; ++k) {
    const Contact& c = (*near_)[k];
    if (c.gap >= before_[k] - settings_.overlap_tolerance * size) continue;
    if (TargetOf(c, c.gap, before_[k]) * dt_ > kDeep * size && (!astray || c.gap < astray->gap)) astray = &c;
  }
  if (!astray) return false;
  const Path path_a = PathOf(a), path_b = PathOf(b);
  MeetingQuery way{&shapes_[a], &shapes_[b], path_a, path_b, dt_, before_[e], 0.5 * settings_.overlap_tolerance * size};
  way.ReachOut();
  const double t = worker->meeting.First(way);
  if (t >= dt_) return false;
  const Pose at_a = path_a.At(t), at_b = path_b.At(t);
  // What closing walls squeeze may have no way out: it is sent back no faster than it came.
  const double most = driven_ ? kFastest * floor_ + (begin_[b].linear_W - begin_[a].linear_W).norm() : INFINITY;
  worker->probe.clear();
  CollideShapes(shapes_[a], at_a.placement(), shapes_[b], at_b.placement(), settings_.overlap_tolerance * size,
                &worker->probe);
  if (std::any_of(worker->probe.begin(), worker->probe.end(),
                  [&](const Contact& c) { return (c.normal_W - astray->normal_W).norm() < kLargestTurn; }))
    return false;
  for (Contact c : worker->probe) {
    c.body_a = a;
    c.body_b = b;
    c.friction = pair.friction;
    c.restitution = pair.restitution;
    c.surface_W = pair.surface_W + WallSlip(pair, bodies_, off_, ways_);
    const Vector3 half = 0.5 * c.gap * c.normal_W;
    Held held;
    held.in_a = Inside(a, at_a, c.point_W - half);
    held.in_b = Inside(b, at_b, c.point_W + half);
    held.pressed = true;
    held.belt_W = pair.surface_W;
    held.faces_a = FacesAxis(shapes_[a], at_a, c);
    held.faces_b = FacesAxis(shapes_[b], at_b, c);
    const Vector3 with_a = c.point_W + (middle_[a].position_W - at_a.position_W),
                  with_b = c.point_W + (middle_[b].position_W - at_b.position_W);
    c.point_W = Shared(c, with_a, with_b);
    Face(held, middle_[a].position_W, middle_[b].position_W, &c);
    held.allowed = before_[e];
    held.target = std::min(TargetOf(c, GapAlong(c, held), held.allowed), most);
    next->push_back({c, held, Vector3::Zero(), Centre(c)});
  }
  return !worker->probe.empty();
}

// Of one pair: what is disturbed is posed anew, as it ends now.
void Crowd::PoseAnew(const PairPlaces& pair, Worker* worker, std::vector<Carrier>* next) {
  const Contact& first = pair.x < pair.x_end ? held_[pair.x] : (*near_)[pair.y];
  const bool disturbed = disturbed_[first.body_a] || disturbed_[first.body_b];
  for (size_t c = pair.x; c < pair.x_end; ++c) {
    held_of_[c].pressed = held_of_[c].pressed || !impulse_W_[c].isZero(0);
    if (!disturbed || (!IsFoundAgain(c) && held_of_[c].pressed && held_of_[c].opened < kOpenings)) Keep(c, next);
  }
  if (!disturbed || pair.y == pair.y_end || Guard(pair.y, pair.y_end, worker, next)) return;
  for (size_t e = pair.y; e < pair.y_end; ++e) Aim(e, next);
}

// The contacts of the next pass.
void Crowd::NextTargets() {
  const size_t ranges = parallel::NumRanges(pairs_.size());
  if (next_.size() < ranges) next_.resize(ranges);
  pool_->ForRanges(pairs_.size(), [&](const parallel::Range& range, int worker) {
    std::vector<Carrier>* next = &next_[range.number];
    next->clear();
    for (size_t p = range.first; p < range.last; ++p) PoseAnew(pairs_[p], &workers_[worker], next);
  });
  held_.clear();
  held_of_.clear();
  impulse_W_.clear();
  centre_.clear();
  for (const std::vector<Carrier>& part : std::span(next_).first(ranges))
    for (const Carrier& carrier : part) {
      held_.push_back(carrier.contact);
      held_of_.push_back(carrier.held);
      impulse_W_.push_back(carrier.impulse_W);
      centre_.push_back(carrier.centre);
    }
}

}  // namespace islet::motion
