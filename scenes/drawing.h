// A flat picture, ready to be written: polygons and balls in the order in which they are painted.
//
//   units: px, x to the right, y down    threads: pure functions
#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

namespace islet {

using Colour = Eigen::Array3d;  // red, green, blue; what is outside of [0, 1] is cut there

struct Mark {
  std::vector<Eigen::Vector2d> outline;  // of a polygon; of a ball: its centre alone
  Colour colour{0, 0, 0};
  double opacity = 1;
  double radius = 0;  // of a ball, else 0
};

struct Drawing {
  Eigen::Vector2d size{0, 0};
  std::vector<Mark> marks;
};

// How all marks are painted.
namespace paint {
constexpr unsigned kPaper = 0xfbfaf7, kInk = 0x23222a;  // red, green, blue
constexpr double kInkOpacity = 0.45, kInkWidth = 0.8;   // of outlines
// A ball's light: a radial gradient about a point of its square, with a radius in sides of that.
constexpr double kLightX = 0.36, kLightY = 0.3, kLightRadius = 0.75, kLightMiddle = 0.55;
inline Colour Bright(const Colour& colour) { return colour * 0.75 + 0.3; }
inline Colour Middle(const Colour& colour) { return colour * 0.95; }
inline Colour Dark(const Colour& colour) { return colour * 0.5; }
}  // namespace paint

std::string Svg(const Drawing& drawing);

}  // namespace islet
