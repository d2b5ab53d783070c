// Bodies -> contacts in canonical order. The only room that sees FCL (in detection.cpp): its dynamic AABB tree finds
// the candidates, pairs whose rooms (boxes with space to move) meet; they stay while their bodies stay in these.
// pair_contacts.h makes the points, and keeps those of pairs in which neither body has changed since the call before.
//
//   in:  bodies, their shapes, how far each may travel      out: contacts with gap up to the reach, sorted
//   order: by (body_a, body_b, feature, position in the manifold)
//   history: what is kept saves time and changes nothing: contacts are, bit for bit, those of a new Detector
//   threads: bodies, tree queries and pairs are shared by the pool; one Detector serves one caller at a time
//   allocation: none after warm-up except inside FCL's tree, when bodies come or go and once in 32 calls
#pragma once

#include <memory>
#include <span>
#include <vector>

#include "engine/body.h"
#include "engine/contact.h"
#include "engine/contact_filter.h"
#include "engine/detection/pair_contacts.h"
#include "engine/shape.h"

namespace islet::parallel {
class WorkerPool;
}

namespace islet {

class Detector {
 public:
  // keep: whether candidates and contacts of the call before are used again.
  explicit Detector(parallel::WorkerPool* pool, bool keep = true);
  ~Detector();
  Detector(const Detector&) = delete;
  Detector& operator=(const Detector&) = delete;

  // travel_W[i]: [m] displacement that body i is expected to make. Pairs whose boxes, swept along it and inflated by
  // margins[i] (which covers rotation), meet are kept; their reach is margins[a] + margins[b] + |travel_b - travel_a|,
  // and contacts farther apart are dropped. Left out are pairs with a removed body, pairs without a dynamic body, and,
  // unless include_frozen, frozen bodies against what stands still: frozen or fixed bodies, kinematic ones without
  // velocity. Materials are left to the caller. Throws std::invalid_argument if the
  // spans differ in size. rule: pairs that it does not allow are left out; null: none.
  void Detect(std::span<const Body> bodies, std::span<const Shape> shapes, std::span<const Vector3> travel_W,
              std::span<const double> margins, std::vector<Contact>* contacts, bool include_frozen = false,
              const PairRule* rule = nullptr);

  KeptContacts kept() const;  // of the call before, by the last one

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace islet
