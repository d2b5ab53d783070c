// T39: a block of cubes, turned at random, falls onto a rough plate and becomes a heap. Its slope has no formula; it must be
// the same for any time step, within its scatter, and must not go on sinking.
#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>
#include <vector>

#include "scenes/random.h"
#include "scenes/verify/builders.h"
#include "scenes/verify/structure_measures.h"

namespace islet::verify {
namespace {

constexpr double kFriction = 0.6;
struct Heap {
  double slope = 0;  // [degrees]
  double sinks = 0;  // [m] of the centre of mass in the last second
};

// A cone of height H and radius R, filled evenly: mean height H / 4, mean distance from the axis R / 2, so that the slope is
// H / R = 2 mean height / mean distance. The plate is the height 0, and the axis goes through the centre of mass.
Heap PourHeap(const CheckSettings& settings, double dt, double seconds, int layers, std::uint64_t seed) {
  World world(settings.engine);
  world.Add(Floor(kFriction));
  SplitMix64 random(seed);
  std::vector<int> cubes;
  for (int i = 0; i < 9 * layers; ++i) {
    const Vector3 place(1.75 * (i % 3 - 1), 1.75 * (i / 3 % 3 - 1), 1 + 1.75 * (i / 9));
    BodyDefinition cube = Cube(place, kFriction);
    cube.rotation_WB = random.Rotation(std::numbers::pi);
    cubes.push_back(world.Add(cube));
  }
  const auto centre = [&] {
    Vector3 sum = Vector3::Zero();
    for (const int cube : cubes) sum += world.body(cube).position_W;
    return Vector3(sum / static_cast<double>(cubes.size()));
  };
  StepTimes(&world, Frames(seconds - 1, dt), dt);
  const double before = centre().z();
  StepTimes(&world, Frames(1, dt), dt);
  const Vector3 middle = centre();
  double distance = 0;
  for (const int cube : cubes)
    distance += (world.body(cube).position_W - middle).head<2>().norm() / static_cast<double>(cubes.size());
  return {std::atan(2 * middle.z() / distance) * 180 / std::numbers::pi, before - middle.z()};
}

struct Statistic {
  double mean = 0, deviation = 0;  // of one heap
  double sinks = 0;                // [m] the most
};

Statistic PourHeaps(const CheckSettings& settings, double dt, double seconds, int layers, int heaps) {
  Statistic s;
  std::vector<double> slopes;
  for (int i = 0; i < heaps; ++i) {
    const Heap heap = PourHeap(settings, dt, seconds, layers, 39 + i);
    slopes.push_back(heap.slope);
    s.mean += heap.slope / heaps;
    s.sinks = std::max(s.sinks, heap.sinks);
  }
  for (const double slope : slopes) s.deviation += std::pow(slope - s.mean, 2) / (heaps - 1);
  s.deviation = std::sqrt(s.deviation);
  return s;
}

}  // namespace

void MeasureHeap(const CheckSettings& settings, Measurements* out) {
  const int layers = settings.quick ? 3 : 6, heaps = settings.quick ? 2 : 4;
  const double seconds = settings.quick ? 2.5 : 8;
  const Statistic fine = PourHeaps(settings, settings.dt, seconds, layers, heaps);
  const Statistic coarse = PourHeaps(settings, 2 * settings.dt, seconds, layers, heaps);
  const double error = std::hypot(coarse.deviation, fine.deviation) / std::sqrt(heaps);
  const std::string name = ", " + std::to_string(heaps) + " heaps of " + std::to_string(9 * layers) + " cubes";
  out->Absolute("slope against that at twice the step" + name, "degrees", coarse.mean, fine.mean,
                std::min(3 * error, 10.0), "three standard errors of the difference, 10 degrees at most");
  // In the quick run cubes still tumble when it ends.
  if (!settings.quick) out->AtMost("centre of mass sinks in the last second" + name, "side", fine.sinks, 1e-3);
}

}  // namespace islet::verify
