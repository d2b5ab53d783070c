// T16: a pyramid of light cubes with a heavy one inside.
#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "scenes/verify/builders.h"
#include "scenes/verify/load_measures.h"

namespace islet::verify {
namespace {

constexpr double kHeavy = 1e4;   // [kg] the one; the others weigh 1 kg
constexpr double kPitch = 1.02;  // [m] between centres: cubes of a layer do not touch
constexpr double kFriction = 0.5;

// Layers of n x n, (n-1) x (n-1), ... 1 unit cubes, each on the corners of four. A load can go straight down through the
// quarters that lie above each other, so the pyramid stands whatever one of its cubes weighs.
struct Pyramid {
  World world;
  int floor;
  std::vector<int> cubes;
};

Pyramid BuildPyramid(const Settings& settings, int base, int heavy_layer) {
  Pyramid pyramid{World(settings), 0, {}};
  pyramid.floor = pyramid.world.Add(Floor(kFriction));
  for (int layer = 0; layer < base; ++layer) {
    const int side = base - layer;
    for (int i = 0; i < side * side; ++i) {
      const double x = kPitch * (i % side - 0.5 * (side - 1)), y = kPitch * (i / side - 0.5 * (side - 1));
      const bool heavy = layer == heavy_layer && i == (side / 2) * side + side / 2;
      pyramid.cubes.push_back(pyramid.world.Add(Cube({x, y, 0.5 + layer}, kFriction, 0, heavy ? kHeavy : 1)));
    }
  }
  return pyramid;
}

}  // namespace

void MeasureHeavyInPile(const CheckSettings& settings, Measurements* out) {
  const int base = settings.quick ? 8 : 14;  // 204 or 1015 cubes
  Pyramid pyramid = BuildPyramid(settings.engine, base, base / 2);
  World& world = pyramid.world;
  const std::vector<Body> start(world.bodies().begin(), world.bodies().end());
  const double weight = Weight(world);
  const int frames = Frames(settings.quick ? 0.5 : 0.25, settings.dt);
  double load = 0, balance = 0, overlap = 0, travel = 0;
  for (int frame = 0; frame < frames; ++frame) {
    const Vector3 before = Momentum(world);
    world.Step(settings.dt);
    const double floor_load = -ImpulseOn(world, pyramid.floor).z() / settings.dt;
    const Vector3 unexplained =
        Momentum(world) - before + Vector3(0, 0, weight * settings.dt) + ImpulseOn(world, pyramid.floor);
    load = std::max(load, std::abs(floor_load / weight - 1));
    balance = std::max(balance, unexplained.norm() / (weight * settings.dt));
    for (const Contact& c : world.contacts()) overlap = std::max(overlap, -c.gap);
    for (const int cube : pyramid.cubes)
      travel = std::max(travel, Travel(world.shape(cube), start[cube], world.body(cube)));
  }
  const std::string name =
      ", " + std::to_string(pyramid.cubes.size()) + " cubes, " + std::to_string(frames) + " frames";
  const bool frozen =
      std::all_of(pyramid.cubes.begin(), pyramid.cubes.end(), [&](int cube) { return world.body(cube).frozen; });
  if (settings.engine.freezing == Freezing::kCertified) out->Verdict("all frozen at the end" + name, true, frozen);
  out->AtMost("load on the floor" + name, "of the weight", load, 1e-6);
  out->AtMost("momentum that no impulse explains" + name, "weight x dt", balance,
              settings.engine.freezing == Freezing::kOff ? 1e-12 : 1e-6);
  out->AtMost("deepest overlap" + name, "side", overlap, 1e-6);
  out->AtMost("farthest travel of a corner" + name, "m", travel, 1e-6);
}

}  // namespace islet::verify
