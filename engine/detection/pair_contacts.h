// The contacts of all pairs that may be near, kept from call to call: those of pairs in which neither body has changed are
// copied, the others made anew by narrow_phase.h. Which it is does not show in the result.
//
//   in:  watched bodies, candidate pairs sorted by (a, b)      out: contacts sorted by (a, b, feature)
//   threads: pairs are shared among the workers of the pool in chunks of fixed size
//   allocation: none after warm-up
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "engine/contact.h"
#include "engine/contact_filter.h"
#include "engine/detection/body_watch.h"

namespace islet {

struct CandidatePair {
  int a = -1, b = -1;  // a < b
  // Where the contacts of the last call are, if `kept`.
  int chunk = 0, first = 0, count = 0;
  bool kept = false;
  std::int8_t axis = -1;  // that separated the two the last time
};

struct KeptContacts {
  int pairs = 0, contacts = 0;
};

class PairContacts {
 public:
  explicit PairContacts(parallel::WorkerPool* pool) : pool_(pool) {}

  // rule: which pairs may touch; null: all.
  void Collide(const BodyWatch& bodies, bool include_frozen, const PairRule* rule, std::vector<CandidatePair>* pairs,
               std::vector<Contact>* contacts);

  KeptContacts kept() const;  // by the last call

 private:
  using Chunks = std::vector<std::vector<Contact>>;

  void CollideChunk(const BodyWatch& bodies, bool include_frozen, const PairRule* rule, std::span<CandidatePair> pairs,
                    int chunk);

  parallel::WorkerPool* pool_;
  Chunks now_, before_;
  std::vector<size_t> start_;       // per chunk
  std::vector<KeptContacts> kept_;  // per chunk
};

}  // namespace islet
