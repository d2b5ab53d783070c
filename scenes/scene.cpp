#include "scenes/scene.h"

#include <algorithm>
#include <array>
#include <stdexcept>

#include "engine/number_text.h"
#include "scenes/families.h"
#include "scenes/nearest_name.h"

namespace islet {
namespace {

constexpr std::array<Scene, 10> kScenes{{
    {"stack", 10, "cubes", true, 10, 0, "a tower of cubes, built at rest",
     "The tower stands: no cube moves by more than a millimetre, and all freeze.", BuildStack},
    {"cubejam", 100, "cubes", true, 15, 7, "cubes fall past three beams and a block into a container",
     "All cubes come to rest in the container, some on the beams; none escapes.", BuildCubejam},
    {"csstack", 10, "bodies", true, 10, 11, "a tower of cubes and spheres in turn, up to 1 mm off the axis",
     "The tower stands for a moment, then falls within two seconds; freezing must not hold it up.", BuildCsStack},
    {"cubeglass", 1000, "cubes", true, 20, 20051, "cubes through a funnel with an orifice 10 wide: the hourglass",
     "At least 95 % of the cubes pass the orifice and settle below it; none escapes.", BuildCubeglass},
    {"cubeglass7", 1000, "cubes", true, 40, 20051, "the narrow hourglass, orifice 7 wide",
     "The cubes wedge in the funnel: an accurate solver lets only some of them through; none escapes.",
     BuildCubeglass7},
    {"sphereglass", 1000, "spheres", true, 20, 20051, "frictionless spheres in the wide hourglass",
     "All spheres pass the orifice; none escapes.", BuildSphereglass},
    {"officetoy", 5, "spheres", true, 2, 0, "a row of touching spheres hit by some of them, weightless",
     "As many spheres as came in leave at the other end with the incoming speed; the others stand still.",
     BuildOfficeToy},
    {"balance", 1, "sphere", false, 5, 0, "a sphere on a fixed sphere, a little off the vertical",
     "The upper sphere rolls off.", BuildBalance},
    {"revival", 4, "cubes", true, 8, 0, "a row of frozen cubes hit by a rolling ball",
     "The row freezes, and all of it wakes in the frame in which the ball hits it.", BuildRevival},
    {"manystacks", 100, "stacks", true, 10, 0, "separate towers of five cubes, one island each",
     "Every tower stands; the work spreads over all threads.", BuildManyStacks},
}};

std::string TextOf(int value) { return std::to_string(value); }
std::string TextOf(double value) { return Text(value); }

template <typename T>
void Require(bool good, const char* field, const std::optional<T>& value, const char* rule) {
  if (value && !good) throw std::invalid_argument(std::string(field) + ": " + rule + ", got " + TextOf(*value));
}

// NaN is in no range.
template <typename T>
void RequireRange(const char* field, const std::optional<T>& value, T least, T most, const char* rule) {
  Require(value >= least && value <= most, field, value, rule);
}

void Check(const Scene& scene, const SceneParameters& p) {
  const bool piled = scene.name == "stack" || scene.name == "csstack" || scene.name == "manystacks";
  RequireRange("count", p.count, 1, kMaxSceneCount, "must be from 1 to 1000000");
  Require(scene.count_changes || p.count == scene.default_count, "count", p.count,
          "this scene has always the same number of bodies");
  RequireRange("friction", p.friction, 0.0, 1e4, "must be in [0, 1e4]");
  RequireRange("restitution", p.restitution, 0.0, 1.0, "must be in [0, 1]");
  Require(piled, "drop", p.drop, "only the scenes stack, csstack and manystacks have one");
  RequireRange("drop", p.drop, 0.0, 100.0, "must be in [0, 100] m");
  Require(scene.name == "balance", "angle", p.angle, "only the scene balance has one");
  RequireRange("angle", p.angle, -1.0, 1.0, "must be in [-1, 1] rad");
  Require(scene.name == "officetoy", "incoming", p.incoming, "only the scene officetoy has them");
}

}  // namespace

std::span<const Scene> AllScenes() { return kScenes; }

const Scene* FindScene(std::string_view name) {
  const auto found = std::find_if(kScenes.begin(), kScenes.end(), [&](const Scene& s) { return s.name == name; });
  return found == kScenes.end() ? nullptr : &*found;
}

std::string_view NearestScene(std::string_view name) {
  return std::min_element(
             kScenes.begin(), kScenes.end(),
             [&](const Scene& a, const Scene& b) { return EditDistance(a.name, name) < EditDistance(b.name, name); })
      ->name;
}

BuiltScene BuildScene(const Scene& scene, const SceneParameters& parameters, const Settings& settings) {
  Check(scene, parameters);
  BuiltScene built = scene.build(scene, parameters, settings);
  built.world.CheckInitialOverlap();
  return built;
}

}  // namespace islet
