// What a ContactSuite is made of; shared by the three files that hold its stages, and by nobody else.
//   contact_suite.cpp    the door, the order of the stages, what is remembered from frame to frame
//   suite_islands.cpp    partitions, step 1, steps 2 and 3 as tasks
//   suite_freezing.cpp   step 4: freezing
#pragma once

#include <utility>
#include <vector>

#include "engine/contact_suite.h"
#include "engine/impact/sequential.h"
#include "engine/response/response.h"
#include "engine/response/suite_frame.h"
#include "engine/stopwatch.h"
#include "engine/suite/suite_memory.h"
#include "engine/suite/suite_projection.h"
#include "islands/partition.h"
#include "parallel/schedule.h"
#include "parallel/worker_pool.h"

namespace islet {

struct [[gnu::visibility("hidden")]] ContactSuite::Impl : SuiteMemory {
  Settings settings;
  parallel::WorkerPool* pool;
  SuiteFrame frame;
  CertifiedFreezing certified{/*whole=*/true};

  // Partitions: numbers of contacts in a partition are places in `linked`.
  std::vector<std::uint8_t> cut;
  std::vector<std::pair<int, int>> pairs;
  std::vector<int> linked;
  std::vector<int> island_contacts;  // partition.contacts in world numbers
  islands::Partition partition;
  std::vector<double> costs;
  parallel::Schedule schedule;

  struct Worker {
    SequentialResolver sequential;
    IslandResponder responder;
    std::vector<int> held;  // contacts of an island that its static problem may hold
  };
  std::vector<Worker> workers;
  SuiteProjection projection;
  struct Outcome {
    ResponseOutcome collision, resting;
  };
  std::vector<Outcome> outcomes;  // per island
  ProblemObserver observer;
  std::vector<std::vector<ProblemRecord>> records;  // per island, for the observer
  std::vector<int> bounce_counts;
  std::vector<double> approach_speeds, energies;  // [m/s] per contact; [J] per body
  std::vector<std::uint8_t> catches;              // per contact: it holds a body that moves along its normal
  // Per body: orthonormal directions of its velocity, scaled by roots of mass and inertia, in which it moves with its final velocity.
  struct Held {
    int rank = 0;
    Eigen::Matrix<double, 6, 6> directions;
  };
  std::vector<Held> held_along;
  std::vector<std::uint8_t> settles;     // per contact: its normal is among them
  std::vector<Contact> meeting;          // the contacts, where some of them have their blow in this step
  std::vector<std::uint8_t> was_frozen;  // per body, at the start of the frame
  std::vector<double> errors;            // [m/s] per body: worst natural map of what was solved with it

  void Begin(double dt, std::span<Body> bodies, std::span<const Contact> contacts);
  void FindMeetings(std::span<const Contact> contacts);
  void WakeDisturbed();
  void RecallHolding();
  void RecallPair(std::pair<size_t, size_t> previous, std::pair<size_t, size_t> now, bool moves);
  template <typename LinkContact>
  void Partition(LinkContact link);
  template <typename Task>
  void ForEachIsland(Task task);
  IslandView View(int island) const;
  void CutAtImmovable();
  bool Approaches(const IslandView& view) const;
  void StandStill();
  void Bounce(StepReport * report);
  void WakeByBounce();
  IslandView HeldView(const IslandView& view, Worker* worker);
  void ResolveIsland(int island, Worker* worker);
  void Record(int island, Stage stage, QpStatus status, const IslandResponder& responder);
  void ResolveIslands(StepReport * report, LapTimer * timer);
  void ReportIslands(StepReport * report) const;
  void Freeze(StepReport * report);
  void SettleCaughtBodies();
  bool Catches(size_t contact) const;
  void Settle(size_t contact);
  void HoldAlong(const Contact& contact, int body);
  void SettleRiders();
  void Finish(StepReport * report);
};

// Islands of the bodies that are not cut, joined by the contacts for which link(contact) holds.
template <typename LinkContact>
void ContactSuite::Impl::Partition(LinkContact link) {
  pairs.clear();
  linked.clear();
  for (size_t c = 0; c < frame.contacts.contacts.size(); ++c) {
    const Contact& contact = frame.contacts.contacts[c];
    if (!link(contact)) continue;
    pairs.emplace_back(contact.body_a, contact.body_b);
    linked.push_back(static_cast<int>(c));
  }
  islands::BuildPartition({cut, pairs}, &partition);
  island_contacts.resize(partition.contacts.size());
  for (size_t i = 0; i < island_contacts.size(); ++i) island_contacts[i] = linked[partition.contacts[i]];
}

template <typename Task>
void ContactSuite::Impl::ForEachIsland(Task task) {
  costs.resize(partition.num_islands());
  for (int i = 0; i < partition.num_islands(); ++i) costs[i] = 1.0 + static_cast<double>(View(i).contacts.size());
  pool->ForEachByCost(costs, kBatchCost, &schedule, [&](int island, int worker) { task(island, &workers[worker]); });
}

}  // namespace islet
