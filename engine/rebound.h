// Rebounds that come back within the step: a ball that bounces lower and lower (Zeno's ball), with no speed below which it
// is stopped.
//
// A body that leaves a contact at u0 and that its load a would bring back before the step of length h ends (2 u0 < a h) makes
// N = a h / (2 u0) bounces in it. The step keeps it where it is, and its energy: the static problem lets it end with the
// approach -u0, so that the trapezoidal rule moves it by (u0 - u0) h / 2 = 0 and its contact does no work. The collision of
// the next step pays for all N bounces. Between bounces the speed falls by (1 - e) u in the time 2 u / a, on a straight line
// in time, so
//   u1 = u0 - (1 - e) a h / 2 = e u0 - (1 - e) (a h - 2 u0) / 2 = e u0 - (1 - e) W j / 2
// where W j = a h - 2 u0 is what the contact's static impulse j changed: Newton's law less Contact::fading = (1 - e) W j / 2.
// If the body has turned to another corner by then, that one pays: a cube that wobbled from corner to corner never came to rest.
// It ends after 2 v / ((1 - e) a), which is the sum of the times of all bounces; with e = 1 it never ends.
// Only contacts that were approached rebound: one that opens since a ball rolls over a crest does not.
//   threads: pure functions; one BouncedMotion serves one caller at a time
//   allocation: none after warm-up
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "engine/body.h"
#include "engine/contact.h"
#include "engine/contact_suite.h"

namespace islet {

// Sets rebounds and fading of contacts, given those of the last step and the static impulses [N s] (n, t1, t2) that acted there, both
// in canonical order. What approaches more slowly than by 1e-9 of free_fall, the speed that gravity adds in a step [m/s], does so
// by rounding errors.
void SetRebounds(double free_fall, std::span<const Body> bodies, std::span<const Contact> last_contacts,
                 std::span<const Vector3> last_holding, std::span<Contact> contacts);

// [N s] what a static impulse exceeds that pushes the body: a solver's rounding.
double RoundingOf(const Vector3& gravity_W, double dt, const Body& body);
// [m/s] normal velocity of the contact before gravity and external force acted on its bodies for dt.
double SpeedBeforeForces(const Contact& contact, const Vector3& gravity_W, double dt, std::span<const Body> bodies);

// Velocity of a body that nothing pushed before gravity and external force acted on it for dt.
Twist BeforeForces(double dt, const Vector3& gravity_W, const Body& body);

// Where bodies bounce within the step.
class BouncedMotion {
 public:
  // Sets velocities before gravity of the bodies that end the step approaching on a contact which holds them. `before` comes from
  // the suite, which gives caught bodies their final velocities instead.
  void Restore(double dt, const Vector3& gravity_W, std::span<const Body> bodies, std::span<const Contact> contacts,
               std::span<const Vector3> holding, std::vector<Twist>* before);

  // Of the last Restore: the body bounced within the step, and its contacts did no work.
  bool Bounced(int body) const { return any_ && bounced_[body] == kBounced; }

 private:
  static constexpr std::uint8_t kBounced = 1, kGains = 2;

  bool any_ = false;
  std::vector<std::uint8_t> bounced_;  // per body, if any
  std::vector<Twist>
      earlier_;  // per body: before gravity and the static impulses, of those that bounced; now, of others
};

}  // namespace islet
