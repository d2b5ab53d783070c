// What a world holds. world.cpp changes it and tells of it, world_step.cpp moves it.
#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "engine/contact_filter.h"
#include "engine/detection/body_watch.h"
#include "engine/detection/detection.h"
#include "engine/ledger.h"
#include "engine/motion/arcs.h"
#include "engine/motion/crowd/crowd.h"
#include "engine/motion/group_motion.h"
#include "engine/motion/ride.h"
#include "engine/world.h"
#include "parallel/worker_pool.h"

namespace islet {

// All that one step leaves for the next.
struct WorldState {
  std::vector<Body> bodies;
  std::vector<Shape> shapes;
  std::vector<MassProperties> masses;  // of each, were it dynamic
  std::vector<std::uint32_t> generations;
  std::vector<std::uint64_t> user_data;
  std::vector<int> leaving;  // numbers of bodies removed since the last step: a step must run without them
  std::vector<int> vacant;   // numbers that are free again, descending
  PairsApart pairs_apart;
  std::vector<ContactEvent> events;
  std::vector<HitEvent> hits;
  std::vector<Contact> near_contacts;  // at the current poses, up to the reach of the last detection
  std::vector<Contact> touching;       // of these, those that touch
  std::vector<Contact> resolved;       // those at which impulses acted in the last step
  std::vector<Vector3> impulses;       // [N s] at those, W, on body_b
  std::vector<Vector3> travel;         // [m] that the last detection expected of each body
  std::vector<double> margins;         // [m] and how far it may stray from that
  motion::GroupMemory groups;
  motion::CrowdMemory crowd_memory;
  std::vector<std::uint8_t>
      crowd;          // per body: it was of a crowd in the last step, and its contacts are in near_contacts
  bool stale = true;  // near_contacts do not belong to the current poses
  std::vector<std::uint8_t> unchecked;  // per body: added, and not yet checked for initial overlap
  bool failed = false;                  // the last step, by its report
  double time = 0;                      // [s]
  double dt_hint = 1.0 / 30;            // [s] of the last step
  double whole_dt = 0;                  // [s] that was asked for; dt_hint may be a part of it
};

struct WorldSnapshot::Data {
  WorldState world;
  Vector3 gravity;
  std::optional<std::uint64_t> callbacks;  // of the world that it was taken of; bytes do not tell
};

struct [[gnu::visibility("hidden")]] World::Impl : WorldState {
  Settings settings;
  std::unique_ptr<parallel::WorkerPool> own_pool;
  parallel::WorkerPool* pool;
  Detector detector;
  MaterialCallback material;
  ContactFilter filter{&pairs_apart};
  std::uint64_t callbacks = 0;           // another number for all that were ever set; 0: none was
  std::vector<Contact> detected, still;  // scratch
  motion::GroupMotion group_motion;
  motion::Crowd crowd_motion;
  motion::Arcs arcs;
  motion::Ride ride;
  motion::MixMaterial mix;
  LedgerKeeper ledger;
  ProblemObserver observer;
  std::atomic<bool> stepping = false;
  bool lost = false;             // a step ended half done, and there is no state to go back to
  WorldState start, part_start;  // of a step whose callbacks may throw; of a part of it that may be taken back
  std::vector<std::pair<int, int>> sensed, passed;  // passed: on the way, in this step's parts so far
  std::vector<int> sensor_inside;                   // of one sensor
  std::vector<Contact> sensor_overlaps;             // scratch
  std::vector<ContactEvent> events_before;
  std::vector<Body> found;                                // as the whole step finds them
  std::vector<Body> before;                               // this part of it
  std::vector<Vector3> planned;                           // [m] per body: its way without contacts
  std::vector<std::pair<Contact, Vector3>> acted;         // [N s] in all parts of the step
  std::vector<std::uint8_t> frozen_apart, frozen_before;  // before: the whole step
  std::vector<LedgerImpulse> ledger_impulses;
  std::vector<Contact> held;       // where the step before ended, by small groups and crowds
  std::vector<Vector3> held_by_W;  // [N] the forces there
  double began = 0;                // [s] the step
  double crowd_map_max = 0;        // [m/s] of the crowd's answers in this part of it
  std::vector<int> group_places;   // in impulses, of those of small groups
  LadderReport spared;             // what detection was spared in this step
  // Of a step in which all stood still before and after: the next one does the same again, unless somebody changes something.
  std::optional<StepReport> rest;
  double rest_dt = 0;  // [s]

  Impl(const Settings& s, parallel::WorkerPool* p);

  Body& At(int number);
  const Body& At(int number) const;
  void Idle(const char* call) const;
  struct Busy {  // for as long as it lives the world is in a step
    Busy(Impl* w, const char* call);
    ~Busy() { world->stepping = false; }
    Busy(const Busy&) = delete;
    Busy& operator=(const Busy&) = delete;
    Impl* world;
  };
  void WakeAll();
  void Forget(int number);
  void ForgetAll();
  StepReport StepWhole(double dt);
  bool IsShared() const;
  void BeginRide(double dt, double dt_before);
  bool WasInCrowd(const Contact& contact) const;
  void FindEvents();
  void FindSensed();
  void AddPassed();
  bool IsSensed(int sensor, int i) const;
  bool PassesThrough(int sensor, int i);
  void RepeatEvents();
  void AddHits();
  void TellHits();
  double ApproachOf(const LedgerImpulse& j, std::span<const Body> then) const;
  void Mix(Contact * contact, const Body& a, const Body& b) const;
  void BodiesIn(const Shape& shape, const motion::Pose& pose, std::uint32_t layers, std::vector<Contact>* overlaps,
                std::vector<int>* inside) const;
  template <typename Look>
  void LookAt(std::uint32_t layers, const Box& box, const Look& look) const;
  void DetectAll(std::span<const Body> asked);  // asked: bodies as the filter sees them
  void DetectMoving(std::span<const Vector3> expected);
  double Lever(const Body& turning) const;
  void ChooseMargins(std::span<const Vector3> expected);
  bool StaysInReach() const;
  void MixMaterials(std::vector<Contact> * contacts) const;
  void SelectTouching();
  bool Touches(const Contact& c) const;
  bool MovesGroups() const;
  void CarryKinematic(double dt);
  void SetApart(bool apart);
  bool CrowdChanged() const;
  void WakeNewcomers();
  void StepCrowd(double dt, StepReport* report);
  bool MayBeTakenBack() const;
  bool StepOnce(double dt, motion::Races races, StepReport* report);
  void StepInParts(double dt, int halvings, StepReport* report);
  void KeepLedger(double dt, StepReport* report);
  void AddImpulses(std::span<const LedgerImpulse> of_part);
  void AddGroups(StepReport * report);
  void CheckTouching(std::span<const Body> asked);
  void CheckNewcomers();
  void RefuseOverlaps() const;
  bool AnyNewcomers() const;
  void AdmitNewcomers();
  void Changed();
  void CountFrozen(StepReport * report) const;
  void Remember(double dt, const StepReport& report);
};

}  // namespace islet
