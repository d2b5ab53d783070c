#include "engine/geometry/narrow_phase.h"

#include <cmath>
#include <stdexcept>
#include <string>

#include "engine/geometry/box_box.h"
#include "engine/geometry/polytope_contact.h"
#include "engine/geometry/round_contact.h"
#include "engine/geometry/sphere_contact.h"
#include "engine/shape_data.h"
#include "qp/smallness.h"

namespace islet {
namespace {

// The rank in which the two-shape functions take their arguments: what its caller knows, half-space, polytope, sphere, what has an axis.
int Rank(ShapeKind kind) {
  switch (kind) {
    case ShapeKind::kCustom:
      return 0;
    case ShapeKind::kHalfSpace:
      return 1;
    case ShapeKind::kBox:
      return 2;
    case ShapeKind::kConvexHull:
      return 3;
    case ShapeKind::kSphere:
      return 4;
    case ShapeKind::kCapsule:
    case ShapeKind::kCylinder:
      return 5;
  }
  return 5;
}

// What the caller's function says, which must be contacts.
void CollideCustom(const Shape& custom, const Placement& pose, const Shape& other, const Placement& other_pose,
                   double reach, std::vector<Contact>* contacts) {
  const size_t first = contacts->size();
  custom.data().collide(
      {pose.position_W, pose.rotation_WB, &other, other_pose.position_W, other_pose.rotation_WB, reach}, contacts);
  if (contacts->size() < first) throw std::invalid_argument("collide of a custom shape: it took contacts away");
  for (size_t c = first; c < contacts->size(); ++c) {
    const Contact& contact = (*contacts)[c];
    const char* wrong = !std::isfinite(contact.gap)                             ? "gap is not finite"
                        : !contact.point_W.allFinite()                          ? "point is not finite"
                        : !(std::abs(contact.normal_W.norm() - 1) < kSamePoint) ? "normal is not of unit length"
                                                                                : nullptr;
    if (wrong)
      throw std::invalid_argument("collide of a custom shape: contact " + std::to_string(c - first) + ": its " + wrong);
  }
  std::erase_if(*contacts, [&, k = size_t{0}](const Contact& c) mutable { return k++ >= first && c.gap > reach; });
}

// Requires Rank(a) <= Rank(b).
void CollideRanked(const Shape& a, const Placement& pose_a, const Shape& b, const Placement& pose_b, double reach,
                   std::vector<Contact>* contacts, std::int8_t* separating) {
  if (a.kind() == ShapeKind::kCustom) return CollideCustom(a, pose_a, b, pose_b, reach, contacts);
  if (b.HasAxis()) {
    if (a.kind() == ShapeKind::kHalfSpace) return CollideHalfSpaceRound(pose_a, b, pose_b, reach, contacts);
    return CollideRound(a, pose_a, b, pose_b, reach, contacts);
  }
  const bool b_is_sphere = b.kind() == ShapeKind::kSphere;
  switch (a.kind()) {
    case ShapeKind::kHalfSpace:
      if (b.kind() == ShapeKind::kHalfSpace) return;  // neither can move
      if (b_is_sphere) return CollideHalfSpaceSphere(pose_a, b.radius(), pose_b.position_W, reach, contacts);
      return CollideHalfSpacePolytope(pose_a, b, pose_b, reach, contacts);
    case ShapeKind::kBox:
      if (b_is_sphere) {
        return CollideBoxSphere(a.half_extents(), pose_a, b.radius(), pose_b.position_W, reach, contacts);
      }
      if (b.kind() == ShapeKind::kBox) {
        return CollideBoxBox(a, pose_a, b, pose_b, reach, contacts, separating);
      }
      return CollidePolytopes(a, pose_a, b, pose_b, reach, contacts);
    case ShapeKind::kConvexHull:
      if (b_is_sphere) return CollidePolytopeSphere(a, pose_a, b.radius(), pose_b.position_W, reach, contacts);
      return CollidePolytopes(a, pose_a, b, pose_b, reach, contacts);
    case ShapeKind::kSphere:
      return CollideSphereSphere(a.radius(), pose_a.position_W, b.radius(), pose_b.position_W, reach, contacts);
    case ShapeKind::kCapsule:
    case ShapeKind::kCylinder:
    case ShapeKind::kCustom:
      return;  // above
  }
}

}  // namespace

void CollideShapes(const Shape& a, const Placement& pose_a, const Shape& b, const Placement& pose_b, double reach,
                   std::vector<Contact>* contacts, std::int8_t* separating) {
  std::int8_t none = -1;
  if (!separating) separating = &none;
  if (Rank(a.kind()) <= Rank(b.kind())) {
    CollideRanked(a, pose_a, b, pose_b, reach, contacts, separating);
    return;
  }
  const size_t first = contacts->size();
  CollideRanked(b, pose_b, a, pose_a, reach, contacts, separating);
  for (size_t c = first; c < contacts->size(); ++c) (*contacts)[c].normal_W = -(*contacts)[c].normal_W;
}

}  // namespace islet
