// Closed forms of a sphere against everything, and of a half-space against everything. At most one point for a sphere,
// one per corner within reach for a polytope on a half-space.
//
// Normals point from the first shape named into the second.                     threads: pure functions
#pragma once

#include <vector>

#include "engine/geometry/narrow_phase.h"

namespace islet {

void CollideSphereSphere(double radius_a, const Vector3& centre_a, double radius_b, const Vector3& centre_b,
                         double reach, std::vector<Contact>* contacts);
void CollideBoxSphere(const Vector3& half_extents, const Placement& pose, double radius, const Vector3& centre_W,
                      double reach, std::vector<Contact>* contacts);
void CollidePolytopeSphere(const Shape& shape, const Placement& pose, double radius, const Vector3& centre_W,
                           double reach, std::vector<Contact>* contacts);
void CollideHalfSpaceSphere(const Placement& pose, double radius, const Vector3& centre_W, double reach,
                            std::vector<Contact>* contacts);
void CollideHalfSpacePolytope(const Placement& half_space, const Shape& shape, const Placement& pose, double reach,
                              std::vector<Contact>* contacts);

}  // namespace islet
