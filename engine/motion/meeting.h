// The first moment at which two convex bodies meet on their paths: conservative advancement. No step of it is longer than
// the time in which the gap could close, so nothing is jumped over, however thin or fast.                    [Mirtich 96]
//
//   threads: one Meeting per thread (scratch)    allocation: none after warm-up
#pragma once

#include <vector>

#include "engine/motion/path.h"
#include "engine/shape.h"

namespace islet::motion {

struct MeetingQuery {
  const Shape *a, *b;
  Path path_a, path_b;
  double duration;  // [s] of both paths
  double near;      // [m] gap at which bodies have met
  double gap;       // [m] <= 0: overlap that there is, and may stay
  bool leaves;      // a pair that touches and leaves meets as soon as it is back
};

class Meeting {
 public:
  // [s] after which the gap is below `near`; duration if it never is. Bodies that are this near at the start meet when they
  // come back after they have parted, or come down with another feature.
  double First(const MeetingQuery& query);

 private:
  double GapAt(const MeetingQuery& query, double t, double reach, Vector3* normal);
  double FirstOfNear(const MeetingQuery& query);
  double Advance(const MeetingQuery& query, double t, double gap, Vector3 normal);

  std::vector<Contact> contacts_;
};

}  // namespace islet::motion
