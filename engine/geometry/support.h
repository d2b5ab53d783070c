// How far shapes reach along a direction.
//   threads: pure functions
#pragma once

#include <span>
#include <vector>

#include "engine/geometry/narrow_phase.h"

namespace islet {

// Outward normals of the flat sides, in B.
std::span<const Vector3> FlatSides(const Shape& shape);

// Whether it is known of this shape: of all but half-spaces and custom ones.
bool HasSupport(const Shape& shape);

// [m] the gap between what two such shapes reach along a unit vector from a to b: never more than the gap of the shapes.
double SeparationAlong(const Shape& a, const Placement& pose_a, const Shape& b, const Placement& pose_b,
                       const Vector3& direction_W);

// Numbers, ascending, of those flat sides of a below which b reaches by no more than this [m].
void SidesApart(const Shape& a, const Placement& pose_a, const Shape& b, const Placement& pose_b, double deep,
                std::vector<int>* sides);

// Appends the unit vectors, from a to b, along which a flat side of one faces one of the other, and that they are no deeper in each other than
// this [m] along it.
void FacingSides(const Shape& a, const Placement& pose_a, const Shape& b, const Placement& pose_b, double deep,
                 std::vector<Vector3>* normals_W);

// Whether two shapes with these contacts touch by edges alone, and are level along two such sides: no gap, and none deeper, than this [m].
// normals_W: all such sides.
bool TouchByLevelEdges(std::span<const Contact> contacts, const Shape& a, const Placement& pose_a, const Shape& b,
                       const Placement& pose_b, double level, std::vector<Vector3>* normals_W);

// Two shapes that touch at a corner part along any direction between the sides that meet there. Among those from a to b along which a side
// of either keeps them apart, or no deeper in each other than this [m]: the one along which a velocity of b against a closes least. Sides of a
// count only where it closes by no more than most_a [m/s], sides of b by most_b. False where another is as good, or there is none.
bool LeastClosingSide(const Shape& a, const Placement& pose_a, const Shape& b, const Placement& pose_b, double deep,
                      const Vector3& velocity_W, double most_a, double most_b, Vector3* normal_W);

}  // namespace islet
