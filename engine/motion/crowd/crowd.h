// The law of the step for a crowd: the bodies of the groups that are too large for a piece of their own. One piece a step.
// Derivation and symbols: engine/motion/README.md; files: engine/motion/crowd/README.md.
//
//   carry    impulses I, spread over the step:  0 <= I_n, gap(x1) >= 0, I_n gap(x1) = 0, friction on the mean velocity; posed anew
//            where bodies turned, for the islands in which gaps missed their end
//   settle   the impulses J of the contacts that are closed at the end pose, from the velocities that all but these leave
//   blows    what came in the step and rebounds: queue and collision problem at the end pose                          [SM04]
//
//   in:      the world's bodies, those that are not of the crowd marked as removed; contacts near their poses
//   out:     poses and velocities; every impulse with its point and time; contacts near the new poses
//   threads: islands and bodies are shared by the pool; results do not depend on the number of workers
//   allocation: none after warm-up
#pragma once

#include <cmath>
#include <functional>
#include <span>
#include <vector>

#include "engine/body.h"
#include "engine/contact.h"
#include "engine/contact_pairs.h"
#include "engine/freezing/certified_freezing.h"
#include "engine/impact/sequential.h"
#include "engine/ledger.h"
#include "engine/motion/lever.h"
#include "engine/motion/meeting.h"
#include "engine/motion/path.h"
#include "engine/motion/visible_turn.h"
#include "engine/problem_record.h"
#include "engine/response/response.h"
#include "engine/response/suite_frame.h"
#include "engine/settings.h"
#include "engine/shape.h"
#include "engine/step_report.h"
#include "islands/partition.h"
#include "parallel/schedule.h"
#include "parallel/worker_pool.h"

namespace islet::motion {

// Fills the near contacts of Crowd::Step at the bodies' present poses, for bodies about to travel as given [m], by pair and feature.
using FindContacts = std::function<void(std::span<const Vector3> travel_W)>;

// What one step of a crowd leaves for the next.
struct CrowdMemory {
  std::vector<Contact> contacts;  // near ones
  std::vector<Vector3> forces_W;  // [N] on body_b, that held there
  std::vector<double> lost;       // [J] per body: by all that it pressed, together; infinite: it pressed nobody
  std::vector<CertifiedFreezing::Stillness> still;  // per body
  std::vector<int> freeze_counters;                 // kPaper, per body
};

class Crowd {
 public:
  Crowd(const Settings& settings, parallel::WorkerPool* pool);
  void SetGravity(const Vector3& gravity_W) { settings_.gravity = gravity_W; }
  // [s] of the step that those to come are parts of.
  void SetWholeStep(double dt) { whole_dt_ = dt; }

  void Step(double dt, const FindContacts& find, const ProblemObserver& observer, std::span<Body> bodies,
            std::span<const Shape> shapes, std::vector<Contact>* near, CrowdMemory* memory, StepReport* report);

  void Rest() { impulses_.clear(); }                                     // no step of a crowd
  std::span<const LedgerImpulse> impulses() const { return impulses_; }  // of the last step

 private:
  // Of the fastest blow: by how much those of a body may differ that lands flat, since gaps miss their end.
  static constexpr double kTie = 1e-2;
  static constexpr double kReach = 0.02;  // of a size: contacts nearer than that may carry in a pass
  // Of a size: overlap that a piece may not make. The way out of one that begins deeper inside is not that of the way in.
  static constexpr double kDeep = 1e-3;
  static constexpr double kGain = 0.1 * Ledger::kMostEnergy;  // of the energy at hand: what a piece may make

