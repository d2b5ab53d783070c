// What the files of the friction family share: the measurements behind T1 to T6, T18, T19 and T23, and
// a search for thresholds.
#pragma once

#include <numbers>

#include "engine/world.h"
#include "scenes/verify/check.h"

namespace islet::verify {

void MeasureCreep(const CheckSettings& settings, Measurements* out);          // T1
void MeasureInclineSlide(const CheckSettings& settings, Measurements* out);   // T2
void MeasureThreshold(const CheckSettings& settings, Measurements* out);      // T3
void MeasureStop(const CheckSettings& settings, Measurements* out);           // T4
void MeasureLiftOff(const CheckSettings& settings, Measurements* out);        // T5
void MeasureObliqueBounce(const CheckSettings& settings, Measurements* out);  // T6
void MeasureLeaningCards(const CheckSettings& settings, Measurements* out);   // T18
void MeasureTipping(const CheckSettings& settings, Measurements* out);        // T19
void MeasureWedge(const CheckSettings& settings, Measurements* out);          // T23

// Where in [lower, upper] `before` changes from true to false, to 1e-8 of it; an end of the range if it does not change there.
template <typename Before>
double Boundary(double lower, double upper, Before before) {
  if (!before(lower)) return lower;
  if (before(upper)) return upper;
  while (upper - lower > 1e-8 * upper) {
    const double middle = 0.5 * (lower + upper);
    (before(middle) ? lower : upper) = middle;
  }
  return 0.5 * (lower + upper);
}

// A box of 1 kg that lies on Floor(.., incline), its centre above the origin.
BodyDefinition BoxOnIncline(const Vector3& half_extents, double incline, double friction);

// A probe for a threshold takes so long: no freezing, whatever its rule, has set in.
inline constexpr int kProbeFrames = 3;

// [m] how far the contact problems' tolerance lets a point drift along a normal in so many seconds: each frame may leave it
// tolerance x g dt of speed, and what adds up to less than the overlap tolerance nothing takes back.
double ToleratedDrift(const CheckSettings& settings, double seconds);

// How far off a threshold a probe may find it: it calls moving what is ten times faster than the tolerance lets a point at
// rest be, after kProbeFrames of the part of the excess that moves the body, in these scenes a sixth of g or more.
double ToleratedThreshold(const CheckSettings& settings);

// Whether it has begun to move: faster than what the contact problems' tolerance lets pass under this load [m/s^2], with room
// for what is far from its contacts. See ToleratedThreshold.
bool Moves(const World& world, int body, double acceleration, double dt);

inline double Radians(double degrees) { return degrees * std::numbers::pi / 180; }

// [m] farthest that a lower corner of the body's bounding box is from the plane in which its foot began.
double FootDrift(const World& world, int body, const Body& start);

}  // namespace islet::verify
