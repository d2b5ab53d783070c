// The first moment at which two convex bodies meet on their paths: conservative advancement. No step of it is longer than
// the time in which the gap could close, so nothing is jumped over, however thin or fast.                    [Mirtich 96]
//
// Bodies meet where they would overlap, not where they touch: the gap is the widest of the gaps along all directions, whatever
// its sign, so what slides over an edge level with its own face closes along one direction while another keeps it open.
//
//   threads: one Meeting per thread (scratch)    allocation: none after warm-up
#pragma once

#include <cmath>
#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "engine/motion/path.h"
#include "engine/shape.h"

namespace islet::motion {

inline constexpr int kMostLooks = 1000;  // at one pair in a step: a way that would need more is looked at coarsely
inline constexpr double kFar = 1e300;    // [m] gap of a pair that is out of reach

struct MeetingQuery {
  const Shape *a, *b;
  Path path_a, path_b;
  double duration;  // [s] of both paths
  double gap;       // [m] <= 0: overlap that there is, and may stay
  double deep;      // [m] by which it has to grow before the bodies have met
  // [m] that the centres move by no more than against each other.
  double Way() const {
    return duration * ((path_b.velocity_W - path_a.velocity_W).norm() +
                       duration * (path_b.half_acceleration_W - path_a.half_acceleration_W).norm());
  }
  // A half-space turns what is as far out as the other body gets.
  void ReachOut() {
    const double centres = (path_b.start.position_W - path_a.start.position_W).norm() + Way();
    if (a->kind() == ShapeKind::kHalfSpace) path_a.radius = centres + b->radius();
    if (b->kind() == ShapeKind::kHalfSpace) path_b.radius = centres + a->radius();
  }
  // [m] that no two points of the bodies move by more than against each other.
  double Farthest() const { return Way() + duration * (path_a.TurnSpeed(0, duration) + path_b.TurnSpeed(0, duration)); }
};

class Meeting {
 public:
  // [s] after which the gap is below gap - deep, at most by as much again; duration if it never is, or not before `until`.
  double First(const MeetingQuery& query, double until = INFINITY);
  // [m] between the bodies as they begin; far more than reach where it is more than that.
  double GapAtStart(const MeetingQuery& query, double reach);
  // How often gaps were looked at so far.
  std::int64_t looks() const { return looks_; }

 private:
  double GapAt(const MeetingQuery& query, double t, double reach, Vector3* normal);
  double Soonest(const MeetingQuery& query, double t, double floor) const;
  double AlongTouch(const MeetingQuery& query, double t, double until, Vector3 normal, double floor);

  std::vector<Contact> contacts_;
  std::int64_t looks_ = 0;
};

// Whether the gap falls below query.gap - query.deep, or is below query.gap as they begin. Spheres around them tell of most that do not, and
// alone of what turns by more than kLargestTurn: no path tells its way.
bool ComeNear(const MeetingQuery& query, Meeting* meeting);

// A body of a pair, where it is now.
struct Partner {
  const Shape& shape;
  const Body& body;
  State at;
};

// What hits at a corner goes on the side of it along which it closes least: contacts of a pair from a to b, with gaps from -level to near [m], if
// any closes faster than cut(contact) [m/s]. A blow acts along the sides of the heavier body alone. Along others the lighter one passes, no
// faster than that, or not at all: the way past a corner that another body covers is none.
void TurnToOpenSide(const Partner& a, const Partner& b, double near, double level,
                    const std::function<double(const Contact&)>& cut, std::span<Contact> contacts);

// Of these contacts, in order of their pairs: how many pairs are deeper in each other than a fiftieth of a size.
int CountOverlapping(std::span<const Contact> contacts, const std::function<double(const Contact&)>& size);

}  // namespace islet::motion
