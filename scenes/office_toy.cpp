// officetoy: Newton's cradle without its strings. A row of touching spheres, the first of which fly in along x at 1
// m/s; no gravity, no friction, restitution 1.                                                           [SM04 Sec. 4,
// Fig. 3]
#include <stdexcept>
#include <string>

#include "scenes/families.h"
#include "scenes/scene_builder.h"

namespace islet {

BuiltScene BuildOfficeToy(const Scene& scene, const SceneParameters& parameters, const Settings& settings) {
  constexpr double kSpeed = 1;  // [m/s]
  constexpr double kGap = 0.1;  // [m] from the incoming spheres to the row
  Settings weightless = settings;
  weightless.gravity = Vector3::Zero();
  SceneBuilder builder(scene, parameters, weightless, /*default_friction=*/0, /*default_restitution=*/1);

  const int incoming = parameters.incoming.value_or(1);
  if (incoming < 1 || incoming >= builder.count()) {
    throw std::invalid_argument("incoming: must be at least 1 and less than count (" + std::to_string(builder.count()) +
                                "), got " + std::to_string(incoming));
  }
  for (int i = 0; i < builder.count(); ++i) {
    if (i < incoming) {
      builder.AddSphere({i - kGap, 0, 0}, {kSpeed, 0, 0});
    } else {
      builder.AddSphere({static_cast<double>(i), 0, 0});
    }
  }
  return builder.Finish();
}

}  // namespace islet
