#include <algorithm>
#include <cmath>
#include <numbers>

#include "engine/body_definition.h"
#include "engine/geometry/edge_contact.h"
#include "engine/geometry/narrow_phase.h"
#include "engine/motion/groups.h"
#include "engine/motion/meeting.h"
#include "engine/motion/visible_turn.h"
#include "engine/query/ray.h"
#include "engine/rotation.h"
#include "engine/world/world_impl.h"
#include "qp/smallness.h"

namespace islet {
namespace {

Placement PlaceOf(const Body& body) { return {body.position_W, body.rotation_WB.toRotationMatrix()}; }

void RequireQuery(const std::string& query, const Shape& shape, const Vector3& position_W,
                  const Quaternion& rotation_WB) {
  if (shape.kind() == ShapeKind::kHalfSpace) Reject(query, "shape", "is a half-space, which has no end");
  RequireFinite(query, "position", position_W);
  RequireUnit(query, rotation_WB);
}

// Of the turns that lead from one rotation to the other, whole ones more or less, the one that is most like another.
Vector3 TurnLike(const Vector3& other, const Quaternion& from, const Quaternion& to) {
  const Vector3 turn = Log(to * from.conjugate());
  const double angle = turn.norm();
  const Vector3 axis = angle > kNegligible ? Vector3(turn / angle) : Vector3(other.normalized());
  return turn + 2 * std::numbers::pi * std::round((other.dot(axis) - angle) / (2 * std::numbers::pi)) * axis;
}

}  // namespace

// look(number) for each body of these layers whose box meets this one, ascending.
template <typename Look>
void World::Impl::LookAt(std::uint32_t layers, const Box& box, const Look& look) const {
  for (int i = 0; i < static_cast<int>(bodies.size()); ++i) {
    const Body& body = bodies[i];
    if (body.removed || (body.layers & layers) == 0) continue;
    if (shapes[i].kind() == ShapeKind::kHalfSpace ||
        box.Meets(motion::BoxAround(shapes[i], body.position_W, body.rotation_WB)))
      look(i);
  }
}

std::optional<CastHit> World::CastRay(const Vector3& origin_W, const Vector3& way_W, std::uint32_t layers) const {
  impl_->Idle("CastRay");
  RequireFinite("CastRay", "origin", origin_W);
  RequireFinite("CastRay", "way", way_W);
  const Vector3 end = origin_W + way_W;
  std::optional<CastHit> first;
  impl_->LookAt(layers, {origin_W.cwiseMin(end), origin_W.cwiseMax(end)}, [&](int i) {
    const auto entry = EnterShape(impl_->shapes[i], PlaceOf(impl_->bodies[i]), origin_W, way_W);
    if (!entry || (first && entry->share >= first->share)) return;
    first = CastHit{i, entry->share, origin_W + entry->share * way_W, entry->normal_W};
  });
  return first;
}

std::optional<CastHit> World::CastShape(const Shape& shape, const Vector3& position_W, const Quaternion& rotation_WB,
                                        const Vector3& way_W, std::uint32_t layers) const {
  impl_->Idle("CastShape");
  RequireQuery("CastShape", shape, position_W, rotation_WB);
  RequireFinite("CastShape", "way", way_W);
  const Quaternion rotation = rotation_WB.normalized();
  const Box from = motion::BoxAround(shape, position_W, rotation),
            to = motion::BoxAround(shape, position_W + way_W, rotation);
  motion::Meeting meeting;
  std::vector<Contact> contacts;
  std::optional<CastHit> first;
  impl_->LookAt(layers, {from.lower.cwiseMin(to.lower), from.upper.cwiseMax(to.upper)}, [&](int i) {
    const Body& body = impl_->bodies[i];
    motion::MeetingQuery query{&impl_->shapes[i], &shape, {}, {}, 1, 0, kSamePoint * shape.size()};
    query.path_a.start = {body.position_W, body.rotation_WB};
    query.path_b.start = {position_W, rotation};
    query.path_b.velocity_W = way_W;
    const bool inside = meeting.GapAtStart(query, 0) < -query.deep;
    double share = inside ? 0 : meeting.First(query);
    if (share >= 1) return;
    const auto deepest = [&](double at) -> std::optional<Contact> {
      contacts.clear();
      CollideShapes(impl_->shapes[i], PlaceOf(body), shape, query.path_b.At(at).placement(), kTouch * shape.size(),
                    &contacts);
      if (contacts.empty()) return {};
      return *std::min_element(contacts.begin(), contacts.end(),
                               [](const Contact& x, const Contact& y) { return x.gap < y.gap; });
    };
    std::optional<Contact> met = deepest(share);
    if (!met) return;
    // What comes at a slant is past its place by far more than it is deep.
    for (int k = 0; k < kPatience && !inside && std::abs(met->gap) > kExact * shape.size(); ++k) {
      const double closing = -met->normal_W.dot(way_W);
      const double better = std::clamp(share + met->gap / std::max(closing, 1e-300), 0.0, 1.0);
      const std::optional<Contact> next = deepest(better);
      if (!next || !(std::abs(next->gap) < std::abs(met->gap))) break;
      share = better;
      met = next;
    }
    if (first && share >= first->share) return;
    first = CastHit{i, share, met->point_W, inside ? Against(way_W) : met->normal_W};
  });
  return first;
}

std::vector<int> World::Overlapping(const Shape& shape, const Vector3& position_W, const Quaternion& rotation_WB,
                                    std::uint32_t layers) const {
  impl_->Idle("Overlapping");
  RequireQuery("Overlapping", shape, position_W, rotation_WB);
  std::vector<int> inside;
  std::vector<Contact> overlaps;
  impl_->BodiesIn(shape, {position_W, rotation_WB.normalized()}, layers, &overlaps, &inside);
  return inside;
}

// Ascending.
void World::Impl::BodiesIn(const Shape& shape, const motion::Pose& pose, std::uint32_t layers,
                           std::vector<Contact>* overlaps, std::vector<int>* inside) const {
  inside->clear();
  const Vector3 everywhere = Vector3::Constant(INFINITY);
  const Box box = shape.kind() == ShapeKind::kHalfSpace ? Box{-everywhere, everywhere}
                                                        : motion::BoxAround(shape, pose.position_W, pose.rotation_WB);
  LookAt(layers, box, [&](int i) {
    if (shape.kind() == ShapeKind::kHalfSpace && shapes[i].kind() == ShapeKind::kHalfSpace) return;
    overlaps->clear();
    CollideShapes(shapes[i], PlaceOf(bodies[i]), shape, pose.placement(), 0, overlaps);
    if (std::any_of(overlaps->begin(), overlaps->end(),
                    [&](const Contact& c) { return c.gap < -kExact * std::min(shape.size(), shapes[i].size()); }))
      inside->push_back(i);
  });
}

// Who was within a sensor on its way through the step or its part: looked for where a body moves by more than half of a size against it.
void World::Impl::AddPassed() {
  const int n = static_cast<int>(bodies.size());
  for (int s = 0; s < n; ++s) {
    if (!bodies[s].sensor || bodies[s].removed) continue;
    for (int i = 0; i < n; ++i)
      if (i != s && IsSensed(s, i) && PassesThrough(s, i)) passed.push_back(std::minmax(s, i));
  }
}

// Whether a sensor may tell of a body.
bool World::Impl::IsSensed(int sensor, int i) const {
  return !bodies[i].removed && !bodies[i].sensor && LayersAgree(bodies[i], bodies[sensor]) &&
         !pairs_apart.Has(sensor, i);
}

bool World::Impl::PassesThrough(int sensor, int i) {
  const auto way = [&](int k) -> Vector3 { return bodies[k].position_W - before[k].position_W; };
  const Vector3 relative = way(i) - way(sensor), apart = before[i].position_W - before[sensor].position_W;
  const double nearest = std::clamp(-apart.dot(relative) / std::max(relative.squaredNorm(), 1e-300), 0.0, 1.0);
  if ((apart + nearest * relative).norm() > shapes[sensor].radius() + shapes[i].radius()) return false;
  const auto turn = [&](int k) -> Vector3 {  // which may be more than half a circle
    if (bodies[k].kind == BodyKind::kKinematic) return dt_hint * before[k].angular_velocity_W;
    const Vector3 mean_W = 0.5 * (before[k].angular_velocity_W + bodies[k].angular_velocity_W);
    return TurnLike(dt_hint * mean_W, before[k].rotation_WB, bodies[k].rotation_WB);
  };
  const Vector3 turn_s = turn(sensor), turn_i = turn(i);
  const auto swept = [&](int k, const Vector3& by) { return by.norm() * motion::TurnRadius(shapes[k]); };
  const double size = std::min(shapes[sensor].size(), shapes[i].size()),
               moved = relative.norm() + swept(sensor, turn_s) + swept(i, turn_i);
  if (!(moved > 0.5 * size)) return false;
  const int looks = static_cast<int>(std::min<double>(motion::kMostLooks, std::ceil(2 * moved / size)));
  const auto at = [&](int k, const Vector3& by, double u) -> Placement {
    return {before[k].position_W + u * way(k), (Exp(u * by) * before[k].rotation_WB).toRotationMatrix()};
  };
  for (int k = 1; k < looks; ++k) {
    const double u = static_cast<double>(k) / looks;
    sensor_overlaps.clear();
    CollideShapes(shapes[sensor], at(sensor, turn_s, u), shapes[i], at(i, turn_i, u), 0, &sensor_overlaps);
    if (std::any_of(sensor_overlaps.begin(), sensor_overlaps.end(),
                    [&](const Contact& c) { return c.gap < -kExact * size; }))
      return true;
  }
  return false;
}

// Pairs of a sensor and what overlaps it, or did on its way, ascending.
void World::Impl::FindSensed() {
  std::swap(sensed, passed);
  passed.clear();
  std::erase_if(sensed, [&](const auto& pair) {  // who was in it before leaves it now
    return std::any_of(events_before.begin(), events_before.end(), [&](const ContactEvent& e) {
      return e.sensor && e.body_a == pair.first && e.body_b == pair.second;
    });
  });
  for (int s = 0; s < static_cast<int>(bodies.size()); ++s) {
    const Body& sensor = bodies[s];
    if (!sensor.sensor || sensor.removed) continue;
    BodiesIn(shapes[s], {sensor.position_W, sensor.rotation_WB}, sensor.collides_with, &sensor_overlaps,
             &sensor_inside);
    for (const int i : sensor_inside) {
      if (i != s && IsSensed(s, i)) sensed.push_back(std::minmax(s, i));
    }
  }
  std::sort(sensed.begin(), sensed.end());
  sensed.erase(std::unique(sensed.begin(), sensed.end()), sensed.end());
}

}  // namespace islet
