// The flights of one step: bodies that no contact pushes while they move. Such a body follows its own path, and where it meets
// a wall it stops there, at that moment, with the velocity that it has at that moment: nothing of its energy is invented or
// lost. The time that is left to it then is told, so that its next flight can begin so much earlier. (Bodies that meet each
// other are parted by corrections: to stop both would cost a falling crowd more time than it has.)
//
//   path      x(s) = x0 + s v0 + s^2 a / 2, a the mean acceleration of the step; rotation by rotation.h; velocities to match
//   moment    Newton steps on the gap of the nearest contact, one for each detection: to 1e-5 of the overlap tolerance
//   threads: pure functions of what is given; one Flights serves one caller at a time
//   allocation: none after warm-up
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "engine/body.h"
#include "engine/contact.h"
#include "engine/contact_suite.h"

namespace islet {

class Flights {
 public:
  // durations: [s] per body, > 0. flies: per body, not 0 if no contact pushes it. before: velocities at the start; those of
  // the bodies are those at the end.
  void Begin(std::span<const double> durations, std::span<const std::uint8_t> flies, std::span<const Twist> before,
             std::span<const Body> bodies);

  bool flies(int body) const { return flies_[body] != 0; }
  // [s] that the body has not flown.
  double left(int body) const { return left_[body]; }
  bool AnyStopped() const;
  // Of a body with left() > 0: what it met, and the impulse [N s] on it that would have taken from it what its forces had given
  // it in the time left.
  const Contact& wall(int body) const { return walls_[body]; }
  Vector3 Missing(int body, double mass) const;

  // One Newton step for every flying body, from the gaps that all contacts have at the moments of left(). Round 0: they are
  // predicted, and contact.gap is the gap at the start. True if some body is to be placed anew; handled[c]: at that moment
  // contact c is open, or will be after the next steps; the others are left to corrections.
  bool FindMoments(int round, std::span<const Contact> contacts, std::span<const double> gaps,
                   std::span<const double> tolerances, std::span<const Body> bodies,
                   std::vector<std::uint8_t>* handled);

  // Pose and velocity at the body's moment.
  void Place(int body, Body* moved) const;
  // Someone else moves it from now on; what it has not flown stays told.
  void Ground(int body) { flies_[body] = 0; }

 private:
  struct Path {
    Vector3 position_W;  // [m]
    Quaternion rotation_WB;
    Twist begin, end;
    double duration = 0;  // [s]
  };
  Twist VelocityAt(int body) const;  // at its moment; angular: of the mean rule, good for predictions
  Vector3 PointVelocity(int body, const Contact& contact, const Body& now) const;

  std::vector<Path> paths_;
  std::vector<double> left_, wanted_;  // [s] per body
  std::vector<std::uint8_t> flies_;
  std::vector<Contact> walls_;  // per body: the contact that stopped it, if left() > 0
};

}  // namespace islet
