// Bodies -> contacts in canonical order. The only room that sees FCL (in detection.cpp): its dynamic AABB tree finds
// near pairs; narrow_phase.h makes the points.
//
//   in:  bodies, their shapes, how far each may travel      out: contacts with gap up to the reach, sorted
//   order: by (body_a, body_b, feature, position in the manifold); independent of threads and of the tree's history
//   threads: boxes, tree queries and narrow phase run on the pool; one Detector serves one caller at a time
//   allocation: none after warm-up except inside FCL's tree
#pragma once

#include <memory>
#include <span>
#include <vector>

#include "engine/body.h"
#include "engine/contact.h"
#include "engine/shape.h"

namespace islet::parallel {
class WorkerPool;
}

namespace islet {

class Detector {
 public:
  explicit Detector(parallel::WorkerPool* pool);
  ~Detector();
  Detector(const Detector&) = delete;
  Detector& operator=(const Detector&) = delete;

  // travel_W[i]: [m] displacement that body i is expected to make. Pairs whose boxes, swept along it and inflated by
  // margins[i] (which covers rotation), meet are kept; their reach is margins[a] + margins[b] + |travel_b - travel_a|,
  // and contacts farther apart are dropped. Left out are pairs with a removed body, pairs without a dynamic body, and,
  // unless include_frozen, frozen bodies against what stands still: frozen or fixed bodies, kinematic ones without
  // velocity. contact.friction and .restitution are the mixed values of the pair. Throws std::invalid_argument if the
  // spans differ in size.
  void Detect(std::span<const Body> bodies, std::span<const Shape> shapes, std::span<const Vector3> travel_W,
              std::span<const double> margins, std::vector<Contact>* contacts, bool include_frozen = false);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace islet
