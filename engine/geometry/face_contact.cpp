#include "engine/geometry/face_contact.h"

#include <algorithm>

#include "engine/geometry/box_distance.h"
#include "engine/geometry/polytope_distance.h"
#include "engine/geometry/separating_axis.h"

namespace islet {
namespace {

constexpr std::uint32_t kClosestFeature = 3u << 30;

Contact ToContact(const ClosestPoints& closest, const Placement& pose_a) {
  return MakeContact(pose_a.position_W + pose_a.rotation_WB * (0.5 * (closest.on_a + closest.on_b)),
                     (pose_a.rotation_WB * (closest.on_b - closest.on_a)).normalized(), closest.distance,
                     kClosestFeature | (static_cast<std::uint32_t>(closest.feature) & 0x3fffffffu));
}

// limit: [m] beyond it the distance may be infinite.
ClosestPoints Closest(const Shape& a, const Placement& pose_a, const Shape& b, const Placement& pose_b,
                      const Vector3& normal_W, double separation, double limit) {
  const Matrix3 rotation_ab = pose_a.rotation_WB.transpose() * pose_b.rotation_WB;
  const Vector3 position_ab = pose_a.rotation_WB.transpose() * (pose_b.position_W - pose_a.position_W);
  const Vector3 normal = pose_a.rotation_WB.transpose() * normal_W;
  if (a.kind() == ShapeKind::kBox && b.kind() == ShapeKind::kBox)
    return ClosestOfBoxes(a, b, rotation_ab, position_ab, normal, separation, limit);
  return ClosestOfApart(a.polytope(), a.size(), b.polytope(), b.size(), rotation_ab, position_ab, normal, separation);
}

}  // namespace

void AppendNearestPoints(const Shape& a, const Placement& pose_a, const Shape& b, const Placement& pose_b,
                         const Vector3& normal_W, double separation, double reach, std::vector<Contact>* contacts) {
  const ClosestPoints closest = Closest(a, pose_a, b, pose_b, normal_W, separation, reach);
  if (closest.distance <= reach) contacts->push_back(ToContact(closest, pose_a));
}

void AppendFaceContacts(const Shape& a, const Placement& pose_a, const Shape& b, const Placement& pose_b,
                        double separation, const Vector3& normal_W, const ClipInput& input,
                        std::vector<Contact>* contacts) {
  static thread_local FaceClip clip;
  const size_t first = contacts->size();
  const double least = clip.Append(input, contacts);
  const double slack = EdgeSlack(input.size);
  if (least <= separation + slack) return;
  if (separation <= 0) {
    // What lies over the face carries the load; if nothing there touches, a deep corner has to: one beside the face, or the one nearest to it.
    if (least > slack && !clip.AppendCornersBeside(input, separation + slack, TouchSlack(input.size), contacts))
      clip.AppendNearestCorners(input, separation + slack, contacts);
    return;
  }
  const double limit = std::max(input.reach, TouchSlack(input.size));
  const ClosestPoints closest = Closest(a, pose_a, b, pose_b, normal_W, separation, limit);
  if (closest.distance > limit) {
    contacts->resize(first);
    return;
  }
  Contact contact = ToContact(closest, pose_a);
  if (closest.distance <= TouchSlack(input.size)) {
    // A face that is about to rest keeps its corners; those that it misses by a hair join them along their normal, both
    // ends of an edge too, or the point between the bodies if it is no corner.
    if (clip.AppendCornersBeside(input, separation + slack, TouchSlack(input.size), contacts)) return;
    contact.gap *= contact.normal_W.dot(normal_W);
    contact.normal_W = normal_W;
    if (contact.gap < std::min(least, input.reach)) contacts->push_back(contact);
    return;
  }
  contacts->resize(first);
  if (closest.distance <= input.reach) contacts->push_back(contact);
}

}  // namespace islet
