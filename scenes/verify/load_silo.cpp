// T40: a square silo of spheres. Base and walls together carry the weight, exactly; how much the base carries follows
// Janssen's law once the walls' friction is mobilised, which a floor that sinks slowly does.
//
// A slice of height dz and area a^2: d sigma / dz = rho g - (4 / a) mu K sigma, so the base carries
//   sigma a^2 = rho g a^2 l (1 - exp(-H / l)) = W (l / H)(1 - exp(-H / l)),   l = a / (4 mu K)
// mu K is the mean ratio of the walls' shear to the vertical stress; K lies between Rankine's active value (1 - sin f) /
// (1 + sin f), f = atan mu, and 1.                      Janssen, Z. VDI 39 (1895); Sperl, Granular Matter 8 (2006)
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <string>
#include <vector>

#include "scenes/random.h"
#include "scenes/verify/builders.h"
#include "scenes/verify/load_measures.h"

namespace islet::verify {
namespace {

constexpr double kSide = 4;        // [m] inner width a; spheres have 0.8 to 1 m
constexpr double kFriction = 0.5;  // of all contacts
constexpr double kSink = 0.1;      // [m/s] of the floor

struct Silo {
  World world;
  int base;
  std::array<int, 4> walls;
  std::vector<int> grains;
};

Silo BuildSilo(const Settings& settings, int layers) {
  Silo silo{World(settings), 0, {}, {}};
  World& world = silo.world;
  silo.base = world.Add({.shape = Shape::Box({3 * kSide, 3 * kSide, 1}),
                         .kind = BodyKind::kKinematic,
                         .position_W = {0, 0, -1},
                         .friction = kFriction,
                         .restitution = 0});
  for (int k = 0; k < 4; ++k) {
    const Quaternion turn = Turn(k * 0.5 * std::numbers::pi, Vector3::UnitZ());
    silo.walls[k] = world.Add({.shape = Shape::Box({0.5, kSide, 100}),
                               .kind = BodyKind::kFixed,
                               .position_W = turn * Vector3(0.5 * kSide + 0.5, 0, 99),
                               .rotation_WB = turn,
                               .friction = kFriction,
                               .restitution = 0});
  }
  SplitMix64 random(40);
  for (int i = 0; i < 9 * layers; ++i) {
    const double radius = random.Uniform(0.4, 0.5);
    const Vector3 place(1.25 * (i % 3 - 1), 1.25 * (i / 3 % 3 - 1), 0.55 + 1.05 * (i / 9));
    const Vector3 shift(random.Uniform(-0.1, 0.1), random.Uniform(-0.1, 0.1), 0);
    BodyDefinition ball = Ball(place + shift, radius, kFriction);
    ball.mass.reset();
    silo.grains.push_back(world.Add(ball));
  }
  return silo;
}

// Over a time in which the floor sinks.
struct SiloLoads {
  double base = 0, walls = 0;  // [N] mean, downwards on them
  double unexplained = 0;      // mean force that neither they nor the momentum gained account for, over the weight
  double height = 0;           // [m] of the fill at the end
};

double FillHeight(const Silo& silo) {
  const double floor = silo.world.body(silo.base).position_W.z() + 1;
  double top = floor;
  for (const int grain : silo.grains) {
    const Body& body = silo.world.body(grain);
    top = std::max(top, body.position_W.z() + body.radius);
  }
  return top - floor;
}

SiloLoads MeasureLoads(double seconds, double dt, Silo* silo) {
  SiloLoads loads;
  World& world = silo->world;
  const double weight = Weight(world), momentum = Momentum(world).z();
  const int frames = Frames(seconds, dt);
  const double time = frames * dt;
  for (int frame = 0; frame < frames; ++frame) {
    world.Step(dt);
    loads.base -= ImpulseOn(world, silo->base).z() / time;
    for (const int wall : silo->walls) loads.walls -= ImpulseOn(world, wall).z() / time;
  }
  const double gained = (Momentum(world).z() - momentum) / time;
  loads.unexplained = std::abs(loads.base + loads.walls - gained - weight) / weight;
  loads.height = FillHeight(*silo);
  return loads;
}

// H / l from the base's share (1 - exp(-x)) / x, which falls with x.
double HeightOverLength(double share) {
  double low = 1e-6, high = 100;
  for (int i = 0; i < 100; ++i) {
    const double x = 0.5 * (low + high);
    (-std::expm1(-x) / x > share ? low : high) = x;
  }
  return low;
}

// [m] Janssen's l of a silo with so many layers of nine spheres.
double MeasureFill(const CheckSettings& settings, int layers, Measurements* out) {
  Silo silo = BuildSilo(settings.engine, layers);
  const double weight = Weight(silo.world);
  StepTimes(&silo.world, Frames(2, settings.dt), settings.dt);
  silo.world.SetVelocity(silo.base, {0, 0, -kSink}, Vector3::Zero());
  StepTimes(&silo.world, Frames(0.5, settings.dt), settings.dt);
  const SiloLoads loads = MeasureLoads(0.5, settings.dt, &silo);
  const std::string name = ", " + std::to_string(silo.grains.size()) + " spheres";
  out->AtMost("base + walls - momentum gained - weight" + name, "of the weight", loads.unexplained, 1e-6);
  const double length = loads.height / HeightOverLength(loads.base / weight);
  const double sine = std::sin(std::atan(kFriction));
  out->Absolute("K from the base's share, against Jaky's 1 - sin f" + name, "", 1 - sine,
                kSide / (4 * kFriction * length), 0.35,
                "a few layers of few spheres: Rankine's active value to nearly 1");
  return length;
}

}  // namespace

void MeasureSilo(const CheckSettings& settings, Measurements* out) {
  const double length = MeasureFill(settings, 10, out);
  if (settings.quick) return;
  out->Relative("Janssen's l, 180 against 90 spheres", "m", length, MeasureFill(settings, 20, out), 0.3);
}

}  // namespace islet::verify
