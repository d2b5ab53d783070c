// T23: a wedge that is squeezed between a wall and a jaw, and one that lies in a groove.
#include <algorithm>
#include <cmath>
#include <numbers>

#include "scenes/verify/builders.h"
#include "scenes/verify/friction_family.h"

namespace islet::verify {
namespace {

constexpr double kHalfWidth = 1;  // [m] of the wedge at mid-height
constexpr double kSqueeze = 10;   // [N] on the jaw, and [m/s^2], since all weigh 1 kg

// Points of a slice -depth <= y <= depth, -height <= z <= height between x = left + z slope_left and right + z slope_right.
Shape Slice(double left, double slope_left, double right, double slope_right, double depth, double height) {
  std::vector<Vector3> points;
  for (const double z : {-height, height})
    for (const double y : {-depth, depth}) {
      points.push_back({left + z * slope_left, y, z});
      points.push_back({right + z * slope_right, y, z});
    }
  return Shape::ConvexHull(points);
}

BodyDefinition SliceBody(const Shape& shape, double friction) {
  return {.shape = shape, .mass = 1, .position_W = shape.hull_offset(), .friction = friction, .restitution = 0};
}

// A wall that touches the wedge's left (side = -1) or right face.
BodyDefinition GrooveWall(int side, double alpha, double friction) {
  return {.shape = Shape::HalfSpace(),
          .kind = BodyKind::kFixed,
          .position_W = {side * kHalfWidth, 0, 0},
          .rotation_WB = Turn(-side * (std::numbers::pi / 2 - alpha), Vector3::UnitY()),
          .friction = friction,
          .restitution = 0};
}

Shape Wedge(double alpha) { return Slice(-kHalfWidth, -std::tan(alpha), kHalfWidth, std::tan(alpha), 0.3, 0.5); }

// Without gravity, the wide end up: between a fixed wall and a jaw that slides without friction between a floor and a
// ceiling, and is pushed to the left by this force. Body 1 is the wedge.
World Clamp(const CheckSettings& settings, double alpha, double friction, double force) {
  Settings engine = settings.engine;
  engine.gravity = Vector3::Zero();
  World world(engine);
  world.Add(GrooveWall(-1, alpha, friction));
  world.Add(SliceBody(Wedge(alpha), friction));
  const int jaw = world.Add(SliceBody(Slice(kHalfWidth, std::tan(alpha), kHalfWidth + 2, 0, 0.4, 0.75), friction));
  for (const int side : {-1, 1})
    world.Add({.shape = Shape::HalfSpace(),
               .kind = BodyKind::kFixed,
               .position_W = {0, 0, side * 0.75},
               .rotation_WB = Turn(side < 0 ? 0 : std::numbers::pi, Vector3::UnitY()),
               .friction = 0,
               .restitution = 0});
  world.SetForce(jaw, {-force, 0, 0}, Vector3::Zero());
  return world;
}

double ClampTravel(const CheckSettings& settings, double alpha, double friction, double seconds) {
  World world = Clamp(settings, alpha, friction, kSqueeze);
  const Body start = world.body(1);
  StepTimes(&world, Frames(seconds, settings.dt), settings.dt);
  return Travel(world.shape(1), start, world.body(1));
}

// Of the force on the jaw: what its guides get, and the speed that it has one frame after it is turned round.
void MeasureJaw(const CheckSettings& settings, double alpha, double friction, double* guides, double* speed) {
  World world = Clamp(settings, alpha, friction, kSqueeze);
  StepTimes(&world, Frames(1, settings.dt), settings.dt);
  const int jaw = 2;
  for (size_t c = 0; c < world.resolved_contacts().size(); ++c)
    if (world.resolved_contacts()[c].body_a == jaw)
      *guides = std::max(*guides, world.impulses()[c].norm() / (kSqueeze * settings.dt));
  world.SetForce(jaw, {kSqueeze, 0, 0}, Vector3::Zero());
  world.Step(settings.dt);
  const double share = world.body(jaw).linear_velocity_W.x() / (kSqueeze * settings.dt);
  if (!(std::abs(share - 1) <= std::abs(*speed - 1))) *speed = share;
}

// Force on the jaw F, at the wedge's two faces: both reactions are in line, so each is off its face's normal by alpha.
void MeasureClamp(const CheckSettings& settings, Measurements* out) {
  const double seconds = settings.quick ? 2 : 5;
  double worst = 0, held = 0, very_rough = 0, guides = 0, pulled = 1;
  bool slips = true;
  for (const double degrees : {10.0, 20.0, 35.0}) {
    const double alpha = Radians(degrees), needed = std::tan(alpha);
    const double felt = Boundary(0.9, 1.1, [&](double factor) {
      World world = Clamp(settings, alpha, factor * needed, kSqueeze);
      StepTimes(&world, kProbeFrames, settings.dt);
      return Moves(world, 1, kSqueeze, settings.dt);
    });
    if (!(std::abs(felt - 1) <= std::abs(worst))) worst = felt - 1;
    held = std::max(held, ClampTravel(settings, alpha, 1.02 * needed, seconds));
    very_rough = std::max(very_rough, ClampTravel(settings, alpha, 100, seconds));
    slips = slips && ClampTravel(settings, alpha, 0.98 * needed, 1) > 0.01;
    MeasureJaw(settings, alpha, 1.02 * needed, &guides, &pulled);
  }
  const double drift = settings.engine.tolerance * kSqueeze * settings.dt * seconds;  // as in ToleratedDrift
  out->Absolute("friction needed when squeezed, over tan alpha", "", 1, 1 + worst, ToleratedThreshold(settings));
  out->AtMost("travel with 2 % more", "m", held, drift);
  out->Verdict("squeezed out with 2 % less", true, slips);
  out->AtMost("travel with mu = 100, squeezed", "m", very_rough, drift);
  out->AtMost(
      "load of the jaw's guides, over the squeeze", "", guides, 10,
      "undetermined, since floor and ceiling may jam each other: only a blow-up is ruled out; the interior point runs "
      "away along that direction");
  out->Relative("jaw pulled back: its speed after one frame, over F dt / m", "", 1, pulled, 1e-6,
                "a frozen body that lies about its load");
}

// The load is 2 N sin alpha + 2 T cos alpha = m g with |T| <= mu N. It is determined only without friction; from
// mu = tan alpha on the wedge may be jammed by any load, and all that can be asked is that this one does not blow up.
void MeasureGroove(const CheckSettings& settings, Measurements* out) {
  double travel = 0, carried = 1, frictionless = 1, most = 0;
  for (const double degrees : {10.0, 30.0})
    for (const double friction : {0.0, 0.1, 1.0, 100.0}) {
      const double alpha = Radians(degrees);
      World world(settings.engine);
      const int walls[] = {world.Add(GrooveWall(-1, alpha, friction)), world.Add(GrooveWall(1, alpha, friction))};
      const int wedge = world.Add(SliceBody(Wedge(alpha), friction));
      const Body start = world.body(wedge);
      StepTimes(&world, Frames(settings.quick ? 2 : 10, settings.dt), settings.dt);
      travel = std::max(travel, Travel(world.shape(wedge), start, world.body(wedge)));
      const double weight = kGravity * settings.dt, share = ImpulseOn(world, wedge).z() / weight;
      if (!(std::abs(share - 1) <= std::abs(carried - 1))) carried = share;
      for (const int wall : walls) {
        const Vector3 normal = world.body(wall).rotation_WB * Vector3::UnitZ();
        const double load = ImpulseBetween(world, wall, wedge).dot(normal) / (weight / (2 * std::sin(alpha)));
        if (friction == 0 && !(std::abs(load - 1) <= std::abs(frictionless - 1))) frictionless = load;
        if (!(load <= most)) most = load;
      }
    }
  out->AtMost("travel in the groove, mu 0 to 100", "m", travel, 1e-9);
  out->Relative("weight carried by the walls, over m g", "", 1, carried, 1e-6);
  out->Relative("wall load, no friction, over m g / (2 sin alpha)", "", 1, frictionless, 1e-6);
  out->AtMost("largest wall load with any mu, over that without", "", most, 10, "undetermined: any load is a solution");
}

}  // namespace

void MeasureWedge(const CheckSettings& settings, Measurements* out) {
  MeasureClamp(settings, out);
  MeasureGroove(settings, out);
}

}  // namespace islet::verify
