// The contact points of one pair of shapes: exact closed forms for everything but hull against hull.
//
// Every function appends contacts whose normal points from a into b, with signed gaps (negative = overlap), up to
// `reach` apart. Face against face gives the whole clipped polygon; edge against edge one point.
#pragma once

#include <vector>

#include "engine/contact.h"
#include "engine/shape.h"

namespace islet {

struct Placement {
  Vector3 position_W = Vector3::Zero();
  Matrix3 rotation_WB = Matrix3::Identity();
};

// Appends the contacts of shape a at pose_a with shape b at pose_b; fills point, normal, gap, feature only.
void CollideShapes(const Shape& a, const Placement& pose_a, const Shape& b, const Placement& pose_b, double reach,
                   std::vector<Contact>* contacts);

// [m] depth of overlap of two boxes: least over the 15 separating-axis candidates, negative if they are apart. Used to
// judge the engine, by code that detection does not share.
double BoxOverlap(const Vector3& half_a, const Placement& pose_a, const Vector3& half_b, const Placement& pose_b);

}  // namespace islet
