// Sine, cosine and arc tangent with the same bits on every machine. Those of the C library differ in the last bit between
// processors that multiply and add with one rounding and those that do not, and between its versions.
//   errors: below 4e-16 (sine, cosine; of angles up to 1e5, beyond as if the angle were off by its rounding) and 1e-15 (arc tangent)
//           of the answer
//   threads: pure functions
#pragma once

namespace islet {

double Sine(double angle);    // [rad]; NaN for what is not finite
double Cosine(double angle);  // [rad]
double ArcTangent(double x);  // [rad] within +-pi/2
// [rad] of the point (x, y), within +-pi; 0 at the origin.
double ArcTangent(double y, double x);

}  // namespace islet
