// A box or a hull where it stands: corners, faces, edges; and how two of them overlap, by separating axes. Exact for convex
// polytopes: the overlap is the least along any normal of a face and any cross product of two edges.
//
//   in:  a BodyPlan that is no sphere, and its state    out: everything in the world frame, [m]    threads: pure functions
//   rule: faces go round outwards; edge directions are listed once each
#pragma once

#include <array>
#include <span>
#include <vector>

#include "bench/peers/peer.h"

namespace islet::charts {

struct Polytope {
  Vector3 centre;
  std::vector<Vector3> corners;
  std::vector<std::vector<int>> faces;    // corners, counter-clockwise seen from outside
  std::vector<Vector3> normals;           // of the faces, outwards
  std::vector<std::array<int, 2>> edges;  // corners
  std::vector<Vector3> directions;        // of the edges, up to sign
};

Polytope PolytopeOf(const peers::BodyPlan& body, const peers::State& at);

// The axis along which two polytopes overlap least.
struct LeastOverlap {
  double depth = 0;                        // [m] < 0: apart, by at least that
  Vector3 normal_W = Vector3::Zero();      // unit, from a to b
  int face_a = -1, face_b = -1;            // whose normal it is; both -1: of two edges
  int direction_a = -1, direction_b = -1;  // of these edges
};

// The normal of a face is taken unless two edges overlap less by more than `prefer_faces` [m].
LeastOverlap FindLeastOverlap(const Polytope& a, const Polytope& b, double prefer_faces = 0);

// Volume, centre and second moments of a closed polytope filled evenly with mass 1.
struct Filling {
  double volume;    // [m^3]
  Vector3 centre;   // [m]
  Matrix3 inertia;  // [m^2] about the centre
};
Filling FillingOf(std::span<const Vector3> corners, std::span<const std::vector<int>> faces);

}  // namespace islet::charts
