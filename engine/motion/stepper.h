// The law of the step for a group of bodies that may meet: poses move by velocities, velocities change by contact impulses,
// and nothing else happens. Derivation and symbols: engine/motion/README.md.
//
//   a step is cut into pieces; in a piece of length h
//     carry    impulses I, spread over the piece:  0 <= I_n, gap(x1) >= 0, I_n gap(x1) = 0, friction on the mean velocity
//     settle   the same impulses redone so that velocities agree with the pose at the end; takes energy, never adds any
//     blows    where something hits: a piece ends at that moment; queue and collision problem as in any step [SM04]
//   a piece in which the bodies gain energy, or that leaves an overlap, is done again at half its length
//
//   in:      bodies of the group with their partners (walls, what the user moves), ascending; pairs that may meet
//   out:     poses and velocities of those that move; every impulse with its point and time
//   threads: one Stepper per worker; a result depends on the group alone
//   allocation: none after warm-up
#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "engine/body.h"
#include "engine/contact.h"
#include "engine/impact/sequential.h"
#include "engine/motion/lever.h"
#include "engine/motion/meeting.h"
#include "engine/motion/path.h"
#include "engine/motion/tuning.h"
#include "engine/problem_record.h"
#include "engine/response/response.h"
#include "engine/settings.h"
#include "engine/shape.h"
#include "engine/step_report.h"
#include "islands/partition.h"

namespace islet::motion {

// An impulse that acted for a time: `duration` 0 is a blow. The force is constant while it acts.
struct TimedImpulse {
  Contact contact;    // bodies and point where it acted; of a spread one: halfway
  Vector3 impulse_W;  // [N s] on body_b
  double time;        // [s] from the start of the step
  double duration;    // [s]
  int corrects = -1;  // place of the spread impulse that it takes something back of, -1: none
};

struct GroupPair {
  int a, b;  // places in the group, a < b
};

// Fills friction and restitution of a contact.
using MixMaterial = std::function<void(Contact* contact, const Body& a, const Body& b)>;

struct Group {
  std::vector<Body> bodies;  // ascending by their number in the world
  std::vector<int> numbers;  // in the world
  std::vector<const Shape*> shapes;
  std::vector<GroupPair> pairs;     // ascending
  std::vector<Contact> remembered;  // of the step before, with the forces [N] that held: where solves start
  std::vector<Vector3> remembered_force_W;
  // Of a step: looks at a pair, and contacts solved, which are so much dearer. With more it is given up.
  int most_work = kMostWork;
};

struct GroupOutcome {
  int pieces = 0, blows = 0, bounces = 0, passes = 0, halvings = 0;
  double unstepped = 0;  // [s] of the step that the bodies stood still, since no way on was found; 0: all is well
  double overlap = 0;    // [m] deepest at the end
  int overlapping = 0;   // pairs that are inside of each other at the end
  bool restitution_lowered = false;
  std::vector<TimedImpulse> impulses;
  std::vector<Contact> touching;  // near contacts at the end pose, and the forces [N] that held there
  std::vector<Vector3> touching_force_W;
  std::vector<ResponseOutcome> carried, settled, struck;  // answers of the contact problems
  bool record = false;                                    // in: whether records are wanted
  bool record_paths = false;                              // in: the same of paths
  std::vector<double> ends;                               // [s] of the pieces that were done
  std::vector<Path> paths;                                // of all bodies in the first of them, then in the next
  std::vector<ProblemRecord> records;
  void Clear();  // keeps the memory of its vectors
};

class Stepper {
 public:
  void Step(double dt, const Settings& settings, const MixMaterial& mix, Group* group, GroupOutcome* outcome);

