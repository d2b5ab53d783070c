// Moves the groups of a world that are small: each by the law of the step (stepper.h), as a task of its own. Larger groups
// are left as they are; who calls moves them otherwise.
//
//   rest:    a group that has stood still, and that its last step left without velocity, is frozen as a whole: the same
//            bodies under the same forces would give the same step again. It wakes as soon as anything of that changes
//   rooms:   after the step every body must have kept to the room that decided whom it may meet (groups.h); else groups
//            are found anew with larger rooms, and those that changed are stepped again from the start
//   parts:   a group is parted by who comes near whom on the free ways. Then no body may have met one of another part
//            on its real way, or their parts are joined and stepped again from the start. If a part gets too large that way,
//            the whole group is a crowd
//   work:    a group whose step would take more than its share goes with the crowd, for some steps, since it would need as much again
//   threads: groups run on the pool; results do not depend on the number of workers
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "engine/ledger.h"
#include "engine/motion/group/stepper.h"
#include "engine/motion/groups.h"
#include "engine/problem_record.h"
#include "parallel/worker_pool.h"

namespace islet::motion {

// What one step leaves for the next, per body where nothing else is said.
struct GroupMemory {
  std::vector<double> still;        // [s] for which it has stood still
  std::vector<Pose> anchor;         // where
  std::vector<std::uint64_t> load;  // under which force
  std::vector<std::uint64_t>
      mark;  // what its group looks like while it rests; kAwake: it does not, or that is not known yet
  std::vector<double> crowded;    // steps for which its group goes with the crowd, since it had needed too much work
  std::vector<Contact> contacts;  // near ones of small groups, by pair
  std::vector<Vector3> forces_W;  // [N] on body_b, that held there
  void Resize(size_t bodies);
  static constexpr std::uint64_t kAwake = 0;
};

// What is done where bodies of a crowd move against each other by more than they are thick, and may pass each other. Refused: nothing; a
// shorter step, in which there may be no crowd, keeps them on their sides. Taken: no step is shorter, and small groups that gave up are
// tried once more before they go with the crowd. Halted: they stay where they are instead.
enum class Races { kRefused, kTaken, kHalted };

class GroupMotion {
 public:
  GroupMotion(const Settings& settings, parallel::WorkerPool* pool);
  void SetWholeStep(double dt) {  // [s] of which those that follow are parts
    whole_dt_ = dt;
    spent_.assign(spent_.size(), 0);
  }
  void SetGravity(const Vector3& gravity_W) { settings_.gravity = gravity_W; }

  // observer may be empty. report: counts, certificates and times are added to. Returns false, and has moved nobody, where bodies of a
  // crowd race or leave their rooms, and races are refused; who gave up is remembered.
  bool Step(double dt, Races races, std::span<Body> bodies, std::span<const Shape> shapes, const ContactFilter& filter,
            const MixMaterial& mix, const ProblemObserver& observer, GroupMemory* memory, StepReport* report);

  // Of the last step. crowd: per body, whether its group was too large.
  std::span<const std::uint8_t> crowd() const { return crowd_; }
  bool any_crowd() const { return any_crowd_; }
  std::span<const LedgerImpulse> impulses() const { return impulses_; }

 private:
  struct Job {
    std::vector<int> members;  // that contacts can move
    Group group;
    GroupOutcome outcome;
    bool done = false, rests = false, kept = false;  // kept: its bodies stayed in their rooms
    std::uint64_t mark = 0;
  };
  struct Worker {
    Stepper stepper;
  };
  void Begin(Races races, std::span<const Body> bodies, GroupMemory* memory);
  void FindGroups(double dt, std::span<const Body> bodies, std::span<const Shape> shapes, const ContactFilter& filter,
                  const GroupMemory& memory);
  void CommitAll(double dt, std::span<Body> bodies, GroupMemory* memory, StepReport* report);
  bool IsCrowd(std::span<const int> members) const;
  bool HasRace(double dt, std::span<const Body> bodies, std::span<const Shape> shapes) const;
  std::ptrdiff_t CountCrowd() const;
  void WidenCrowds(double dt, std::span<const Body> bodies);
  void MakeJobs(double dt, std::span<const Body> bodies, std::span<const Shape> shapes, const GroupMemory& memory);
  void FillJob(double dt, int group, std::span<const Body> bodies, std::span<const Shape> shapes,
               const GroupMemory& memory, Job* job) const;
  void FillGroup(int group, std::span<const Body> bodies, std::span<const Shape> shapes, const GroupMemory& memory,
                 Job* job) const;
  void RunJobs(double dt, const MixMaterial& mix, bool record, std::span<const Body> bodies,
               std::span<const Shape> shapes);
  bool KeptToRooms(const Job& job, std::span<const Body> bodies, std::span<const Shape> shapes);
  bool Met(double dt, int i, int k);
  bool JoinStrays(double dt);
  template <typename Holds>
  bool JoinParted(const Holds& holds);
  bool LeaveToCrowd(GroupMemory* memory);
  std::uint64_t MarkOf(const Group& group) const;
  void Commit(double dt, Job* job, std::span<Body> bodies, GroupMemory* memory, StepReport* report);
  bool IsBalanced(double dt, const Job& job) const;
  void Rest(double dt, Job* job, std::span<Body> bodies, GroupMemory* memory) const;

  Settings settings_;
  parallel::WorkerPool* pool_;
  Groups groups_;
  std::vector<Worker> workers_;
  std::vector<Job> jobs_, before_;  // of this round and the one before: the first so many of each
  size_t num_jobs_ = 0, num_before_ = 0;
  std::vector<Contact> contacts_;  // near ones of all groups
  std::vector<Vector3> forces_W_;
  std::vector<int> order_, small_;           // small: groups that are no crowd
  std::vector<std::pair<int, int>> joined_;  // pairs of several parts that met in this step
  std::vector<int> job_of_;                  // per body that moves
  Meeting meeting_;
  std::vector<double> rooms_;
  std::vector<std::uint8_t> crowd_, was_frozen_, gave_up_;
  bool any_crowd_ = false;
  Races races_ = Races::kRefused;
  std::vector<int> spent_, spent_before_;  // work in the shortest parts of the whole step, per body
  double whole_dt_ = 0;
  std::vector<LedgerImpulse> impulses_;
};

}  // namespace islet::motion
