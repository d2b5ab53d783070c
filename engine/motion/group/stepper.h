// The law of the step for a group of bodies that may meet: poses move by velocities, velocities change by contact impulses,
// and nothing else happens. Derivation and symbols: engine/motion/README.md; files: engine/motion/group/README.md.
//
//   a step is cut into pieces; in a piece of length h
//     carry    impulses I, spread over the piece:  0 <= I_n, gap(x1) >= 0, I_n gap(x1) = 0, friction on the mean velocity
//     settle   the same impulses redone so that velocities agree with the pose at the end; takes energy, never adds any
//     blows    where something hits: a piece ends at that moment; queue and collision problem as in any step [SM04]
//     ends     where a slip or a support ends within the piece, it ends there
//   a piece in which the bodies gain energy, or that leaves an overlap, is done again at half its length
//
//   in:      bodies of the group with their partners (walls, what the user moves), ascending; pairs that may meet
//   out:     poses and velocities of those that move; every impulse with its point and time
//   threads: one Stepper per worker; a result depends on the group alone
//   allocation: none after warm-up
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "engine/impact/sequential.h"
#include "engine/motion/group/group.h"
#include "engine/motion/lever.h"
#include "engine/motion/meeting.h"
#include "engine/motion/visible_turn.h"
#include "engine/response/response.h"
#include "engine/settings.h"
#include "engine/step_report.h"
#include "islands/partition.h"

namespace islet::motion {

class Stepper {
 public:
  void Step(double dt, const Settings& settings, const MixMaterial& mix, Group* group, GroupOutcome* outcome);

 private:
  // A solved contact is worth so many looks at a pair, a look so many pairs passed over, or corners of both.
  static constexpr int kSolveWork = 32;
  static constexpr double kSettled = 0.0002;  // of the tolerance: what velocities at the end may miss
  static constexpr double kTogether = 1e-4;   // of a size: what is this near to a blow takes part, as in a flat landing

  struct Held {  // a contact that carries in this piece
    int pair;
    Vector3 centre;         // [m] of the bodies that its point moves along with, where that was found
    double target;          // [m/s] least normal mean velocity
    double opens;           // [m/s] by which its gap changes then, negative: closes
    Vector3 belt_W;         // [m/s] the contact's own surface velocity
    bool faces_a, faces_b;  // the axes of its bodies
    int age = 0;            // passes since it was last seen
  };
  struct SlowMeeting {  // within the piece, and no blow
    int pair;
    double time;  // [s]
    MeetingQuery query;
  };
  struct Guarded {  // a pair that meets within the piece
    int pair;
    double gap;  // [m] where the piece begins
    bool faces_a, faces_b;
  };
  struct Account {                              // of a body, or of all that did something to each other in the piece
    double gain = 0, at_hand = 0, allowed = 0;  // [J]
    double left = 0;                            // [J] what no point of a contact with a turning wall takes back
  };
  struct Pull {  // of a body with a force or a torque of its own
    int body;
    Vector3 along_W;  // [m/s^2] with gravity
    double twist;     // [m/s^2] what the torque makes a point
  };
  struct Progress {     // of the step
    double t = 0;       // [s] done
    double most = 0;    // [s] length of the next piece
    double before = 0;  // [s] length of the last one
    int level = 0;      // how often pieces were halved
    int events = 0;     // slips and supports that ended
  };
  enum class Moment { kStart, kMiddle, kEnd };  // of a piece

  // stepper.cpp: the step, piece by piece.
  void Begin(double dt, const Settings& settings, const MixMaterial& mix, Group* group, GroupOutcome* outcome);
  bool Piece(Progress* progress);
  double ChooseLength(double rest);
  double FindCourse(double h);
  bool Refine(bool may_halve, bool* cut, double* h);
  void Commit(double t, double h);
  void End();
  void LoadState();
  Vector3 VisibleSpinOf(int i) const;
  double RoundTurn(int i) const;
  double TurnAgainst(const GroupPair& pair) const;
  double Size(const GroupPair& pair) const;
  bool TurnsInItself(int i) const { return motion::TurnsInItself(*group_->shapes[i]); }

