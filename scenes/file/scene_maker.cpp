#include "scenes/file/scene_maker.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

#include "scenes/file/number_format.h"
#include "scenes/file/placing.h"
#include "scenes/nearest_name.h"
#include "scenes/random.h"

namespace islet {
namespace {

std::string Called(const BodyEntry& entry) { return entry.name.empty() ? "" : " (\"" + entry.name + "\")"; }

// The engine names bodies by their numbers; this names their places in the file.
void RequireNoOverlap(World* world, const std::vector<int>& entry_of, const std::vector<BodyEntry>& entries) {
  try {
    world->CheckInitialOverlap();
  } catch (const std::invalid_argument& error) {
    for (const Contact& c : world->contacts()) {
      const double size = std::min(world->shape(c.body_a).size(), world->shape(c.body_b).size());
      if (-c.gap <= world->settings().touch_gap * size) continue;
      const BodyEntry &a = entries[entry_of[c.body_a]], &b = entries[entry_of[c.body_b]];
      b.place.Refuse("body " + std::to_string(c.body_b) + Called(b) + " of the scene overlaps body " +
                     std::to_string(c.body_a) + Called(a) + " by " + ShortNumber(-c.gap) + " m at the start");
    }
    throw;
  }
}

}  // namespace

MadeScene MakeScene(const SceneDescription& description, const Settings& settings, std::uint64_t seed) {
  std::vector<BodyDefinition> bodies;
  std::vector<int> entry_of;
  for (size_t e = 0; e < description.bodies.size(); ++e) {
    const BodyEntry& entry = description.bodies[e];
    // A stream of its own for each cloud: another one before it changes nothing.
    for (const Pose& pose : PosesOf(entry, SplitMix64(seed + e).Next())) {
      bodies.push_back(entry.definition);
      bodies.back().position_W = pose.position_W;
      bodies.back().rotation_WB = pose.rotation_WB;
      entry_of.push_back(static_cast<int>(e));
    }
  }
  RequireRoom(bodies, entry_of, description.bodies);

  MadeScene made{World(settings), {}, {}};
  made.info.seed = seed;
  made.info.bounds = description.bounds;
  made.info.passed_z = description.passed_z;
  double smallest = std::numeric_limits<double>::infinity();
  for (size_t i = 0; i < bodies.size(); ++i) {
    const BodyEntry& entry = description.bodies[entry_of[i]];
    try {
      const int number = made.world.Add(bodies[i]);
      if (!entry.surface_velocity_B.isZero(0)) made.world.SetSurfaceVelocity(number, entry.surface_velocity_B);
      if (!entry.force_W.isZero(0) || !entry.torque_W.isZero(0))
        made.world.SetForce(number, entry.force_W, entry.torque_W);
      if (!entry.name.empty()) made.named[entry.name].push_back(number);
    } catch (const std::invalid_argument& error) {
      entry.place.Refuse(error.what());
    }
    if (bodies[i].kind != BodyKind::kDynamic) continue;
    ++made.info.bodies;
    smallest = std::min(smallest, bodies[i].shape.size());
  }
  if (std::isfinite(smallest)) made.info.smallest_size = smallest;
  RequireNoOverlap(&made.world, entry_of, description.bodies);
  return made;
}

std::vector<int> ChosenBodies(const MadeScene& made, const BodyChoice& choice) {
  const int all = static_cast<int>(made.world.bodies().size());
  if (choice.name.empty()) {
    if (choice.number >= all) choice.place.Fail("the scene has only " + std::to_string(all) + " bodies");
    return {choice.number};
  }
  const auto found = made.named.find(choice.name);
  if (found == made.named.end()) {
    std::vector<const char*> names;
    for (const auto& [name, bodies] : made.named) names.push_back(name.c_str());
    const std::string_view nearest = NearestName(choice.name, names);
    choice.place.Fail("there is no body of that name" +
                      (nearest.empty() ? "" : "; did you mean \"" + std::string(nearest) + "\"?"));
  }
  if (choice.number < 0) return found->second;
  if (choice.number >= static_cast<int>(found->second.size()))
    choice.place.Fail("there are only " + std::to_string(found->second.size()) + " bodies of that name");
  return {found->second[choice.number]};
}

}  // namespace islet
