// What detection knows of each body: pose, swept box, role; and whether any of it has changed since the call before.
// Contacts of two bodies that have not changed are the same, bit for bit, and need not be computed again.
//
//   in:  the arguments of Detector::Detect      out: one WatchedBody each
//   threads: bodies are shared among the workers of the pool      allocation: none once the number of bodies has settled
#pragma once

#include <span>
#include <vector>

#include "engine/body.h"
#include "engine/geometry/narrow_phase.h"
#include "engine/shape.h"

namespace islet {

namespace parallel {
class WorkerPool;
}

struct Box {  // axis-parallel, W [m]
  Vector3 lower = Vector3::Zero(), upper = Vector3::Zero();

  // Without branches: of boxes that are near, which meet is anyone's guess.
  bool Meets(const Box& other) const {
    unsigned meets = 1;
    for (int axis = 0; axis < 3; ++axis)
      meets &= static_cast<unsigned>(lower[axis] <= other.upper[axis]) &
               static_cast<unsigned>(other.lower[axis] <= upper[axis]);
    return meets != 0;
  }
  bool Contains(const Box& other) const {
    return (lower.array() <= other.lower.array()).all() && (other.upper.array() <= upper.array()).all();
  }
};

struct WatchedBody {
  bool changed = true;  // anything that its contacts depend on but the three flags below
  bool rebuilt = true;  // another shape, kind, or removed flag: its pairs are others now
  bool removed = false;
  bool half_space = false;
  bool dynamic = false;
  bool moves = false;  // Body::Moves()
  bool moving_kinematic = false;
  double radius = 0;                 // [m] farthest point from the centre of mass
  double margin = 0;                 // [m]
  Vector3 travel = Vector3::Zero();  // [m] W
  Placement pose;
  Box box;  // swept along the travel, inflated by the margin; unset for half-spaces and removed bodies
};

class BodyWatch {
 public:
  void Update(std::span<const Body> bodies, std::span<const Shape> shapes, std::span<const Vector3> travel_W,
              std::span<const double> margins, parallel::WorkerPool* pool);

  const WatchedBody& operator[](int body) const { return bodies_[body]; }
  int size() const { return static_cast<int>(bodies_.size()); }
  const Shape& shape(int body) const { return shapes_[body]; }
  bool half_spaces_changed() const { return half_spaces_changed_; }  // since the call before
  const std::vector<int>& half_spaces() const { return half_spaces_; }

 private:
  void UpdateOne(int number, const Body& body, const Vector3& travel, double margin);

  std::vector<WatchedBody> bodies_;
  std::vector<Quaternion> rotations_;  // that belong to the poses
  std::vector<Shape> shapes_;          // kept alive, so that another shape cannot take a known one's place in memory
  std::vector<int> half_spaces_, before_;
  std::vector<char> other_shape_;
  bool half_spaces_changed_ = false;
};

}  // namespace islet
