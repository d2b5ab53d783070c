// What began, went on and ended between bodies in a step, and what hit.
#pragma once

#include <cstdint>

#include "engine/linear_algebra.h"

namespace islet {

// What became of a contact of two bodies in a step.
enum class ContactEventKind : std::uint8_t {
  kBegin,    // touches at the end of the step, and did not at its start
  kPersist,  // touches at both
  kEnd,      // touched at its start, and does not at its end
};

// Two bodies that touch after a step, or did before it.
struct ContactEvent {
  ContactEventKind kind;  // began, went on or ended
  int body_a, body_b;     // a < b
  bool sensor = false;    // one of them is a sensor: they overlap, or did on the way of the step, and neither feels it
};

// What bounced or landed in a step, once a pair. Approaches slower than gravity makes anything in a step are told of only where a blow of
// more than the lighter body's weight came of them.
struct HitEvent {
  int body_a, body_b;                   // a < b
  Vector3 point_W = Vector3::Zero();    // [m]
  Vector3 impulse_W = Vector3::Zero();  // [N s] on body_b: all that the pair's points gave in the step
  // [m/s] at which they closed as the step began. 0: they did not, as where a blow is handed on within the step; the impulse tells of that.
  double approach = 0;
};

}  // namespace islet
