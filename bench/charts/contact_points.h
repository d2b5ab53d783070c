// Where bodies touch, found again from their poses by our own code, which no engine under test runs.
//
// Boxes and hulls: the axis of least overlap (polytope.h), then the face of one clipped by the sides of the other's, or the
// nearest points of two edges. Spheres: the nearest point.
//   in:  plan, poses, how far apart two surfaces may be    out: points, ordered by bodies    threads: pure functions
//   note: where several axes overlap equally (corner on corner) the normal is one of several that could be meant
#pragma once

#include <functional>
#include <span>
#include <vector>

#include "bench/peers/peer.h"

namespace islet::charts {

struct ContactPoint {
  int body_a = 0, body_b = 0;
  Vector3 point_W = Vector3::Zero();   // [m] on the surface of one of them
  Vector3 normal_W = Vector3::Zero();  // unit, from a to b
  double gap = 0;                      // [m] < 0: overlap
};

// All pairs of which one moves and whose bounding spheres (moving ones) or boxes (static ones) are no farther apart than
// `reach` [m].
void ForEachNearPair(const peers::WorldPlan& plan, std::span<const peers::State> states, double reach,
                     const std::function<void(int, int)>& visit);

// Appends the points of one pair with gaps up to `reach` [m].
void AppendContacts(const peers::WorldPlan& plan, std::span<const peers::State> states, int a, int b, double reach,
                    std::vector<ContactPoint>* contacts);

}  // namespace islet::charts
