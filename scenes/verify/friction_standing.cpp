// What stands by friction alone, or tips before it slides: T18 leaning cards, T19 boxes, T23 wedges.
#include <algorithm>
#include <cmath>
#include <numbers>

#include "scenes/verify/builders.h"
#include "scenes/verify/friction_family.h"

namespace islet::verify {
namespace {

double Radians(double degrees) { return degrees * std::numbers::pi / 180; }

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

// Whether it has begun to move: faster than what the contact problems' tolerance lets pass under this load, with room for
// what is far from its contacts. See ToleratedThreshold.
bool Moves(const World& world, int body, double acceleration, double dt) {
  return FastestCorner(world, body) > 10 * world.settings().tolerance * acceleration * dt;
}

// ---- T18 ----

constexpr double kLength = 1, kThickness = 0.02, kWidth = 0.6;  // [m] of a card

// The reaction of the other card or of the wall is a horizontal force H at the top. About the foot, both at the card's inner
// face: H L cos th = m g (L sin th - t cos th) / 2; at the foot N = m g and the friction is H.
double FrictionToLean(double lean) { return 0.5 * (std::tan(lean) - kThickness / kLength); }

// Its top leans on x = 0 from the left, turned by `lean` from the vertical; from the right if that is negative.
BodyDefinition Card(double lean, double friction) {
  const double angle = std::abs(lean);
  const double x = 0.5 * (kLength * std::sin(angle) + kThickness * std::cos(angle));
  const double z = 0.5 * (kLength * std::cos(angle) + kThickness * std::sin(angle));
  return {.shape = Shape::Box({kThickness / 2, kWidth / 2, kLength / 2}),
          .mass = 1,
          .position_W = {lean > 0 ? -x : x, 0, z},
          .rotation_WB = Turn(lean, Vector3::UnitY()),
          .friction = friction,
          .restitution = 0};
}

// One card on a wall without friction, or two on each other. There the normal is that of either card's face; the friction
// at the top is so high that the force may be horizontal all the same.
World LeaningCards(const CheckSettings& settings, bool house, double lean, double friction) {
  World world(settings.engine);
  world.Add(Floor(friction));
  world.Add(Card(lean, friction));
  if (house) {
    world.Add(Card(-lean, friction));
    world.SetMaterialCallback([friction](const Contact&, const Body& a, const Body& b) {
      const bool top = a.kind == BodyKind::kDynamic && b.kind == BodyKind::kDynamic;
      return Material{top ? 10 : friction, 0};
    });
  } else {
    world.Add({.shape = Shape::HalfSpace(),
               .kind = BodyKind::kFixed,
               .rotation_WB = Turn(-std::numbers::pi / 2, Vector3::UnitY()),
               .friction = 0,
               .restitution = 0});
  }
  return world;
}

// [m] that the left card's corners have moved after so long.
double CardTravel(const CheckSettings& settings, bool house, double lean, double friction, double seconds) {
  World world = LeaningCards(settings, house, lean, friction);
  const Body start = world.body(1);
  StepTimes(&world, Frames(seconds, settings.dt), settings.dt);
  return Travel(world.shape(1), start, world.body(1));
}

// [m] by how much the two cards of a falling house are off each other's mirror image, worst over its first tenth of a second.
double FallAsymmetry(const CheckSettings& settings, double lean) {
  World world = LeaningCards(settings, true, lean, 0.9 * FrictionToLean(lean));
  double worst = 0;
  for (int frame = 0; frame < Frames(0.1, settings.dt); ++frame) {
    world.Step(settings.dt);
    const Vector3 left = world.body(1).position_W, right = world.body(2).position_W;
    worst = std::max(worst, (left - Vector3(-right.x(), right.y(), right.z())).norm());
  }
  return worst;
}

void MeasureLeaning(const CheckSettings& settings, bool house, Measurements* out) {
  const std::string what = house ? ", house of cards" : ", ladder";
  double worst = 0, creep = 0;
  bool slides = true;
  for (const double degrees : {15.0, 30.0, 45.0}) {
    const double lean = Radians(degrees), needed = FrictionToLean(lean);
    const double felt = Boundary(0.9, 1.1, [&](double factor) {
      World world = LeaningCards(settings, house, lean, factor * needed);
      StepTimes(&world, kProbeFrames, settings.dt);
      return Moves(world, 1, kGravity, settings.dt) || (house && Moves(world, 2, kGravity, settings.dt));
    });
    if (!(std::abs(felt - 1) <= std::abs(worst))) worst = felt - 1;
    creep = std::max(creep, CardTravel(settings, house, lean, 1.02 * needed, 5));
    slides = slides && CardTravel(settings, house, lean, 0.98 * needed, 2) > 0.1 * kLength;
  }
  out->Absolute("friction needed, over (tan th - t/L) / 2" + what, "", 1, 1 + worst, ToleratedThreshold(settings));
  out->AtMost("travel in 5 s with 2 % more" + what, "m", creep, 1e-9);
  out->Verdict("falls with 2 % less" + what, true, slides);
  if (!house) return;
  double asymmetry = 0;
  for (const double degrees : {15.0, 30.0, 45.0})
    asymmetry = std::max(asymmetry, FallAsymmetry(settings, Radians(degrees)));
  out->AtMost(
      "asymmetry of its fall in 0.1 s, house of cards", "m", asymmetry, ToleratedDrift(settings, 0.1),
      "where two edges that are parallel but for round-off meet, detection may give one contact instead of two");
}

// ---- T19 ----

enum class Outcome { kRests, kSlides, kTips, kOther };
enum class Push { kIncline, kMiddle, kTop };

// A box b = `ratio` wide and 1 m high, its foot loaded as on a slope of this tangent.
World LoadedBox(const CheckSettings& settings, Push push, double friction, double ratio, double tangent) {
  World world(settings.engine);
  const double incline = push == Push::kIncline ? std::atan(tangent) : 0;
  world.Add(Floor(friction, 0, incline));
  const int box = world.Add(BoxOnIncline({ratio / 2, 0.4, 0.5}, incline, friction));
  const double force = push == Push::kIncline ? 0 : tangent * kGravity;
  world.SetForce(box, {force, 0, 0}, {0, push == Push::kTop ? force * 0.5 : 0, 0});
  return world;
}

Outcome Watch(World* world, double dt) {
  const Body start = world->body(1);
  const Vector3 half = world->shape(1).half_extents();
  StepTimes(world, Frames(0.25, dt), dt);
  const Body& now = world->body(1);
  const auto edge = [&](const Body& b) {
    return Vector3(b.position_W + b.rotation_WB * Vector3(half.x(), 0, -half.z()));
  };
  const double slid = (edge(now) - edge(start)).norm(), turned = now.rotation_WB.angularDistance(start.rotation_WB);
  if (slid < 1e-9 && turned < 1e-9) return Outcome::kRests;
  if (turned < 1e-6 && slid > 1e-4) return Outcome::kSlides;
  return turned > 1e-4 && slid < 1e-5 ? Outcome::kTips : Outcome::kOther;
}

void MeasureTippingMap(const CheckSettings& settings, Push push, Measurements* out) {
  double worst = 0;
  int wrong = 0, maps = 0;
  for (const double friction : {0.2, 0.4, 0.7, 1.1})
    for (const double ratio : {0.25, 0.5, 0.9, 1.2}) {
      const double tips_at = push == Push::kTop ? ratio / 2 : ratio, limit = std::min(friction, tips_at);
      const double felt = Boundary(0.9, 1.1, [&](double factor) {
        World world = LoadedBox(settings, push, friction, ratio, factor * limit);
        StepTimes(&world, kProbeFrames, settings.dt);
        return !Moves(world, 1, kGravity, settings.dt);
      });
      if (!(std::abs(felt - 1) <= std::abs(worst))) worst = felt - 1;
      World below = LoadedBox(settings, push, friction, ratio, 0.98 * limit);
      World above = LoadedBox(settings, push, friction, ratio, 1.02 * limit);
      const Outcome expected = friction > tips_at ? Outcome::kTips : Outcome::kSlides;
      wrong += (Watch(&below, settings.dt) != Outcome::kRests) + (Watch(&above, settings.dt) != expected);
      maps += 2;
    }
  const char* const name = push == Push::kIncline  ? "on an incline"
                           : push == Push::kMiddle ? "pushed at mid-height"
                                                   : "pushed at the top";
  out->Absolute(std::string("load that moves it, over min(mu, tipping), ") + name, "", 1, 1 + worst,
                ToleratedThreshold(settings));
  out->Absolute(std::string("wrong verdicts of ") + std::to_string(maps) + " (rests, slides, tips), " + name, "", 0,
                wrong, 0);
}

// [m] farthest that a corner of a cube's foot leaves the floor when the cube is sent off horizontally, and slides for 0.5 s.
double LiftWhenLaunched(const CheckSettings& settings, double friction) {
  World world(settings.engine);
  world.Add(Floor(friction));
  BodyDefinition definition = BoxOnIncline({0.5, 0.5, 0.5}, 0, friction);
  definition.linear_velocity_W = {6, 0, 0};
  const int cube = world.Add(definition);
  const Body start = world.body(cube);
  double drift = 0;
  for (int frame = 0; frame < Frames(0.5, settings.dt); ++frame) {
    world.Step(settings.dt);
    drift = std::max(drift, FootDrift(world, cube, start));
  }
  return drift;
}

// ---- T23 ----

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
    held = std::max(held, ClampTravel(settings, alpha, 1.02 * needed, 5));
    very_rough = std::max(very_rough, ClampTravel(settings, alpha, 100, 5));
    slips = slips && ClampTravel(settings, alpha, 0.98 * needed, 1) > 0.01;
    MeasureJaw(settings, alpha, 1.02 * needed, &guides, &pulled);
  }
  const double drift = settings.engine.tolerance * kSqueeze * settings.dt * 5;  // as in ToleratedDrift
  out->Absolute("friction needed when squeezed, over tan alpha", "", 1, 1 + worst, ToleratedThreshold(settings));
  out->AtMost("travel in 5 s with 2 % more", "m", held, drift);
  out->Verdict("squeezed out with 2 % less", true, slips);
  out->AtMost("travel in 5 s with mu = 100, squeezed", "m", very_rough, drift);
  out->AtMost("load of the jaw's guides, over the squeeze", "", guides, 10,
              "undetermined, as they may jam each other: only a blow-up is ruled out");
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

void MeasureLeaningCards(const CheckSettings& settings, Measurements* out) {
  MeasureLeaning(settings, false, out);
  MeasureLeaning(settings, true, out);
}

void MeasureTipping(const CheckSettings& settings, Measurements* out) {
  for (const Push push : {Push::kIncline, Push::kMiddle, Push::kTop}) MeasureTippingMap(settings, push, out);
  out->AtMost("corner lift of a cube launched at 6 m/s, mu = 0.9", "m", LiftWhenLaunched(settings, 0.9),
              ToleratedDrift(settings, 0.5));
  out->Verdict("a launched cube tips with mu = 1.1", true, LiftWhenLaunched(settings, 1.1) > 1e-3);
}

void MeasureWedge(const CheckSettings& settings, Measurements* out) {
  MeasureClamp(settings, out);
  MeasureGroove(settings, out);
}

}  // namespace islet::verify