  struct Held {                                              // a contact that carries
    double target = 0;                                       // [m/s] least normal mean velocity
    double allowed = 0;                                      // [m] <= 0: gap at which it may end
    double push = 0;                                         // [m] of that: what the step takes back of an overlap
    Vector3 belt_W = Vector3::Zero();                        // [m/s] the contact's own surface velocity
    bool pressed = false;                                    // in some pass
    int opened = 0;                                          // passes after which its pair was open, though it pressed
    Vector3 in_a = Vector3::Zero(), in_b = Vector3::Zero();  // [m] the points that meet, in the frames of the bodies
    bool faces_a = false, faces_b = false;                   // the axes of its bodies
  };
  struct Free {        // of one body, under forces alone
    Vector3 linear_W;  // [m/s] on average
    FreeTurn half;     // for half of the piece
  };
  struct Yield {  // of a pair between walls that close
    Contact pair;
    double speed;  // [m/s] at which nothing keeps it apart
  };
  struct Worker {
    IslandResponder responder;
    SequentialResolver sequential;
    std::vector<int> contacts;
    std::vector<Twist> held;  // of an island's bodies, before blows
    std::vector<Vector3>
        given;                 // [N s] what they carried and what of it was beyond their cones, while it is given back
    std::vector<int> taken;    // held contacts of an island whose impulses are given back where they acted
    std::vector<int> parents;  // of its bodies: of those that impulses join
    std::vector<double> gains, works;   // [J] of these, at the first of them: gains beyond what is theirs
    std::vector<double> share, square;  // of these: what is left of their blows; [J] what all of a blow has alone
    std::vector<std::uint8_t> gaining;  // per body of the island
    Meeting meeting;
    std::vector<Contact> probe;
  };
  struct Carrier {  // a contact of the next pass, with its first guess
    Contact contact;
    Held held;
    Vector3 impulse_W, centre;
  };

  enum class Outcome { kDone, kMissed, kHitFrozen };
  struct Place {
    Vector3 point_W;  // [m]
    double reach;     // [m] that it may be from there
  };

  // crowd.cpp: the step, piece by piece.
  void TurnCorners();
  void DropLevelEdges();
  bool Pieces(double dt, const FindContacts& find, CrowdMemory* memory, StepReport* report);
  Outcome Piece(double t, double h, bool last, const FindContacts& find, CrowdMemory* memory, StepReport* report);
  double MeanPull() const;
  double MeanHold();
  void Load(double dt);
  void Remember(double h, CrowdMemory* memory);
  void Return(std::span<const State> states);
  bool HitsFrozen();
  double FreshOverlap() const;
  double Size(const Contact& contact) const;
  void Report(std::span<const ResponseOutcome> outcomes, QpSummary* summary, double seconds, double* stage,
              StepReport* report);
  void ReportIslands(StepReport* report) const;
  void Record(int island, Stage stage, const ResponseOutcome& outcome, const Worker& worker);
  void TellObserver();
  template <typename F>  // f(island, Worker*), of the partition, on all workers
  void ForEachIsland(const F& f);

  // crowd_carry.cpp: what carries, and its impulses.
  void AllowPushes(const CrowdMemory& memory);
  void Select();
  void Carry(bool first, StepReport* report);
  void MarkClosedUpon();
  void GiveWay();
  void Part(std::span<const Contact> contacts);
  void PartEdges();
  double PushOf(double gap) const;
  double YieldOf(const Contact& pair) const;
  double GapAtStart(const Contact& pair) const;
  double MassOf(int i) const { return cut_[i] ? INFINITY : bodies_[i].mass; }  // [kg]
  double LighterMass(const Contact& contact) const;
  Side SideAtStart(int i, const Contact& contact) const;
  Matrix3 Share(const Contact& contact) const;
  Vector3 Shared(const Contact& contact, const Vector3& of_a, const Vector3& of_b) const;
  bool IsRound(const Contact& contact) const;

  // crowd_flight.cpp: the course under impulses.
  void Fly();
  Path PathOf(int i) const;
  Course CourseOf(int i) const;
  Vector3 AxisOf(int i, bool faces) const;
  void Face(const Held& held, const Vector3& centre_a, const Vector3& centre_b, Contact* contact) const;
  Vector3 MeanVelocity(int i, const Vector3& point) const;
  Vector3 TakesOn(int i, size_t c) const;
  Vector3 Inside(int i, const Pose& pose, const Vector3& point) const;
  Vector3 Outside(int i, const Pose& pose, const Vector3& point) const;
  Vector3 Centre(const Contact& c) const;
  bool TurnsInItself(int i) const { return motion::TurnsInItself(shapes_[i]); }
  // A rotation that has the body where this one has it, reached without a turn about its own axis.
  Quaternion SeenAs(int i, const Quaternion& rotation_WB) const {
    return VisibleRotation(shapes_[i], begin_[i].pose.rotation_WB, rotation_WB);
  }

