// The scenes: named worlds with a stated expected behaviour, used by the program `islet`, by tests and by benchmarks.
//
//   in:  a scene's name, parameters (count, seed, coefficients), engine settings     out: a World ready to step
//   defaults: unit cubes and spheres of diameter 1, mass 1 kg, friction 0.5, restitution 0.2, gravity 9.81 m/s^2 along -z;
//             a scene that differs says so in its file
//   errors: std::invalid_argument that names the parameter and its value, also if bodies overlap at the start
//   threads: building is a pure function of its arguments
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "engine/settings.h"
#include "engine/world.h"

namespace islet {

struct SceneParameters {                   // what is absent takes the scene's own default
  std::optional<int> count = {};           // of what Scene::counted names; 1 to kMaxSceneCount
  std::optional<std::uint64_t> seed = {};  // of the random placement; without effect in scenes that are not random
  std::optional<double> friction = {};     // of every body, in [0, 1e4]
  std::optional<double> restitution = {};  // of every body, in [0, 1]
  std::optional<double> drop = {};         // [m] stack, csstack, manystacks: gap left open below each body, in [0, 100]
  std::optional<double> angle =
      {};  // [rad] balance alone: how far off the vertical the upper sphere starts, in [-1, 1]
  std::optional<int> incoming = {};  // officetoy alone: how many of the spheres come flying in
};

inline constexpr int kMaxSceneCount = 1'000'000;

struct SceneInfo {                 // what is known about a scene once its parameters are
  int bodies = 0;                  // dynamic ones
  std::uint64_t seed = 0;          // that was used
  double smallest_size = 1;        // [m] smallest extent of a dynamic body: the unit of "penetration"
  std::optional<double> passed_z;  // [m] a body whose centre is lower has passed (the hourglass: its orifice)
  std::optional<Region> bounds;    // [m] a body whose centre is outside has escaped; none: nothing to escape from
};

struct BuiltScene {
  World world;
  SceneInfo info;
};

struct Scene {
  std::string_view name;
  int default_count;
  std::string_view counted;    // what the count counts: "cubes"
  bool count_changes;          // whether another count can be asked for
  double time_limit;           // [s] of simulated time, if the scene has not come to rest before
  std::uint64_t default_seed;  // 0 in scenes that are not random
  std::string_view summary;    // half a line
  std::string_view expected;   // what a right simulation shows
  BuiltScene (*build)(const Scene& scene, const SceneParameters& parameters, const Settings& settings);
};

std::span<const Scene> AllScenes();
const Scene* FindScene(std::string_view name);         // null if there is none of that name
std::string_view NearestScene(std::string_view name);  // the name that differs in the fewest letters

// Checks the parameters, builds, and checks that no bodies overlap.
BuiltScene BuildScene(const Scene& scene, const SceneParameters& parameters = {}, const Settings& settings = {});

}  // namespace islet
