#include "bench/charts/contact_points.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <stdexcept>
#include <utility>

#include "bench/charts/polytope.h"

namespace islet::charts {
namespace {

using peers::BodyPlan;
using peers::State;

// [m] faces are preferred to edges by this much: at rest both say the same but for rounding, in float too.
constexpr double kPreferFaces = 1e-4;
// [m] what is no farther in front of a plane is on it: of faces that fit, rounding would put points anywhere along the edges.
constexpr double kOnPlane = 1e-6;

double BoundingRadius(const BodyPlan& body) {
  if (body.form == BodyPlan::Form::kSphere) return body.radius;
  if (body.form == BodyPlan::Form::kBox) return body.half_extents.norm();
  double squared = 0;
  for (const Vector3& corner : body.corners) squared = std::max(squared, corner.squaredNorm());
  return std::sqrt(squared);
}

// Whether a ball around the moving body reaches the other one's box in its own frame (a hull's: its bounding sphere).
bool MayTouch(const BodyPlan& fixed, const State& at_fixed, const State& at, double radius) {
  const Vector3 offset = at.position_W - at_fixed.position_W;
  if (fixed.form != BodyPlan::Form::kBox) return offset.norm() < BoundingRadius(fixed) + radius;
  const Vector3 local = at_fixed.rotation_WB.conjugate() * offset;
  return ((local.cwiseAbs() - fixed.half_extents).array() < radius).all();
}

// Keeps the part of a polygon behind a plane.
std::vector<Vector3> ClipPolygon(const std::vector<Vector3>& polygon, const Vector3& normal, const Vector3& through) {
  std::vector<Vector3> kept;
  for (size_t i = 0; i < polygon.size(); ++i) {
    const Vector3 &p = polygon[i], &q = polygon[(i + 1) % polygon.size()];
    const double at_p = normal.dot(p - through), at_q = normal.dot(q - through);
    if (at_p <= kOnPlane) kept.push_back(p);
    if (std::min(at_p, at_q) < -kOnPlane && std::max(at_p, at_q) > kOnPlane)
      kept.push_back(p + at_p / (at_p - at_q) * (q - p));
  }
  return kept;
}

// Points of b's face that looks back most, clipped by the sides of a's face.
void AppendFacePoints(const Polytope& a, int face_a, const Polytope& b, double reach, ContactPoint contact,
                      std::vector<ContactPoint>* contacts) {
  const Vector3 outwards = a.normals[face_a];
  const auto back = std::ranges::min_element(b.normals, {}, [&](const Vector3& n) { return n.dot(outwards); });
  std::vector<Vector3> polygon;
  for (const int corner : b.faces[back - b.normals.begin()]) polygon.push_back(b.corners[corner]);
  const std::vector<int>& face = a.faces[face_a];
  for (size_t i = 0; i < face.size() && !polygon.empty(); ++i) {
    const Vector3 &from = a.corners[face[i]], &to = a.corners[face[(i + 1) % face.size()]];
    polygon = ClipPolygon(polygon, (to - from).cross(outwards).normalized(), from);
  }
  for (const Vector3& point : polygon) {
    contact.gap = outwards.dot(point - a.corners[face[0]]);
    contact.point_W = point;
    if (contact.gap <= reach) contacts->push_back(contact);
  }
}

// Of the edges of p along that direction, the one that reaches farthest along the axis.
std::array<int, 2> FarthestEdge(const Polytope& p, int direction, const Vector3& axis) {
  std::array<int, 2> farthest{};
  double most = -1e300;
  for (const auto& edge : p.edges) {
    const Vector3 along = (p.corners[edge[1]] - p.corners[edge[0]]).normalized();
    const double reach = axis.dot(p.corners[edge[0]] + p.corners[edge[1]]);
    if (along.cross(p.directions[direction]).norm() > 1e-6 || reach <= most) continue;
    farthest = edge;
    most = reach;
  }
  return farthest;
}

void AppendEdgePoint(const Polytope& a, const Polytope& b, const LeastOverlap& axis, ContactPoint contact,
                     std::vector<ContactPoint>* contacts) {
  const auto edge_a = FarthestEdge(a, axis.direction_a, axis.normal_W);
  const auto edge_b = FarthestEdge(b, axis.direction_b, -axis.normal_W);
  const Vector3 &p = a.corners[edge_a[0]], &q = b.corners[edge_b[0]];
  const Vector3 u = a.corners[edge_a[1]] - p, v = b.corners[edge_b[1]] - q, w = p - q;
  const double uu = u.dot(u), uv = u.dot(v), vv = v.dot(v), uw = u.dot(w), vw = v.dot(w);
  const double s = std::clamp((uv * vw - vv * uw) / (uu * vv - uv * uv), 0.0, 1.0);
  const double t = std::clamp((uv * s + vw) / vv, 0.0, 1.0);
  contact.point_W = 0.5 * (p + s * u + q + t * v);
  contact.gap = -axis.depth;
  contacts->push_back(contact);
}

// From the other body to the sphere.
void AppendSphereContact(const BodyPlan& sphere, const State& at, const BodyPlan& other, const State& at_other,
                         double reach, ContactPoint contact, std::vector<ContactPoint>* contacts) {
  if (other.form == BodyPlan::Form::kHull) throw std::logic_error("a sphere and a hull in one plan");
  Vector3 outwards = at.position_W - at_other.position_W;
  double distance = outwards.norm() - other.radius;  // [m] of the sphere's centre from the surface
  if (other.form == BodyPlan::Form::kBox) {
    const Vector3 local = at_other.rotation_WB.conjugate() * outwards;
    Vector3 way = local - local.cwiseMax(-other.half_extents).cwiseMin(other.half_extents);
    distance = way.norm();
    if (way.isZero()) {  // the centre is inside: out by the nearest face
      int axis = 0;
      distance = -(other.half_extents - local.cwiseAbs()).minCoeff(&axis);
      way[axis] = local[axis] > 0 ? 1 : -1;
    }
    outwards = at_other.rotation_WB * way;
  }
  contact.gap = distance - sphere.radius;
  if (contact.gap > reach || outwards.isZero()) return;
  contact.normal_W = outwards.normalized();
  contact.point_W = at.position_W - sphere.radius * contact.normal_W;
  contacts->push_back(contact);
}

}  // namespace

void ForEachNearPair(const peers::WorldPlan& plan, std::span<const State> states, double reach,
                     const std::function<void(int, int)>& visit) {
  const auto& bodies = plan.bodies;
  std::vector<int> moving, fixed;
  std::vector<double> radius(bodies.size());
  for (int i = 0; i < static_cast<int>(bodies.size()); ++i) {
    radius[i] = BoundingRadius(bodies[i]) + 0.5 * reach;
    if (states[i].position_W.allFinite()) (bodies[i].Moves() ? moving : fixed).push_back(i);
  }
  // Moving pairs by sweep and prune along x.
  std::ranges::sort(moving, {}, [&](int i) { return std::pair(states[i].position_W.x() - radius[i], i); });
  for (size_t m = 0; m < moving.size(); ++m) {
    const int i = moving[m];
    const double end = states[i].position_W.x() + radius[i];
    for (size_t n = m + 1; n < moving.size(); ++n) {
      const int k = moving[n];
      if (states[k].position_W.x() - radius[k] > end) break;
      const double both = radius[i] + radius[k];
      if ((states[i].position_W - states[k].position_W).squaredNorm() < both * both)
        visit(std::min(i, k), std::max(i, k));
    }
    for (const int k : fixed) {
      if (MayTouch(bodies[k], states[k], states[i], radius[i] + 0.5 * reach)) visit(i, k);
    }
  }
}

void AppendContacts(const peers::WorldPlan& plan, std::span<const State> states, int a, int b, double reach,
                    std::vector<ContactPoint>* contacts) {
  const BodyPlan &plan_a = plan.bodies[a], &plan_b = plan.bodies[b];
  ContactPoint contact;
  contact.body_a = a;
  contact.body_b = b;
  if (plan_b.form == BodyPlan::Form::kSphere)
    return AppendSphereContact(plan_b, states[b], plan_a, states[a], reach, contact, contacts);
  if (plan_a.form == BodyPlan::Form::kSphere) {
    std::swap(contact.body_a, contact.body_b);
    return AppendSphereContact(plan_a, states[a], plan_b, states[b], reach, contact, contacts);
  }
  const Polytope at_a = PolytopeOf(plan_a, states[a]), at_b = PolytopeOf(plan_b, states[b]);
  const LeastOverlap axis = FindLeastOverlap(at_a, at_b, kPreferFaces);
  if (-axis.depth > reach) return;
  contact.normal_W = axis.normal_W;
  if (axis.face_a >= 0) {
    AppendFacePoints(at_a, axis.face_a, at_b, reach, contact, contacts);
  } else if (axis.face_b >= 0) {
    AppendFacePoints(at_b, axis.face_b, at_a, reach, contact, contacts);
  } else {
    AppendEdgePoint(at_a, at_b, axis, contact, contacts);
  }
}

}  // namespace islet::charts