  // stepper_contacts.cpp: what is found, where the piece begins and where it ends.
  double Apart(const GroupPair& pair, std::span<const State> at) const;
  void DetectPair(int number, std::span<const State> at, double reach, std::vector<Contact>* contacts,
                  std::vector<int>* pair_of);
  void Mix(const GroupPair& pair, Contact* contact) const;
  void Turn(const GroupPair& pair, const State& a, const State& b, std::span<Contact> found) const;
  bool SlidesBy(const GroupPair& pair, std::span<const State> at, std::span<const Contact> found);
  void FindTouching();
  void MeasureGaps();
  void MeasureSunk(std::span<const Contact> contacts);
  void DetectEnd();
  Contact AsActed(size_t held) const;
  void FollowHeld();
  int FindAt(int pair, const Contact& contact, Moment from, Moment to, std::span<const Contact> there) const;
  const Contact* ClosedAtStart(int pair, const Contact& end) const;
  const Contact* ClosedAtStart(size_t at_end) const { return ClosedAtStart(end_pair_[at_end], end_[at_end]); }
  Vector3 CarriedBy(size_t at_end) const;
  int HeirOf(size_t held) const;
  bool CutFor(size_t at_end) const;
  bool IsCutForNew() const;
  double ClosingAtEnd(const Contact& c) const;
  bool ClosesFromRest(const MeetingQuery& query, int number, const Contact& c, double approach, double t) const;
  Vector3 AllowedOf(size_t at_end, const Vector3& velocity_W) const;
  Vector3 BeyondCone(size_t at_end, const Vector3& change_W) const;
  bool WasHeld(size_t at_end) const;
  bool Presses(int pair, std::optional<std::uint32_t> feature = {}) const;
  bool Touches(int pair) const;
  double ClosedGap(int pair) const;
  double GapBefore(int pair) const;
  double GapToMeet(size_t at_end, const Contact* start) const;
  double PushOut(int pair) const;
  double FreshOverlap() const;
  double DeepestSinceStart() const;
  double Missed() const;
  bool IsOpenAtEnd(int pair) const;
  double Shifted() const;

  // stepper_carry.cpp: what carries, and its impulses.
  void LookAhead(int pair, double h);
  void SelectHeld(double h);
  void Hold(int pair, double target, bool faces_a, bool faces_b, const Contact& contact, const Vector3& impulse_W,
            double h);
  void Carry(double h, bool first);
  bool StillCarries(double h);
  void NextTargets(double h);
  bool NormalsMove() const;
  bool SinksFreely() const;
  bool LeversMove(double h) const;
  double LighterMass(const Contact& contact) const;
  void PartProblem();
  void SolveParts(std::span<const double> targets, double floor, std::vector<ResponseOutcome>* outcomes);
  void Record(Stage stage, QpStatus status);

  // stepper_flight.cpp: the course under impulses.
  void Fly(double h);
  void EndAt(double at, double* h);
  void MoveCentres(double h);
  bool TurnIntoLine();
  State WallAt(size_t i, double t) const;
  std::pair<Pose, Vector3> WallHalfway(size_t i, double h) const;
  void PlaceWalls(double t, std::vector<State>* states) const;
  Path PathOf(int i, double h) const;
  Course CourseOf(int i) const;
  Vector3 AxisOf(int i, bool faces) const;
  void Face(const Held& held, const Vector3& centre_a, const Vector3& centre_b, Contact* contact) const;
  Vector3 MeanVelocity(int i, const Vector3& point) const;
  Vector3 MeanSpin(int i) const;
  Vector3 CarriedWith(int i, const Vector3& point, Moment from, Moment to) const;
  Vector3 Carried(const Contact& contact, Moment from, Moment to) const;
  Vector3 Shared(const Contact& contact, const Vector3& of_a, const Vector3& of_b) const;
  Vector3 CentreAhead(int i, double h) const;
  Vector3 PointAhead(int i, const Contact& contact, double h) const;
  Vector3 CentreHalfway(const Contact& contact) const;
  Vector3 Halfway(const Contact& contact, const Vector3& start, const Vector3& end) const;
  bool TurnInThemselves(int pair) const;
  Quaternion SeenAs(int i, const Pose& pose) const;

  // stepper_meeting.cpp: who meets whom on the way.
  double FindMeeting(double h);
  void FindPaths(double h);
  MeetingQuery WayOf(int number, double h, double gap, double deep) const;
  bool StaysLevel(const MeetingQuery& query, const GroupPair& pair, double t);
  bool MetInABlow(const MeetingQuery& query, int number, double* t);
  double First(const MeetingQuery& query, double until);
  bool WayIsBarred(double h);
  void Probe(const MeetingQuery& query, const GroupPair& pair, double t);
  void ProbeAt(const GroupPair& pair, const State& a, const State& b, double reach);
  void Guard(const SlowMeeting& slow);
  double EndAtBlow(double h, double moment, double most);
  double GapOfBlow(int pair) const;

  // stepper_blow.cpp: velocities where the piece ends.
  void Settle();
  void Strike();
  void PoseAtEnd();
  void ApplyAtEnd(std::span<const Vector3> impulses_W);
  static bool Agrees(const Contact& contact, const Vector3& impulse, const Vector3& velocity, double still);
  bool ActsOn(int body, const Contact& contact) const;
  double PullAlong(const Contact& contact) const;
  double LeastRebound(const Contact& contact) const;
  double CutSpeed(const Contact& contact) const;
  bool WillHit(const Contact& contact, double opening) const;
  bool IsThere(size_t at_end) const;
  bool Hits(size_t at_end) const;
  bool HitsEarlier() const;

  // stepper_events.cpp: what ended within a piece.
  double SlipEnds(double h) const;
  double SupportEnds(double h);
  bool WasThereInPart(double h) const;
  bool SlipTurns(double h) const;
  Vector3 MeanOf(size_t c) const;
  bool GoesOn(size_t at_start) const;
  Pose GoingOn(int i, int pair, double until, double t) const;
  size_t ClosedAt(int pair, double until, double t);
  double MostFriction(size_t held) const;
  Vector3 SlipAtStart(size_t held) const;

