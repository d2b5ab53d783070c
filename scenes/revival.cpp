// revival: a row of touching cubes rests on the floor and freezes; after half a second a rolling ball hits its end. The
// blow has to wake the whole row in one frame, one body after the other.                            [SM04 Sec. 5.2,
// Fig. 5]
#include "scenes/families.h"
#include "scenes/scene_builder.h"

namespace islet {

BuiltScene BuildRevival(const Scene& scene, const SceneParameters& parameters, const Settings& settings) {
  constexpr double kSpeed = 6;      // [m/s] of the ball
  constexpr double kArrival = 0.5;  // [s]
  constexpr double kRadius = 0.5;   // [m]
  SceneBuilder builder(scene, parameters, settings);
  builder.AddFloor();
  for (int i = 0; i < builder.count(); ++i) builder.AddCube({static_cast<double>(i), 0, 0.5});
  // Spinning so that it rolls without slipping from the first moment.
  builder.AddSphere({-0.5 - kRadius - kSpeed * kArrival, 0, kRadius}, {kSpeed, 0, 0}, {0, kSpeed / kRadius, 0});
  return builder.Finish();
}

}  // namespace islet
