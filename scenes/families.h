// The functions that build the scenes, one per scene; what each builds is told in its .cpp and in scene.cpp's table.
#pragma once

#include "scenes/scene.h"

namespace islet {

// piles.cpp
BuiltScene BuildStack(const Scene& scene, const SceneParameters& parameters, const Settings& settings);
BuiltScene BuildCsStack(const Scene& scene, const SceneParameters& parameters, const Settings& settings);
BuiltScene BuildManyStacks(const Scene& scene, const SceneParameters& parameters, const Settings& settings);
// cubejam.cpp
BuiltScene BuildCubejam(const Scene& scene, const SceneParameters& parameters, const Settings& settings);
// hourglass.cpp
BuiltScene BuildCubeglass(const Scene& scene, const SceneParameters& parameters, const Settings& settings);
BuiltScene BuildCubeglass7(const Scene& scene, const SceneParameters& parameters, const Settings& settings);
BuiltScene BuildSphereglass(const Scene& scene, const SceneParameters& parameters, const Settings& settings);
// office_toy.cpp, balance.cpp, revival.cpp
BuiltScene BuildOfficeToy(const Scene& scene, const SceneParameters& parameters, const Settings& settings);
BuiltScene BuildBalance(const Scene& scene, const SceneParameters& parameters, const Settings& settings);
BuiltScene BuildRevival(const Scene& scene, const SceneParameters& parameters, const Settings& settings);

}  // namespace islet
