// The impulses that take what is left of an island's momentum, or balance what acts on it: those that change least what its contacts
// press with (qp/newton/least_change.h). So it stands still by impulses and not by decree.
//
//   units: SI    threads: one caller at a time, idle workers help    allocation: only while islands grow
#pragma once

#include <span>
#include <vector>

#include "engine/response/suite_frame.h"
#include "qp/newton/least_change.h"
#include "qp/problem.h"

namespace islet {

class StopImpulses {
 public:
  using Reach = qp::LeastChange::Reach;
  using Momentum = qp::Vector6;  // [N s] linear; angular about the centre over the radius

  // An island of the frame: its bodies, ascending, and the contacts that hold them with frame.holding.
  void Prepare(const SuiteFrame& frame, std::span<const int> bodies, std::span<const int> contacts);
  // wanted: per body of it. limits: [N s] the same: what may be missed. outside: of an impulse, how far with what holds it may lie outside its
  // cone. impulses: [N s] per contact of it, (n, t1, t2). Returns whether every body misses less than its limit; if not,
  // they are zero.
  bool Find(std::span<const Momentum> wanted, std::span<const double> limits, double outside, Reach reach,
            std::vector<Vector3>* impulses);
  // Per body of it, of its limit: what the last Find missed.
  const std::vector<double>& missed() const { return least_.missed(); }
  // Per body of it, in no unit: how fast it gives way where the last Find found nothing.
  const std::vector<double>& speeds();

 private:
  qp::Problem problem_;  // angular velocities times the radius
  qp::LeastChange least_;
  std::vector<Vector3> holding_;
  std::vector<double> wanted_, limits_, speeds_;
};

}  // namespace islet
