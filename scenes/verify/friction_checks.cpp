// Blocks that stand, start to slide, and slide down a plane: T1, T2, T3; and the list of the family.
#include <algorithm>
#include <cmath>
#include <numbers>

#include "scenes/verify/builders.h"
#include "scenes/verify/friction_family.h"

namespace islet {
namespace verify {
namespace {

constexpr double kFriction = 0.5;

double CreepOf(const CheckSettings& settings, const Vector3& half_extents, double tangent, double friction) {
  const double incline = std::atan(tangent);
  World world(settings.engine);
  world.Add(Floor(friction, 0, incline));
  const int box = world.Add(BoxOnIncline(half_extents, incline, friction));
  const Body start = world.body(box);
  StepTimes(&world, Frames(10, settings.dt), settings.dt);
  return Travel(world.shape(box), start, world.body(box));
}

// [m/s] of the fastest corner of the body's bounding box.
double FastestCorner(const World& world, int body) {
  const Body& b = world.body(body);
  const Vector3& half = world.shape(body).half_extents();
  double fastest = 0;
  for (int corner = 0; corner < 8; ++corner) {
    const Vector3 sign(corner & 1 ? 1 : -1, corner & 2 ? 1 : -1, corner & 4 ? 1 : -1);
    fastest = std::max(fastest, b.VelocityAt(b.position_W + b.rotation_WB * half.cwiseProduct(sign)).norm());
  }
  return fastest;
}

// Whether a slab on a floor slides under this horizontal force.
bool SlabSlides(const CheckSettings& settings, double friction, const Vector3& force) {
  World world(settings.engine);
  world.Add(Floor(friction));
  const int slab = world.Add(BoxOnIncline({0.5, 0.5, 0.1}, 0, friction));
  world.SetForce(slab, force, Vector3::Zero());
  StepTimes(&world, kProbeFrames, settings.dt);
  // What a force of 1 + 5e-7 times the threshold gives: half the bound.
  return world.body(slab).linear_velocity_W.norm() > 5e-7 * friction * kGravity * kProbeFrames * settings.dt;
}

}  // namespace

BodyDefinition BoxOnIncline(const Vector3& half_extents, double incline, double friction) {
  const Quaternion turn = Turn(incline, Vector3::UnitY());
  return {.shape = Shape::Box(half_extents),
          .mass = 1,
          .position_W = turn * Vector3(0, 0, half_extents.z()),
          .rotation_WB = turn,
          .friction = friction,
          .restitution = 0};
}

double ToleratedDrift(const CheckSettings& settings, double seconds) {
  return settings.engine.tolerance * kGravity * settings.dt * seconds;
}

bool Moves(const World& world, int body, double acceleration, double dt) {
  return FastestCorner(world, body) > 10 * world.settings().tolerance * acceleration * dt;
}

double ToleratedThreshold(const CheckSettings& settings) {
  return 10 * settings.engine.tolerance / (kProbeFrames / 6.0);
}

double FootDrift(const World& world, int body, const Body& start) {
  const Body& b = world.body(body);
  const Vector3& half = world.shape(body).half_extents();
  const Vector3 normal = start.rotation_WB * Vector3::UnitZ();
  double farthest = 0;
  for (const double x : {-half.x(), half.x()})
    for (const double y : {-half.y(), half.y()}) {
      const Vector3 corner(x, y, -half.z());
      const Vector3 moved = b.position_W + b.rotation_WB * corner - start.position_W - start.rotation_WB * corner;
      farthest = std::max(farthest, std::abs(normal.dot(moved)));
    }
  return farthest;
}

void MeasureCreep(const CheckSettings& settings, Measurements* out) {
  const Vector3 cube(0.5, 0.5, 0.5), slab(1, 0.7, 0.1);
  for (const char* const factor : {"0.5", "0.9", "0.99"}) {
    out->AtMost(std::string("creep in 10 s at ") + factor + " mu, cube", "m",
                CreepOf(settings, cube, std::stod(factor) * kFriction, kFriction), 1e-9);
  }
  out->AtMost("creep in 10 s at 0.99 mu, mu = 1, slab", "m", CreepOf(settings, slab, 0.99, 1), 1e-9);
}

// From rest v = a t, and a step moves by its mean velocity, so x = a t^2 / 2 without an error of the time step.
void MeasureInclineSlide(const CheckSettings& settings, Measurements* out) {
  double drift = 0;
  for (const char* const factor : {"1.01", "1.5", "3"}) {
    const double incline = std::atan(std::stod(factor) * kFriction);
    World world(settings.engine);
    world.Add(Floor(kFriction, 0, incline));
    const int cube = world.Add(BoxOnIncline({0.5, 0.5, 0.5}, incline, kFriction));
    const Body start = world.body(cube);
    const Vector3 down_slope = start.rotation_WB * Vector3::UnitX();
    for (int frame = 0; frame < Frames(1, settings.dt); ++frame) {
      world.Step(settings.dt);
      drift = std::max(drift, FootDrift(world, cube, start));
    }
    const Body& body = world.body(cube);
    const double acceleration = kGravity * (std::sin(incline) - kFriction * std::cos(incline)), t = world.time();
    out->Relative(std::string("acceleration by speed at ") + factor + " mu", "m/s^2", acceleration,
                  down_slope.dot(body.linear_velocity_W) / t, 1e-6);
    out->Relative(std::string("acceleration by way at ") + factor + " mu", "m/s^2", acceleration,
                  down_slope.dot(body.position_W - start.position_W) / (t * t / 2), 1e-6);
  }
  out->AtMost("a corner of its foot off the plane", "m", drift, ToleratedDrift(settings, 1));
}

void MeasureThreshold(const CheckSettings& settings, Measurements* out) {
  constexpr int kDirections = 32;          // holds the octagon's corners and the middles between them
  double least = 2, most = 0, ripple = 0;  // of the friction felt, over mu
  for (const double friction : {0.3, 0.5, 0.9}) {
    double least_here = 2, most_here = 0;
    for (int i = 0; i < kDirections; ++i) {
      const double azimuth = 2 * std::numbers::pi * i / kDirections;
      const Vector3 direction(std::cos(azimuth), std::sin(azimuth), 0);
      const double felt = Boundary(0.8, 1.2, [&](double load) {
        return !SlabSlides(settings, friction, direction * (load * friction * kGravity));
      });
      least_here = std::min(least_here, felt);
      most_here = std::max(most_here, felt);
    }
    least = std::min(least, least_here);
    most = std::max(most, most_here);
    ripple = std::max(ripple, most_here - least_here);
  }
  out->Absolute("least friction over all directions, over mu", "", 1, least, 1e-6);
  out->Absolute("most friction over all directions, over mu", "", 1, most, 1e-6);
  out->AtMost("ripple", "", ripple, 1e-6);
}

}  // namespace verify

std::span<const Check> FrictionChecks() {
  using namespace verify;
  static constexpr Check kChecks[] = {
      {"T1", "block on an incline below the friction angle", Gate::kGate,
       "rest: friction can carry m g sin th as long as tan th <= mu", MeasureCreep},
      {"T2", "block on an incline above the friction angle", Gate::kGate,
       "a = g (sin th - mu cos th), from Newton's law", MeasureInclineSlide},
      {"T3", "push at which a slab starts to slide, in 32 directions", Gate::kGate,
       "mu m g in every direction: the friction cone is round", MeasureThreshold},
      {"T4", "sliding cube stops", Gate::kGate,
       "d = v0^2 / (2 mu g) after t = v0 / (mu g), straight ahead and never off the floor", MeasureStop},
      {"T5", "lift-off of one sliding contact", Gate::kGate,
       "u_n+ = e |u_n-| whatever slides: Newton's law, and Signorini's where nothing approaches", MeasureLiftOff},
      {"T6", "oblique bounce of a spinning sphere", Gate::kGate,
       "grips if |u_t| <= 7/2 mu (1 + e) |v_n|, since a solid sphere's contact point has 2/7 of its mass along the "
       "floor; "
       "else the friction impulse is mu times the normal one",
       MeasureObliqueBounce},
      {"T18", "leaning cards: ladder and house of cards", Gate::kGate,
       "stands iff mu at the foot >= (tan th - t/L) / 2: moments about the foot, card L long and t thick",
       MeasureLeaningCards},
      {"T19", "box tips or slides", Gate::kGate,
       "on an incline or pushed at mid-height it tips first iff mu > b/h, pushed at the top edge iff mu > b/(2 h)",
       MeasureTipping},
      {"T23", "wedge between two walls", Gate::kGate,
       "squeezed by a force it stays iff tan alpha <= mu: the two reactions must be in line; in a groove it carries "
       "its weight",
       MeasureWedge},
  };
  return kChecks;
}

}  // namespace islet
