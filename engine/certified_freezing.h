// Freezing that never lies: a frozen body carries the impulses that hold it, and stays frozen only while they balance what
// acts on it.
//
//   freezes  a body that has stood still for a time in seconds, judged by the displacement of its farthest point, in whose
//            island all do (loads that no motion changes are as good in one distribution as in another); or that has stood
//            still for ten times as long, with contacts that pressed alike; which the static-contact solution of this very
//            frame leaves at rest, and which does not accelerate: however slow, what gains velocity in the same direction
//            frame by frame stands on an edge or a top, and will fall. (But for a turn on the spot, which points never brake, by
//            less than what counts as balanced)
//   checks   every frame, every frozen body: gravity and external force, times dt, plus the impulses of its contacts
//            (stored ones where nothing moves, this frame's where something does) must sum to zero and lie in their
//            cones. A support that is gone, a load that changed, gravity that turned, friction that was lowered, a wall
//            that began to move: all show
//   the suite then solves the static problem of the unbalanced bodies again; those that it gives a velocity wake
//   threads: one caller at a time
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "engine/settings.h"
#include "engine/suite_frame.h"

namespace islet {

class CertifiedFreezing {
 public:
  // Start of a frame: how long has each body stood still, under the same gravity and external force?
  void TrackTravel(std::span<const Body> bodies, double dt, const Settings& settings);

  // After TrackTravel, when the contacts of the frame are known: sums what freezing took from each body, and wakes those that a
  // kinematic one may carry: that touch one that moves, or that contacts join to one that creeps. Their neighbours would be
  // carried towards them as towards walls.
  void BeginFrame(const SuiteFrame& frame);

  // Frozen bodies whose balance is broken, ascending. lenient: per body, whether solves of this frame have changed the
  // impulses around it: what they leave is seen to in the next frame.
  void FindUnbalanced(const SuiteFrame& frame, std::span<const std::uint8_t> lenient, std::vector<int>* unbalanced);

  // Over the frozen bodies: sum of all impulses over the sum of their magnitudes, the largest. Of the impulses at the last
  // FindUnbalanced.
  double WorstImbalance(const SuiteFrame& frame) const;

  // The velocity [m/s, rad/s] a frozen body would start its static problem with: momentum left by bounces, gravity, external
  // force and the impulses of its contacts with bodies that move. Valid after FindUnbalanced.
  Twist LoadedVelocity(const SuiteFrame& frame, int body) const;

  // Above this a body wakes: [m/s] of its farthest point. Valid after FindUnbalanced.
  double WakeSpeed(const SuiteFrame& frame, int body, bool lenient, const Settings& settings) const;
  // A bounce that leaves a frozen body slower than this does not wake it by itself.
  double StillSpeed(const Body& body, const Settings& settings) const;

  // A frozen body has the velocity that somebody found for it, below what wakes it, and is to be put to rest all the same: notes
  // the way [m, rad] that this withholds from it in the frame. True if all that was withheld since it last moved by itself (by
  // freeze_travel radii within freeze_seconds) would exceed freeze_travel radii at its farthest point: it must not stay frozen.
  // at_end: of the frame, when it adds to what Freeze noted only if it is faster than that.
  bool StaysBehind(const SuiteFrame& frame, int body, bool at_end, const Settings& settings);

  // The body has to stand still anew before it may freeze.
  void Disturb(int body) { undisturbed_seconds_[body] = 0; }

  // End of a frame: freezes what may freeze; false if nothing may. Velocities stay, to be given back to what turns out not to be
  // balanced.
  bool Freeze(const SuiteFrame& frame, const std::vector<std::uint8_t>& was_frozen, const Settings& settings);
  // Not frozen after all: moves on as it did before Freeze.
  void Release(const SuiteFrame& frame, int body);

 private:
  struct Wrench {
    Vector3 force, torque;  // [N], [N m]
  };
  struct Load {
    Vector3 linear, angular;                // [N s], [N m s] of everything
    Vector3 moving_linear, moving_angular;  // without the stored impulses
    double size, moving_size;               // [N s] sums of magnitudes: what "zero" is relative to
    double outside;  // farthest that a stored impulse lies outside its friction cone, of its size
  };
  static Wrench PullOn(const Body& body, const Settings& settings);  // gravity and external force
  static double Size(const Wrench& wrench, double radius);           // [N]
  void SumLoads(const SuiteFrame& frame);
  void AddContact(const SuiteFrame& frame, size_t contact);
  void TrackGain(const SuiteFrame& frame);
  void ForgiveSpins(const SuiteFrame& frame);
  void FindRestingIslands(const SuiteFrame& frame, const Settings& settings);
  void TrackLoads(const SuiteFrame& frame, const Settings& settings);
  static double Imbalance(const Body& body, const Load& load);
  static double Tolerance(const Load& load);  // imbalance that counts as none

  std::vector<Vector3> reference_position_;
  std::vector<Quaternion> reference_rotation_;
  std::vector<Wrench> last_pull_;
  std::vector<double> still_seconds_;
  std::vector<double> undisturbed_seconds_;     // the same, from the last Disturb on
  std::vector<Twist> last_twist_, last_gain_;   // at the end of the last frame, and by how much it had changed
  std::vector<std::uint8_t> steady_;            // gains velocity in the same direction as a frame ago
  std::vector<std::uint8_t> on_spot_, twists_;  // scratch of ForgiveSpins
  std::vector<double> calm_seconds_;            // how long the impulses at its contacts have been steady
  std::vector<double> change_, pressed_;        // [N s] of this frame: by how much they did, and how large they are
  std::vector<std::uint8_t> on_mover_;          // per body: a kinematic one may carry it
  std::vector<Twist> withheld_, withheld_now_;  // [m, rad] per body: see StaysBehind; so far, and in this frame
  std::vector<Load> loads_;
  std::vector<std::uint8_t> touched_;
  std::vector<int> roots_;     // islands of bodies that move
  std::vector<int> restless_;  // per body: not all of its island rests; per root before: members that do not
  std::vector<int> members_;   // per root: bodies of its island that move
};

}  // namespace islet
