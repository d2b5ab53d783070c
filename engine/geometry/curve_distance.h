// Where two curves come nearest: a line, a circle. What a curved shape meets with is one of these, or a face, or a point.
//
//   frames: any, the same for both    units: m    threads: pure functions
#pragma once

#include <array>

#include "engine/linear_algebra.h"

namespace islet {

struct Line {
  Vector3 from, way;  // [m]; the line goes on beyond both ends
};

struct Circle {
  Vector3 centre, axis;  // axis: unit
  double radius;
};

// Up to two places, as points of the one and of the other curve and the unit tangents there.
struct CurvePlace {
  Vector3 on_p = Vector3::Zero(), on_q = Vector3::Zero(), tangent_p = Vector3::Zero(), tangent_q = Vector3::Zero();
};
struct CurvePlaces {
  int count = 0;
  std::array<CurvePlace, 4> place = {};
};

// Nearest points of two lines; none if they are parallel.
CurvePlaces NearestOfLines(const Line& p, const Line& q);
// The places where the distance of a circle from a line, and of two circles, is least near by; found to round-off.
CurvePlaces NearestOfCircleAndLine(const Circle& p, const Line& q);
CurvePlaces NearestOfCircles(const Circle& p, const Circle& q);

// The point of a circle that lies farthest along a direction; `fallback`, a unit vector in its plane, where all lie as far.
Vector3 FarthestOnCircle(const Circle& circle, const Vector3& direction, const Vector3& fallback);

}  // namespace islet