  // crowd_judge.cpp: whether a pass meets its end.
  bool Judge(int pass);
  void Disturb(const Contact& contact);
  bool LetGo();
  bool LeversMiss();
  bool Gains();
  bool MarkGains(int island, Worker* worker) const;
  double EnergyOf(size_t i, bool at_end) const;
  Vector3 SlipOf(size_t c) const;
  double WorkOf(size_t c) const;
  double WorkOfWalls(const Contact& c, const Vector3& point, const Vector3& impulse_W, bool at_end) const;

  // crowd_aim.cpp: the contacts of the next pass.
  void FollowHeld();
  Place PlaceAtEnd(size_t c) const;
  bool IsFoundAgain(size_t c) const;
  void NextTargets();
  void PoseAnew(const PairPlaces& pair, Worker* worker, std::vector<Carrier>* next);
  void Keep(size_t c, std::vector<Carrier>* next) const;
  void Aim(size_t end, std::vector<Carrier>* next) const;
  bool Guard(size_t e, size_t e_end, Worker* worker, std::vector<Carrier>* next) const;
  double GapAlong(const Contact& contact, const Held& held) const;
  double TargetOf(const Contact& contact, double gap, double allowed) const;
  const Contact* AtStart(const Contact& end) const;

  // crowd_settle.cpp: velocities where the piece ends.
  Vector3 ChangeAt(size_t c) const;
  bool Pressed(size_t e) const;
  Vector3 BeyondCone(int c) const;
  void KeepToCone(int island, Worker* worker);
  void Inherit();
  void TurnCarried();
  void Settle(StepReport* report);
  Contact WhereTaken(size_t c) const;
  bool GiveBack(int island, Worker* worker);
  void FindHits();
  void SettleIsland(int island, Worker* worker);
  void TakeBack(int island);
  void HoldIsland(int island, Worker* worker);
  void HoldThenStrike(int island, Worker* worker);
  void Strike(int island, Worker* worker);
  bool Soften(int island, Worker* worker);
  Vector3 PullOn(const Contact& contact) const;
  double ClosingWay(const Contact& contact) const;
  double SpeedOfMoment(const Contact& contact, double start, double end) const;

  // crowd_freezing.cpp
  void LookAtStart(double dt, const CrowdMemory& memory);
  void FillFrame(double dt, std::span<const Vector3> forces_W);
  void Wake(double dt, CrowdMemory* memory);
  void SortTold();
  int ToldAt(const Contact& contact) const;
  bool Hold(double dt, CrowdMemory* memory);
  void Freeze(double dt, CrowdMemory* memory, StepReport* report);

