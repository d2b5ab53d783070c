// balance: a sphere on top of a fixed sphere, a little off the vertical. Unstable: it has to roll off, however slow it
// is at first (freezing that only looks at speed holds it there for good).                      [SM04 Sec. 5.2, Fig. 4]
#include "qp/elementary.h"
#include "scenes/families.h"
#include "scenes/scene_builder.h"

namespace islet {

BuiltScene BuildBalance(const Scene& scene, const SceneParameters& parameters, const Settings& settings) {
  const double angle = parameters.angle.value_or(0.01);
  SceneBuilder builder(scene, parameters, settings);
  builder.AddFloor();
  builder.AddFixedSphere({0, 0, 0.5});
  builder.AddSphere({Sine(angle), 0, 0.5 + Cosine(angle)});
  builder.info().passed_z = 1;  // the top of the fixed sphere: who is lower has rolled off
  return builder.Finish();
}

}  // namespace islet
