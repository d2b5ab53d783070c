// T27 on a pile of 1,000 frozen cubes that is hit, and T44: 1,000 cubes at rest for ten minutes.
#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "scenes/random.h"
#include "scenes/verify/builders.h"
#include "scenes/verify/freezing_checks.h"

namespace islet::verify {
namespace {

constexpr int kLater = 15;       // steps after a blow
constexpr double kPitch = 1.04;  // [m] between the cubes of a layer: they do not touch

// Square layers of cubes, each cube on four of the layer below: 14 layers are 1,015 cubes.
void AddPyramid(int layers, World* world) {
  for (int layer = 0; layer < layers; ++layer) {
    const int side = layers - layer;
    for (int i = 0; i < side; ++i)
      for (int j = 0; j < side; ++j)
        world->Add(Cube({kPitch * (i - 0.5 * (side - 1)), kPitch * (j - 0.5 * (side - 1)), layer + 0.5}));
  }
}

double LoadOnFloor(const World& world, double dt) { return -ImpulseOn(world, 0).z() / dt; }  // [N]

double Farthest(const World& world, const std::vector<Body>& start) {  // [m]
  double farthest = 0;
  for (size_t i = 0; i < start.size(); ++i)
    if (start[i].kind == BodyKind::kDynamic)
      farthest = std::max(farthest, Travel(world.shape(static_cast<int>(i)), start[i], world.bodies()[i]));
  return farthest;
}

// The loads inside of such a pile are not determined, and with them the friction on what slides in it: velocities in two right
// answers differ by up to mu g h times the cubes above. Compared is who moves.
//
// A ball of 20 kg that hits the middle cube of a side of the pyramid at 10 m/s, where it touches. Ten stacks stand beside.
struct Hit {
  std::vector<Body> at_hit;         // after the step in which it hits
  std::vector<Body> later;          // kLater steps later
  std::vector<std::uint8_t> woken;  // per body: in the step of the hit, and until later
  std::vector<std::uint8_t> woken_later;
  size_t pyramid_end = 0;  // number of the first cube of the stacks
  double load = 0;         // [N] on the floor just before
};

Hit HitPile(int layers, Freezing freezing, const CheckSettings& s) {
  Settings settings = s.engine;
  settings.freezing = freezing;
  World world(settings);
  world.Add(Floor());
  AddPyramid(layers, &world);
  Hit hit;
  hit.pyramid_end = world.bodies().size();
  for (int i = 0; i < 10; ++i)
    for (int level = 0; level < 5; ++level) world.Add(Cube({50 + 2.0 * i, 0, level + 0.5}));
  StepTimes(&world, Frames(0.3, s.dt), s.dt);
  hit.load = LoadOnFloor(world, s.dt);
  const int layer = layers / 2, side = layers - layer;
  BodyDefinition ball =
      Ball({-kPitch * 0.5 * (side - 1) - 1, 0.5 * kPitch * (side % 2 == 0), layer + 0.5}, 0.5, 0.5, 0, 20);
  ball.linear_velocity_W = {10, 0, 0};
  world.Add(ball);
  const auto mark = [&](std::vector<std::uint8_t>* woken) {
    woken->resize(world.bodies().size());
    for (size_t i = 0; i < woken->size(); ++i) (*woken)[i] |= !world.bodies()[i].frozen;
  };
  world.Step(s.dt);
  mark(&hit.woken);
  hit.at_hit.assign(world.bodies().begin(), world.bodies().end());
  hit.woken_later = hit.woken;
  for (int frame = 0; frame < kLater; ++frame) {
    world.Step(s.dt);
    mark(&hit.woken_later);
  }
  hit.later.assign(world.bodies().begin(), world.bodies().end());
  return hit;
}

}  // namespace

void MeasurePileImpact(const CheckSettings& s, Measurements* out) {
  constexpr double kMoves = 3e-4;  // [m/s] of 10 m/s: slower is what the tolerance of two problems a step leaves
  const int layers = s.quick ? 8 : 14;
  const Hit hit = HitPile(layers, s.engine.freezing, s), never = HitPile(layers, Freezing::kOff, s);
  const std::string name = "pile of " + std::to_string(hit.pyramid_end - 1) + " hit: ";
  int asleep = 0, idle = 0, woken = 0, moved = 0, beside = 0, asleep_later = 0;
  for (size_t i = 1; i + 1 < hit.woken.size(); ++i) {
    const double speed = FastestPointOf(never.at_hit[i]);
    asleep += !hit.woken[i] && speed > kMoves;
    idle += speed < kMoves && FastestPointOf(hit.at_hit[i]) > kMoves;
    woken += hit.woken_later[i];
    moved += (never.later[i].position_W - never.at_hit[i].position_W).norm() > 1e-3;
    asleep_later += !hit.woken_later[i] && (never.later[i].position_W - hit.later[i].position_W).norm() > 1e-2;
    beside += hit.woken_later[i] && i >= hit.pyramid_end;
  }
  const double weight = kGravity * static_cast<double>(hit.woken.size() - 2);
  out->Relative(name + "load on the floor before", "N", weight, hit.load, 1e-5);
  out->Absolute(name + "cubes that would move and stay frozen", "", 0, asleep, 0);
  out->Absolute(name + "of those, within 15 steps", "", 0, asleep_later, 0);
  if (s.engine.freezing == Freezing::kOff) return;
  out->Absolute(name + "cubes that move and would not", "", 0, idle, 0);
  out->Absolute(name + "cubes beside it that wake", "", 0, beside, 0);
  out->AtMost(
      name + "cubes that wake within 15 steps, of those that move", "", woken / std::max(1.0, 1.0 * moved), 2,
      "beside a body at 10 m/s the solver's tolerance leaves up to 1e-4 m/s, also if nothing is ever frozen: more than "
      "a frozen body may have");
  out->Open();
}

void MeasureRest(const CheckSettings& s, Measurements* out) {
  World world(s.engine);
  world.Add(Floor());
  AddPyramid(s.quick ? 6 : 14, &world);
  StepTimes(&world, Frames(0.5, s.dt), s.dt);
  const std::vector<Body> start(world.bodies().begin(), world.bodies().end());
  // Awake, a second of 1,000 cubes takes several to compute.
  const bool off = s.engine.freezing != Freezing::kCertified;
  const double whole = 600 * std::min(1.0, 60 * s.dt);  // as many frames with a shorter step: a quarter of the time
  const double seconds = off ? 5 : s.quick ? 60 : whole;
  const std::string name =
      std::to_string(start.size() - 1) + " cubes, " + std::to_string(static_cast<int>(seconds)) + " s: ";
  int woken = 0;
  double load = 0;
  const int frames = Frames(seconds, s.dt);
  for (int frame = 0; frame < frames; ++frame) {
    woken += world.Step(s.dt).woken;
    if (frame % 60 == 0) load = std::max(load, std::abs(LoadOnFloor(world, s.dt) / Weight(world) - 1));
  }
  // Awake, the solver may leave each step its tolerance times g h. Frozen, nothing moves by a bit; what moved did so before.
  const double creep = off ? s.engine.tolerance * kGravity * s.dt * seconds : 1e-9;
  out->AtMost(name + "farthest that a corner moved", "m", Farthest(world, start), creep);
  out->Absolute(name + "wakes", "", 0, woken, 0);
  out->AtMost(name + "kinetic energy, per kg", "J", KineticEnergy(world) / static_cast<double>(start.size() - 1),
              1e-12);
  out->AtMost(name + "error of the load on the floor", "", load, 1e-5);
  if (!off) out->Verdict(name + "all are frozen", true, AllFrozen(world));
}

}  // namespace islet::verify