  Settings settings_;
  parallel::WorkerPool* pool_;
  std::vector<Worker> workers_;
  // Of the step.
  std::span<Body> bodies_;
  std::span<const Shape> shapes_;
  std::vector<Contact>* near_ = nullptr;
  const ProblemObserver* observer_ = nullptr;
  std::vector<LedgerImpulse> impulses_;
  std::vector<std::uint8_t> was_frozen_, hit_;  // as it began; what was frozen and took a blow, or
  std::vector<std::uint8_t> closed_upon_;       // would have to give way
  std::vector<State> first_;                    // as it began
  std::vector<Contact> first_near_;
  CrowdMemory first_memory_;
  std::vector<Yield> yields_;  // few
  // Of the piece, where it begins.
  double dt_ = 0, whole_dt_ = 0;  // [s]; of the whole step
  double least_energy_ =
      0;  // [J/kg] that what rests has at hand, as its weight gives it: a piece's share of the step's
  double floor_ = 0, threshold_ = 0;    // [m/s] least v_ref; approaches below it are none
  bool driven_ = false;                 // walls move
  std::vector<Contact> start_;          // near ones
  std::vector<Vector3> start_force_W_;  // [N] that held there
  std::vector<Vector3> held_by_W_;      // [N] per body: all that contacts gave it
  std::vector<State> begin_;            // per body
  std::vector<Free> free_;
  std::vector<std::uint8_t> cut_;      // per body: contacts do not move it
  std::vector<std::uint8_t> near_to_;  // per body: a contact with what moves is near it
  std::vector<std::uint8_t> pushes_;   // per body: its overlaps are pushed out
  std::vector<std::uint8_t> gained_;   // per body: by a pass of this piece
  // Of a pass.
  std::vector<Pose> middle_;                   // per body, halfway on the chord
  std::vector<Vector3> mean_W_, mean_spin_W_;  // [m/s], [rad/s]
  std::vector<Going> ways_;                    // of each body, as far as it is known
  double off_ = 0;                             // [s^2] OffAhead of a first pass, OffChord of later ones
  std::vector<Vector3> travel_;                // [m] that the next piece may take it
  std::vector<std::uint8_t> disturbed_;        // per body: it is solved again
  std::vector<Contact> held_;
  std::vector<Held> held_of_;
  std::vector<Vector3> impulse_W_;          // [N s] per held contact
  std::vector<Vector3> acted_at_;           // [m]
  std::vector<Vector3> sides_W_;            // of a pair, that face each other
  std::vector<Vector3> centre_;             // [m] of the bodies that its point moves along with, where that was found
  std::vector<PairPlaces> pairs_;           // of what is held, and of what is near
  std::vector<std::uint8_t> opens_;         // per pair: it ends open, though it pressed
  std::vector<std::vector<Carrier>> next_;  // of so many pairs each
  std::vector<int> follows_;                // per held contact: place in near_, or -1
  std::vector<double> before_;              // [m] <= 0 per near contact: overlap of its pair where the piece began
  std::vector<Vector3> rubbed_W_;           // [N s] per near contact: friction of that, where it acted
  std::vector<double> bore_;                // [N s] and along the normals there
  std::vector<Vector3> turned_W_;           // [N s] per near contact: what it carried, as it lies at the end
  std::vector<Vector3> carried_W_;          // [N s] per near contact; at the end: what of that its cone allows there
  std::vector<double> gain_, at_hand_, lost_;  // [J] per body
  // Of its end.
  std::vector<int> problem_at_;              // per near contact: its place in the problem, or -1
  std::vector<std::uint8_t> given_back_;     // per held contact: its impulse, where its bodies took it
  std::vector<int> closed_;                  // places in near_ of the contacts of the problem
  std::vector<int> acted_as_;                // per held contact: place in impulses_, or -1
  std::vector<int> told_;                    // places in impulses_, by pair
  std::vector<double> pressed_;              // [N s] per near contact: what it carried, along its normal
  std::vector<Vector3> beyond_W_;            // [N s] per contact of the problem: what it carried beyond its cone
  std::vector<std::uint8_t> hits_;           // per contact of the problem: a blow
  std::vector<double> approaches_;           // [m/s] the same: where the piece begins, 0 if it opens
  std::vector<Vector3> blows_, collisions_;  // [N s] the same, (n, t1, t2)
  std::vector<Vector3> blow_W_;              // [N s] per near contact
  std::vector<double> work_;                 // [J] the same: of what it carried
  std::vector<Vector3> spins_W_;  // [N m s] per body: what it would keep of levers that are not those of the end
  std::vector<double> lands_;     // [m/s] per body: how fast something heavy lands on it
  std::vector<double> errors_;    // [m/s] per body: the worst natural map of what was solved with it
  std::vector<Contact> joined_;   // of freezing's frame
  std::vector<int> joined_at_;    // places in near_
  SuiteFrame frame_;
  CertifiedFreezing freezing_{/*whole=*/false};
  // Scratch of contact problems.
  std::vector<Body> posed_;
  std::vector<Contact> problem_;
  std::vector<Matrix3> frames_;
  std::vector<Vector3> local_;           // [N s] per contact of the problem, (n, t1, t2)
  std::vector<double> targets_, given_;  // [m/s]; what it gave way by
  std::vector<std::pair<int, int>> edges_;
  std::vector<int> active_, pressing_;  // places in held_ of the contacts of a partition
  islands::Partition partition_, gaining_;
  std::vector<double> costs_;
  parallel::Schedule schedule_;
  std::vector<ResponseOutcome> outcomes_, struck_;  // per island
  std::vector<int> bounces_of_;
  std::vector<std::vector<ProblemRecord>> records_;  // for the observer
};

template <typename F>
void Crowd::ForEachIsland(const F& f) {
  costs_.resize(partition_.num_islands());
  for (int i = 0; i < partition_.num_islands(); ++i)
    costs_[i] = 1.0 + static_cast<double>(partition_.contacts_of(i).size());
  pool_->ForEachByCost(costs_, kBatchCost, &schedule_, [&](int island, int worker) { f(island, &workers_[worker]); });
}

}  // namespace islet::motion
