// Spheres that pass by: what is ahead of a sphere is known as a plane through the nearest point, and near an edge or another
// sphere that plane stands in a way that is free. A ball that rolls over the seam of two level tiles would be stopped by the
// edge of the next one, and a ball that grazes another would be pushed aside.
//
// Such a contact is looked at where the sphere will be at the end of the step. If it gets there without hitting, and the
// plane would not have let it, the contact is taken from there: the plane then turns with the surface.
//   threads: pure function; scratch memory is one per thread
#pragma once

#include <span>

#include "engine/body.h"
#include "engine/contact.h"
#include "engine/shape.h"

namespace islet {

// A body and where it goes in the step if nothing stops it.
struct Traveller {
  const Body& body;
  const Shape& shape;
  Vector3 linear;   // [m]
  Vector3 angular;  // [rad] rotation vector, W
};

// a and b: the bodies of the contact. beds: contacts in which the sphere lies too deep now; along their normals it may pass as
// deep as that, as over level tiles into which it has sunk a little. True: the contact's gap is such that
// gap + normal . (travel of b - travel of a) is the gap at the end of the step; its normal and point are those of then if the
// other body is not dynamic, else those of now. False: the contact is as it was.
bool PassesBy(const Traveller& a, const Traveller& b, std::span<const Contact> beds, Contact* contact);

}  // namespace islet
