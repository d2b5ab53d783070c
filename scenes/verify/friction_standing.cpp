// What stands by friction alone, or tips before it slides: T18 leaning cards, T19 boxes.
#include <algorithm>
#include <cmath>
#include <numbers>

#include "scenes/verify/builders.h"
#include "scenes/verify/friction_family.h"

namespace islet::verify {
namespace {

// ---- T18 ----

constexpr double kLength = 1, kThickness = 0.02, kWidth = 0.6;  // [m] of a card

// The reaction of the other card or of the wall is a horizontal force H at the top. About the foot, both at the card's inner
// face: H L cos th = m g (L sin th - t cos th) / 2; at the foot N = m g and the friction is H.
// Below 45 degrees: there the end of one card lies flat on the face of the other, and the force may act at the outer edge.
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
  for (const double degrees : {15.0, 30.0, 44.0}) {
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
  for (const double degrees : {15.0, 30.0, 44.0})
    asymmetry = std::max(asymmetry, FallAsymmetry(settings, Radians(degrees)));
  out->AtMost(
      "asymmetry of its fall in 0.1 s, house of cards", "m", asymmetry, ToleratedDrift(settings, 0.1),
      "where two edges that are parallel but for round-off meet, detection may give one contact instead of two");
  if (settings.engine.group_bodies == 0) out->Open();
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

}  // namespace islet::verify
