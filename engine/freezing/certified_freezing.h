// Freezing that never lies: what rests and is held by known impulses is not computed again until something changes.
//
//   island   bodies joined by contacts, all of them
//   freezes  where each of its bodies has stood still for freeze_seconds (by the displacement of its farthest point, under the same
//            gravity and force), or was frozen when the frame began; where this frame leaves it no velocity worth a name; and where its
//            contacts can take that (StopImpulses), and what the impulses of this frame leave off balance, inside their cones. Where
//            their cones do not allow that, it stands on an edge or a top, and will fall. Where some of its bodies move and the island was solved
//            to the tolerance, the others freeze all the same
//   holds    what is frozen is a wall for what moves beside it. After the frame what that pressed with is balanced by the contacts of what
//            is frozen: that they can means that standing still obeys Coulomb's law
//   wakes    before anything is resolved: an island that a contact joins to a wall that moves, and each body that the impulses which held it
//            no longer balance. A support that is gone, a load that changed, gravity that turned, friction that was lowered: all show.
//            The frame begins anew with the island awake that was struck, or with those that could not be held: first those alone that
//            give way, then who gives way with a tenth of their speed, and so on. They are solved from the impulses that held them
//   threads: one caller at a time
#pragma once

#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "engine/freezing/stop_impulses.h"
#include "engine/ledger.h"
#include "engine/response/suite_frame.h"
#include "engine/settings.h"
#include "engine/step_report.h"

namespace islet {

class CertifiedFreezing {
 public:
  static constexpr double kCalm =
      0.5 * Ledger::kMostMomentum;  // of the impulses on a body: momentum that rest may take from it

  // Since when a body stands still, and where. All that one frame leaves for the next; an object of this class remembers nothing.
  struct Stillness {
    Vector3 position_W = Vector3::Zero();
    Quaternion rotation_WB = Quaternion::Identity();
    Vector3 force_W = Vector3::Zero(), torque_W = Vector3::Zero();  // gravity included
    double seconds = -1;                                            // -1: nobody has looked yet
  };

  // whole: islands freeze and wake as a whole, and nobody has to call Hold.
  explicit CertifiedFreezing(bool whole) : whole_(whole) {}

  // Start of a frame, when its contacts and the impulses that held are known: wakes who is no longer held. still: per body.
  void BeginFrame(const SuiteFrame& frame, const Settings& settings, std::vector<Stillness>* still);
  // The same once more, where the frame begins anew. hit: per body, whether it was struck while frozen: its island wakes; may be empty.
  void Wake(const SuiteFrame& frame, std::span<const std::uint8_t> hit, const Settings& settings);

  // Once the frame has been moved, before EndFrame: finds what impulses of it leave off balance of frozen bodies. Returns false where
  // nothing within the cones of what holds them balances that: those that give way are frozen no more.
  bool Hold(const SuiteFrame& frame, std::span<const LedgerImpulse> impulses, const Settings& settings);

  // End of a frame: freezes islands; what is frozen has no velocity. was_frozen: per body, as the frame began. errors: [m/s] per
  // body, the worst natural map of the answers of this frame for its island.
  void EndFrame(const SuiteFrame& frame, const std::vector<std::uint8_t>& was_frozen, const std::vector<double>& errors,
                const std::vector<Stillness>& still, const Settings& settings);

  // What the last Hold or EndFrame found for a contact of the frame, in (n, t1, t2).
  struct Stop {
    int contact;
    Vector3 stop, balance;  // [N s] what brings its bodies to rest; what the impulses that hold them lack
  };
  std::span<const Stop> stops() const { return stops_; }

  // Over the frozen bodies of this frame: sum of all impulses over the sum of their magnitudes, the largest.
  double worst_imbalance() const { return worst_imbalance_; }

 private:
  struct Load {
    Vector3 linear = Vector3::Zero(), angular = Vector3::Zero();  // [N s], [N m s] of everything
    double size = 0;                                              // [N s] sum of magnitudes
    double own = 0;                                               // [N s] of gravity and the user alone
    double outside = 0;  // [N s] farthest that an impulse lies outside its cone
  };
  static bool NoneIsFrozen(const SuiteFrame& frame);
  void FindIslands(const SuiteFrame& frame);
  void WakeIslands(const SuiteFrame& frame);
  void WakeWhatGivesWay(const SuiteFrame& frame);
  void StartLoad(const SuiteFrame& frame, int body);
  void AddLoad(const SuiteFrame& frame, const Contact& contact, const Vector3& impulse_W);
  template <typename F>
  void CollectIslands(const SuiteFrame& frame, const F& of);
  template <typename F>
  void ForEachCollected(const F& f);
  void AskForBalance(const SuiteFrame& frame);
  void SumLoads(const SuiteFrame& frame);
  void FindWhatRests(const SuiteFrame& frame, const std::vector<std::uint8_t>& was_frozen,
                     const std::vector<double>& errors, const std::vector<Stillness>& still, const Settings& settings);
  void StopIslands(const SuiteFrame& frame, const Settings& settings);
  void StopIsland(const SuiteFrame& frame, const Settings& settings);
  size_t LeaveOut(const SuiteFrame& frame);
  bool FindImpulses(const Settings& settings, StopImpulses::Reach reach, std::vector<Vector3>* impulses);
  bool IsBalanced(const Body& body, const Load& load, const Settings& settings) const;
  static double Imbalance(const Body& body, const Load& load);
  static void TrackStillness(const Body& body, const Settings& settings, double dt, Stillness* still);

  bool whole_;
  double worst_imbalance_ = 0;
  double share_ = 1;                        // of the fastest speed: who gives way in this attempt of the frame
  std::vector<int> roots_;                  // islands, per body
  std::vector<std::uint8_t> moves_;         // per root: at a wall that moves; it wakes
  std::vector<std::uint8_t> held_, rests_;  // per body: a contact holds it; it is or gets frozen
  std::vector<std::uint8_t> touched_;       // per body: by what moves
  std::vector<std::uint8_t> asks_;          // per root: impulses are to be found
  std::vector<Load> loads_;
  std::vector<Stop> stops_;
  // Of an island whose contacts are to hold its frozen bodies.
  StopImpulses stopping_;
  std::vector<std::pair<int, int>> collected_, holding_;  // by root: its bodies, the contacts that press
  std::vector<int> members_, contacts_;
  std::vector<StopImpulses::Momentum> wanted_;
  std::vector<double> limits_;
  std::vector<Vector3> stop_, balance_;
};

}  // namespace islet