  // stepper_energy.cpp: who gained, and who pays for a push.
  double EnergyOf(int i, const State& state) const;
  void KeepAccounts(double h);
  void FindWork();
  void SeeWhoPays(double h);
  bool Pushed() const;

  // Of the step.
  double dt_ = 0;            // [s]
  double pull_ = 0;          // [m/s^2] fastest that gravity and forces make a body
  std::vector<Pull> pulls_;  // of bodies with forces of their own
  double floor_ = 0;         // [m/s] least v_ref
  double brief_ = 0;         // [s] what is over that soon is none
  int budget_ = 0;           // blows in this step at which they have to be faster
  int cuts_ = 0;             // pieces that ended at one
  int work_ = 0;             // so far
  double threshold_ = 0;     // [m/s] approaches below it are none
  Settings settings_;
  const MixMaterial* mix_ = nullptr;
  Group* group_ = nullptr;
  GroupOutcome* out_ = nullptr;
  std::vector<double>
      yields_,         // [m/s] >= 0 per pair: approach that no velocity avoids, between walls that close; it overlaps
      yields_before_;  // where the piece begins
  std::vector<Account> accounts_;
  bool gains_ = false;    // some of them more than allowed
  bool lifts_ = true;     // what is closed keeps its gap; else it may get as deep as its pair is
  bool creates_ = false;  // more than the ledger lets pass
  std::vector<double> work_of_, taken_, costs_,
      purse_;  // [J] per pair: work of what carried in the piece; what it took in the step; for its overlap; may give back
  std::vector<std::uint8_t> pays_;  // per pair: whether that is enough
  std::vector<double> sunk_;        // [m] per body: how deep it is in others as the piece begins
  std::vector<double> step_gap_;    // [m] <= 0 per pair: overlap as the step began
  // Of the piece.
  double time_of_piece_ = 0;                 // [s] at which it begins
  int cut_pair_ = -1;                        // whose blow ends it
  std::vector<State> state_, end_state_;     // per body: where it begins and ends
  std::vector<Pose> middle_;                 // halfway on the chord
  std::vector<FreeTurn> turned_;             // for half of its time
  std::vector<Path> paths_;                  // of each body
  std::vector<Vector3> spun_after_;          // [rad/s] there, after the impulses
  std::vector<Going> ways_;                  // of each body, as far as it is known
  double off_ = 0;                           // [s^2] OffAhead of a first look, OffChord of passes
  std::vector<Vector3> mean_W_, spin_gain_;  // [m/s] mean velocity; [N m s] what impulses and torque give
  std::vector<Contact> now_, end_, held_, next_, last_, probe_, ahead_;
  std::vector<int> now_pair_, end_pair_;
  std::vector<double> least_gap_;  // [m] per pair, as the piece begins
  std::vector<int> joined_;        // per body: the first of those that touch each other then, walls apart
  std::vector<Held> held_of_, next_of_;
  std::vector<Vector3> impulse_W_, next_impulse_W_, acted_at_;  // per held contact [N s], [m]
  std::vector<std::uint8_t> closed_;                            // per contact of now_: closed as the piece begins
  std::vector<int> follows_, heirs_;                            // in end_, or -1
  std::vector<int> carried_at_;                                 // per contact of end_: place of what it carried, or -1
  std::vector<Vector3> carried_to_W_;                           // [N s] per contact of end_: what it carried
  std::vector<Vector3> force_W_;                                // [N] per contact of now_: what held there
  std::vector<Vector3> settle_W_, strike_W_;                    // [N s] per contact of end_
  enum Freed : std::uint8_t { kStays, kHits, kLeaves, kReturns };
  std::vector<Freed> freed_;  // per pair: about to hit; leaves; is back within the piece, too slow for a blow
  bool returned_ = false, guarded_ = false;
  bool met_ = false;  // something on the way that was searched, and no blow
  std::vector<Contact> guards_;
  std::vector<Guarded> guard_of_;
  std::vector<SlowMeeting> slow_;
  std::vector<Vector3> sides_W_;  // of a pair, that face each other
  // Scratch of contact problems.
  std::vector<Body> posed_, trial_;
  std::vector<Contact> problem_;
  std::vector<int> problem_of_;
  std::vector<Matrix3> frames_;
  std::vector<Vector3> local_impulses_, bounces_, carried_W_;
  std::vector<double> resting_, least_rebounds_;  // [m/s] of the contacts of a blow
  std::vector<std::uint8_t> strikes_;             // which of them hit
  std::vector<double> targets_;
  std::vector<std::uint8_t> cut_;
  std::vector<std::pair<int, int>> edges_;
  islands::Partition partition_;
  IslandResponder responder_;
  SequentialResolver sequential_;
  Meeting meeting_;
};

}  // namespace islet::motion
