// Beds of spheres: contacts in which a sphere that moves lies too deep now. Along their normals it may pass as deep as that (passing.h).
//   threads: one caller at a time; allocates only while scenes grow
#pragma once

#include <span>
#include <vector>

#include "engine/body.h"
#include "engine/contact.h"
#include "engine/shape.h"

namespace islet {

class SphereBeds {
 public:
  // For Passes until the next call; all spans must stay as long. any: whether there are spheres at all.
  void Find(bool any, std::span<const Contact> contacts, std::span<const Body> bodies, std::span<const Shape> shapes);

  // Whether a sphere passes by (passing.h) at this contact, which is then changed, if bodies go on for dt at their present
  // velocities; linear: [m] where each body goes instead, or empty.
  bool Passes(double dt, std::span<const Vector3> linear, Contact* contact) const;

 private:
  bool any_ = false;
  std::span<const Body> bodies_;
  std::span<const Shape> shapes_;
  std::vector<Contact> beds_;  // by sphere
  std::vector<int> start_;     // per body: first of its beds
};

}  // namespace islet