 private:
  struct Held {  // a contact that carries in this piece
    int pair;
    Vector3 centre;        // [m] of the bodies that its point moves along with, where that was found
    double target;         // [m/s] least normal mean velocity
    double opens;          // [m/s] by which its gap changes then, negative: closes
    int age = 0;           // passes since it was last seen
    bool at_start = true;  // its point is that of the start of the piece, not halfway
  };
  struct Guarded {  // a pair that meets within the piece
    int pair;
    double gap;  // [m] where the piece begins
  };
  struct State {  // of one body while the step is under way
    Pose pose;
    Vector3 linear_W, angular_W;
    Vector3 VelocityAt(const Vector3& point_W) const { return linear_W + angular_W.cross(point_W - pose.position_W); }
  };
  struct Account {                              // of a body, or of all that did something to each other in the piece
    double gain = 0, at_hand = 0, allowed = 0;  // [J]
  };
  void LoadState();
  Vector3 VisibleSpinOf(int i) const;
  double WhirlOf(int i) const;
  double ChooseLength(double rest);
  double Apart(const GroupPair& pair, std::span<const State> at) const;
  void DetectPair(int number, std::span<const State> at, double reach, std::vector<Contact>* contacts,
                  std::vector<int>* pair_of);
  void Mix(const GroupPair& pair, Contact* contact) const;
  void FindTouching();
  void Recall();
  void SelectHeld(double h);
  void Carry(double h, bool first);
  double LighterMass(const Contact& contact) const;
  bool StillCarries(double h);
  bool Jams(double h) const;
  void MoveCentres(double h);
  bool TurnIntoLine();
  void Fly(double h);
  Path PathOf(int i, double h) const;
  double FindMeeting(double h);
  MeetingQuery WayOf(int number, double h, double until, double gap, double deep) const;
  bool MetInABlow(const MeetingQuery& query, int number, double* t);
  double First(const MeetingQuery& query);
  bool WayIsBarred(double h);
  void Guard(int number, double t, const Path& a, const Path& b);
  void EndAt(double at, double* h);
  double Shorten(double h, double moment);
  void DetectEnd();
  bool Touches(int pair) const;
  double GapBefore(int pair) const;
  double GapOfBlow(int pair) const;
  double PushOut(int pair) const;
  double FreshOverlap() const;
  double Missed() const;
  double DeepestSinceStart() const;
  bool NormalsMove() const;
  bool LeversMove(double h) const;
  bool AllFollowed() const;
  bool Foresee(double h);
  bool Strays() const;
  void FollowHeld();
  enum class Moment { kStart, kMiddle, kEnd };
  Vector3 CarriedWith(int i, const Vector3& point, Moment from, Moment to) const;
  Vector3 Carried(int pair, const Vector3& point, Moment from, Moment to) const;
  int FindAt(int pair, const Contact& contact, Moment from, Moment to, std::span<const Contact> there) const;
  bool TurnInThemselves(int pair) const;
  Course CourseOf(int i) const;
  Vector3 Shared(int pair, const Vector3& of_a, const Vector3& of_b) const;
  Vector3 CentreAtStart(int pair) const;
  Vector3 CentreHalfway(int pair) const;
  Vector3 Halfway(int pair, const Vector3& start, const Vector3& end) const;
  const Contact* ClosedAtStart(size_t at_end) const;
  Vector3 MeanVelocity(int i, const Vector3& point) const;
  Vector3 MeanSpin(int i) const;
  void NextTargets(double h);
  Vector3 CarriedBy(size_t at_end) const;
  bool Presses(int pair) const;
  bool WasHeld(size_t at_end) const;
  void PoseAtEnd();
  void Settle();
  void ApplyAtEnd(std::span<const Vector3> impulses_W);
  void Record(Stage stage, QpStatus status);
  bool IsThere(size_t at_end) const;
  bool Hits(size_t at_end) const;
  bool HitsEarlier() const;
  bool HasMet(int pair) const;
  void Strike();
  double EnergyOf(int i, const State& state) const;
  void KeepAccounts(double h);
  void FindWork();
  void SeeWhoPays(double h);
  bool Pushed() const;
  void Commit(double t, double h);
  void PartProblem();
  void SolveParts(std::span<const double> targets, double floor, std::vector<ResponseOutcome>* outcomes);
  double Size(const GroupPair& pair) const;
  double BendOf(const Contact& contact) const;
  double CutSpeed(const Contact& contact) const;
  double BodyRadius(int i) const;
  Quaternion SeenAs(int i, const Pose& pose) const;
  bool WillHit(const Contact& contact, double opening) const;

