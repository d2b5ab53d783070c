// The contact points of one pair of shapes. Spheres and half-spaces by closed forms; boxes and hulls by separating axes
// and clipping of the two faces that meet; capsules and cylinders by the curves and faces that meet.
//
// Every function appends contacts whose normal points from a into b, with signed gaps (negative = overlap), up to
// `reach` apart. Face against face gives the whole clipped polygon; edge against edge, and bodies whose nearest
// features face each other at a slant, one point. All points of a pair share one normal n (round_contact.h: almost). Bodies that are apart stay
// apart, to within 1e-4 of the smaller one's size, if they keep n . (relative displacement) >= -gap at each point and
// do not turn.
//
//   accuracy: gaps are exact to round-off (1e-14 of the larger body's size)
//   threads: pure functions; scratch memory is one per thread
#pragma once

#include <cstdint>
#include <vector>

#include "engine/contact.h"
#include "engine/shape.h"

namespace islet {

struct Placement {
  Vector3 position_W = Vector3::Zero();
  Matrix3 rotation_WB = Matrix3::Identity();
};

// point_W: [m] midway between the two surfaces. Its bodies are left open.
inline Contact MakeContact(const Vector3& point_W, const Vector3& normal_W, double gap, std::uint32_t feature) {
  return {.point_W = point_W, .normal_W = normal_W, .gap = gap, .feature = feature};
}

// Appends the contacts of shape a at pose_a with shape b at pose_b; fills point, normal, gap, feature only. separating: the
// axis that kept this pair out of reach, for a first guess the next time (-1: none known); the result does not depend on it.
void CollideShapes(const Shape& a, const Placement& pose_a, const Shape& b, const Placement& pose_b, double reach,
                   std::vector<Contact>* contacts, std::int8_t* separating = nullptr);

}  // namespace islet
