// Draws a world as a shaded picture (drawing.h): perspective view from the front, right and above; painter's
// algorithm.
//
//   - Moving bodies are coloured by the height at which they started, so that one sees how layers mix.
//   - Of fixed bodies only what faces the camera inside the scene's bounds is drawn: back walls and floor, not the
//   front
//     walls. Tilted ones (the funnel) are translucent.
//   - Bodies are sorted by depth as wholes: right for equal convex pieces that do not overlap, nearly right for others.
#pragma once

#include <vector>

#include "engine/world.h"
#include "scenes/drawing.h"
#include "scenes/scene.h"

namespace islet {

class Picture {
 public:
  Picture(const World& start, const SceneInfo& info);

  Drawing Draw(const World& world) const;

 private:
  Region Visible(const World& world) const;

  SceneInfo info_;
  std::vector<double> shade_;  // per body: its starting layer, 0 lowest to 1 highest
  Region start_;               // [m] around the moving bodies at the start
};

}  // namespace islet
