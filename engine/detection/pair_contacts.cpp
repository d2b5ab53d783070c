#include "engine/detection/pair_contacts.h"

#include <algorithm>

#include "parallel/worker_pool.h"

namespace islet {
namespace {

// Whether contacts of the two are wanted, see detection.h.
bool Wanted(const WatchedBody& a, const WatchedBody& b, bool include_frozen) {
  if (a.moves || b.moves) return true;
  return include_frozen || a.moving_kinematic || b.moving_kinematic;
}

// Bounding spheres: most pairs of the broad phase that do not touch end here.
bool Near(const WatchedBody& a, const WatchedBody& b, double reach) {
  const Vector3 between = b.pose.position_W - a.pose.position_W;
  if (a.half_space) return a.pose.rotation_WB.col(2).dot(between) <= b.radius + reach;
  if (b.half_space) return -b.pose.rotation_WB.col(2).dot(between) <= a.radius + reach;
  const double radii = a.radius + b.radius + reach;
  return between.squaredNorm() <= radii * radii;
}

void CollidePair(const BodyWatch& bodies, CandidatePair* pair, std::vector<Contact>* contacts) {
  const WatchedBody &a = bodies[pair->a], &b = bodies[pair->b];
  const double reach = a.margin + b.margin + (b.travel - a.travel).norm();
  if (!Near(a, b, reach)) return;
  const size_t first = contacts->size();
  CollideShapes(bodies.shape(pair->a), a.pose, bodies.shape(pair->b), b.pose, reach, contacts, &pair->axis);
  if (contacts->size() == first) return;
  for (size_t c = first; c < contacts->size(); ++c) {
    Contact& contact = (*contacts)[c];
    contact.body_a = pair->a;
    contact.body_b = pair->b;
    for (size_t k = c; k > first && (*contacts)[k].feature < (*contacts)[k - 1].feature; --k) {
      std::swap((*contacts)[k], (*contacts)[k - 1]);
    }
  }
}

}  // namespace

void PairContacts::CollideChunk(const BodyWatch& bodies, bool include_frozen, const PairRule* rule,
                                std::span<CandidatePair> pairs, int chunk) {
  std::vector<Contact>& contacts = now_[chunk];
  contacts.clear();
  KeptContacts kept;
  for (CandidatePair& pair : pairs) {
    const WatchedBody &a = bodies[pair.a], &b = bodies[pair.b];
    const int first = static_cast<int>(contacts.size());
    const bool known = pair.kept && !a.changed && !b.changed;
    // Asked only where there is something to allow.
    const auto allowed = [&] { return !rule || rule->Allows(pair.a, pair.b); };
    pair.kept = Wanted(a, b, include_frozen);
    if (pair.kept && known) {
      ++kept.pairs;
      if (pair.count > 0 && (pair.kept = allowed())) {
        kept.contacts += pair.count;
        const auto begin = before_[pair.chunk].begin() + pair.first;
        contacts.insert(contacts.end(), begin, begin + pair.count);
      }
    } else if (pair.kept && (a.half_space || b.half_space || a.box.Meets(b.box)) && (pair.kept = allowed())) {
      CollidePair(bodies, &pair, &contacts);
    }
    pair.chunk = chunk;
    pair.first = first;
    pair.count = static_cast<int>(contacts.size()) - first;
  }
  kept_[chunk] = kept;
}

void PairContacts::Collide(const BodyWatch& bodies, bool include_frozen, const PairRule* rule,
                           std::vector<CandidatePair>* pairs, std::vector<Contact>* contacts) {
  const size_t chunks = parallel::NumRanges(pairs->size());
  std::swap(now_, before_);
  if (now_.size() < chunks) now_.resize(chunks);
  kept_.resize(chunks);
  try {
    pool_->ForRanges(pairs->size(), [&](const parallel::Range& range, int) {
      const std::span<CandidatePair> chunk = std::span(*pairs).subspan(range.first, range.last - range.first);
      CollideChunk(bodies, include_frozen, rule, chunk, static_cast<int>(range.number));
    });
  } catch (...) {  // a callback's: nothing is known of any pair
    for (CandidatePair& pair : *pairs) pair.kept = false;
    throw;
  }
  start_.assign(chunks + 1, 0);
  for (size_t chunk = 0; chunk < chunks; ++chunk) start_[chunk + 1] = start_[chunk] + now_[chunk].size();
  contacts->resize(start_[chunks]);
  pool_->ForRanges(pairs->size(), [&](const parallel::Range& range, int) {
    const std::vector<Contact>& chunk = now_[range.number];
    std::copy(chunk.begin(), chunk.end(), contacts->begin() + static_cast<std::ptrdiff_t>(start_[range.number]));
  });
}

KeptContacts PairContacts::kept() const {
  KeptContacts sum;
  for (const KeptContacts& chunk : kept_) {
    sum.pairs += chunk.pairs;
    sum.contacts += chunk.contacts;
  }
  return sum;
}

}  // namespace islet