  // Of the step.
  double dt_ = 0;             // [s]
  double pull_ = 0;           // [m/s^2] fastest that gravity and forces make a body
  double floor_ = 0;          // [m/s] least v_ref
  int blow_budget_ = 0;       // blows in this step at which they have to be faster
  int movers_ = 0;            // bodies that contacts can move
  int cuts_ = 0;              // pieces that ended at one
  int work_ = 0;              // so far
  double least_rebound_ = 0;  // [m/s] a slower one is none
  double threshold_ = 0;      // [m/s] approaches below it are none
  Settings settings_;
  const MixMaterial* mix_ = nullptr;
  Group* group_ = nullptr;
  GroupOutcome* out_ = nullptr;
  std::vector<double>
      yields_;  // [m/s] >= 0 per pair: approach that no velocity avoids, between walls that close; it overlaps
  std::vector<Account> accounts_;
  bool gains_ = false, loses_ = false;  // some of them more than allowed; what a jam takes
  bool creates_ = false;                // more than the ledger lets pass
  std::vector<double> work_of_, taken_, costs_,
      purse_;  // [J] per pair: work of what carried in the piece; what it took in the step; for its overlap; may give back
  std::vector<std::uint8_t> pays_;  // per pair: whether that is enough
  std::vector<double> step_gap_;    // [m] <= 0 per pair: overlap as the step began
  // Of the piece.
  double time_of_piece_ = 0;                         // [s] at which it begins
  int cut_pair_ = -1;                                // whose blow ends it
  int grazing_ = -1;                                 // whose blow ended the piece before, and was none
  std::vector<State> state_, end_state_, foreseen_;  // per body: where it begins and ends
  std::vector<Pose> middle_, turned_;                // halfway on the chord; turned freely for half of its time
  std::vector<Vector3> spun_, spun_after_;           // [rad/s] there, before and after the impulses
  std::vector<Vector3> mean_W_, spin_gain_;          // [m/s] mean velocity; [N m s] what impulses and torque give
  std::vector<Contact> now_, end_, held_, next_, last_, probe_;
  std::vector<int> now_pair_, end_pair_;
  std::vector<Held> held_of_, next_of_;
  std::vector<Vector3> impulse_W_, next_impulse_W_, acted_at_;  // per held contact [N s], [m]
  std::vector<std::uint8_t> closed_;                            // per contact of now_: closed as the piece begins
  std::vector<int> follows_;                                    // in end_, or -1
  std::vector<int> carried_at_;                                 // per contact of end_: place of what it carried, or -1
  std::vector<Vector3> force_W_;                                // [N] per contact of now_: what held there
  std::vector<Vector3> settle_W_, strike_W_;                    // [N s] per contact of end_
  enum Freed : std::uint8_t { kStays, kHits, kLeaves, kReturns };
  std::vector<Freed> freed_;  // per pair: about to hit; leaves; is back within the piece, too slow for a blow
  bool returned_ = false, guarded_ = false;
  bool met_ = false;  // something on the way that was searched, and no blow
  std::vector<Contact> guards_;
  std::vector<Guarded> guard_of_;
  // Scratch of contact problems.
  std::vector<Body> posed_, trial_;
  std::vector<Contact> problem_;
  std::vector<int> problem_of_;
  std::vector<Matrix3> frames_;
  std::vector<Vector3> local_impulses_, bounces_, carried_W_;
  std::vector<double> targets_;
  std::vector<std::uint8_t> cut_;
  std::vector<std::pair<int, int>> edges_;
  islands::Partition partition_;
  IslandResponder responder_;
  SequentialResolver sequential_;
  Meeting meeting_;
};

}  // namespace islet::motion
