#include <algorithm>
#include <cmath>

#include "engine/contact_suite_impl.h"
#include "islands/freezing.h"

namespace islet {
namespace {

constexpr int kRefreezeRounds = 8;        // the balance of one disturbs the next
constexpr size_t kLocalCandidates = 200;  // larger sets of frozen bodies are balanced together with all joined to them

}  // namespace

// Certified freezing: are the frozen bodies still held? Holding the unbalanced ones again may disturb their neighbours, so
// the set grows until nothing is disturbed: first by those alone, then by all that are joined to them, and only what that
// cannot hold either is suspected to move. `all`: whatever is joined to a suspect is suspected too. True if any is.
bool ContactSuite::Impl::CheckFrozen(bool all, StepReport* report) {
  candidates.clear();
  woken.clear();
  bool joined = false;
  while (true) {
    certified.FindUnbalanced(frame, lenient, &unbalanced);
    const size_t before = candidates.size();
    candidates.insert(candidates.end(), unbalanced.begin(), unbalanced.end());
    std::sort(candidates.begin(), candidates.end());
    candidates.erase(std::unique(candidates.begin(), candidates.end()), candidates.end());
    if (candidates.size() == before && woken.empty()) return false;
    if (joined) break;
    joined = candidates.size() == before || candidates.size() > kLocalCandidates;
    if (joined) AddJoinedFrozen();
    woken.clear();
    BalanceCandidates(/*at_end=*/false, report);
    lenient = was_frozen;
    if (moves_for_sure) break;
  }
  if (woken.empty()) return false;
  if (all && moves_for_sure) {
    candidates = woken;
    AddJoinedFrozen();
    woken = candidates;
  }
  // Suspects only: with its neighbours as walls a body can be squeezed in ways that the joint problem would not. They join
  // the bodies that move, and freeze again at the end of the frame if the joint problem leaves them at rest.
  for (const int i : woken) {
    frame.bodies[i].frozen = false;
    lenient[i] = 0;
  }
  suspected = true;
  return true;
}

// All frozen bodies that contacts join to a candidate through frozen bodies.
void ContactSuite::Impl::AddJoinedFrozen() {
  cut.resize(frame.bodies.size());
  for (size_t i = 0; i < cut.size(); ++i) cut[i] = !frame.bodies[i].frozen;
  Partition([this](const Contact& c) { return !cut[c.body_a] && !cut[c.body_b]; });
  chosen.assign(partition.num_islands(), 0);
  for (const int i : candidates) chosen[partition.body_to_island[i]] = 1;
  candidates.clear();
  for (int island = 0; island < partition.num_islands(); ++island) {
    const std::span<const int> members = partition.bodies_of(island);
    if (chosen[island]) candidates.insert(candidates.end(), members.begin(), members.end());
  }
  std::sort(candidates.begin(), candidates.end());
}

// The next frame begins with a strict check, and wakes it if it still cannot be held.
void ContactSuite::Impl::TrustUntilNextFrame(int suspect) {
  frame.bodies[suspect].frozen = true;
  lenient[suspect] = 1;
}

// The static problem of the candidates alone: bodies that move load them, everything else that stands still holds them. The
// question is whether they stay at rest, and at rest the convex model is exact: nothing slides. at_end: of the frame, when
// what is lenient may wait for the next one, and when an answer counts only if it holds its whole island: what wedged bodies
// would need to stay may be larger than any load, and is nothing to remember.
void ContactSuite::Impl::BalanceCandidates(bool at_end, StepReport* report) {
  cut.assign(frame.bodies.size(), 1);
  for (const int i : candidates) {
    cut[i] = 0;
    SetTwist(certified.LoadedVelocity(frame, i), &frame.bodies[i]);
  }
  Partition([this](const Contact& c) {
    return (!cut[c.body_a] || !cut[c.body_b]) && !frame.bodies[c.body_a].Moves() && !frame.bodies[c.body_b].Moves();
  });
  Settings at_rest = settings;
  at_rest.model = Model::kConvex;
  outcomes.assign(partition.num_islands(), {});
  if (at_end) held_so_far = frame.holding;
  ForEachIsland([&](int island, Worker* worker) {
    const IslandView view = View(island);
    double limit = INFINITY;
    for (const int i : view.bodies)
      limit = std::min(limit, certified.WakeSpeed(frame, i, at_end && lenient[i], settings));
    outcomes[island].resting = worker->responder.ResolveHolding(view, frame.contacts, at_rest, frame.speed_floor,
                                                                0.1 * limit, frame.dt, frame.bodies, frame.holding);
  });
  moves_for_sure = false;
  chosen.assign(partition.num_islands(), 0);  // that are not held
  for (const int i : candidates) {
    Body& body = frame.bodies[i];
    const double speed = FastestPoint(TwistOf(body), body.radius);
    const bool behind = certified.StaysBehind(frame, i, at_end, settings);
    if (behind || speed > certified.WakeSpeed(frame, i, at_end && lenient[i], settings)) {
      woken.push_back(i);
      chosen[partition.body_to_island[i]] = 1;
    }
    moves_for_sure = moves_for_sure || speed > certified.StillSpeed(body, settings);
    SetTwist({}, &body);
  }
  for (int island = 0; at_end && island < partition.num_islands(); ++island) {
    if (!chosen[island]) continue;
    for (const int number : View(island).contacts) frame.holding[number] = held_so_far[number];
  }
  for (const Outcome& outcome : outcomes) outcome.resting.AddTo(&report->static_qp, &report->ladder);
}

// Bodies that the joint problem left trembling are balanced once more, each against what the others now do: next to fast bodies
// its tolerance is coarse, and without this a blow would wake all that is joined to what it moves. What cannot be held is
// awake.
void ContactSuite::Impl::FreezeCertified(StepReport* report) {
  if (!certified.Freeze(frame, was_frozen, settings) && !suspected) return;  // CheckFrozen has seen all that is frozen
  certified.FindUnbalanced(frame, lenient, &unbalanced);
  candidates.clear();
  for (int round = 0; round < kRefreezeRounds && suspected && !unbalanced.empty(); ++round) {
    candidates.insert(candidates.end(), unbalanced.begin(), unbalanced.end());
    std::sort(candidates.begin(), candidates.end());
    candidates.erase(std::unique(candidates.begin(), candidates.end()), candidates.end());
    woken.clear();
    BalanceCandidates(/*at_end=*/true, report);
    for (const int i : woken) certified.Release(frame, i);
    std::erase_if(candidates, [this](int i) { return !frame.bodies[i].frozen; });
    for (const int i : candidates) lenient[i] = was_frozen[i];
    certified.FindUnbalanced(frame, lenient, &unbalanced);
  }
  for (const int i : unbalanced) certified.Release(frame, i);
  for (Body& body : frame.bodies)
    if (body.frozen) SetTwist({}, &body);
}

void ContactSuite::Impl::Freeze(StepReport* report) {
  if (settings.freezing == Freezing::kCertified) FreezeCertified(report);
  if (settings.freezing == Freezing::kPaper) FreezeLikePaper();
  for (size_t i = 0; i < frame.bodies.size(); ++i) {
    report->newly_frozen += frame.bodies[i].frozen && !was_frozen[i];
    report->woken += !frame.bodies[i].frozen && was_frozen[i];
  }
}

void ContactSuite::Impl::FreezeLikePaper() {
  const size_t n = frame.bodies.size();
  std::vector<double> energy(n), threshold(n);
  std::vector<std::uint8_t> touches(n, 0), may(n, 0), frozen(n, 0);
  for (size_t i = 0; i < n; ++i) {
    const Body& body = frame.bodies[i];
    energy[i] = body.KineticEnergy();
    threshold[i] = 0.5 * body.mass * frame.rest_speed * frame.rest_speed;
    frozen[i] = body.frozen;
    const auto inside = [&](const Region& r) {
      return (body.position_W.array() >= r.lower.array()).all() && (body.position_W.array() <= r.upper.array()).all();
    };
    may[i] = body.Moves() && (settings.cold_volumes.empty() ||
                              std::any_of(settings.cold_volumes.begin(), settings.cold_volumes.end(), inside));
  }
  for (const Contact& c : frame.contacts.contacts) {
    const auto stands = [&](int i) { return frozen[i] || frame.bodies[i].kind == BodyKind::kFixed; };
    touches[c.body_a] |= stands(c.body_b);
    touches[c.body_b] |= stands(c.body_a);
  }
  islands::UpdateFreezing({energy, threshold, touches, may}, settings.freeze_count, freeze_counters, frozen);
  for (size_t i = 0; i < n; ++i) {
    if (!frozen[i]) continue;
    frame.bodies[i].frozen = true;
    SetTwist({}, &frame.bodies[i]);
  }
}

}  // namespace islet
