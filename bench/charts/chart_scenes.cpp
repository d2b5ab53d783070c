#include "bench/charts/chart_scenes.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <stdexcept>

#include "scenes/scene.h"

namespace islet::charts {
namespace {

using peers::BodyPlan;
using peers::State;
using peers::WorldPlan;

constexpr double kGravity = 9.81;  // [m/s^2]
constexpr double kFriction = 0.5;
constexpr double kSlideSpeed = 5;  // [m/s]
constexpr double kSlideAngle = std::numbers::pi / 8;
constexpr double kRollSeconds = 3;  // [s]
constexpr double kBroken = 0.5;     // [m] a pile that has moved by this has not stood
constexpr double kThrough = 0.5;    // [m] spheres of radius 0.5 that overlap by this pass through each other

BodyPlan Box(const Vector3& half_extents, const Vector3& position, double mass = 0) {
  BodyPlan body{.half_extents = half_extents, .mass = mass};
  body.start.position_W = position;
  return body;
}
BodyPlan Cube(const Vector3& position, double mass = 1) { return Box({0.5, 0.5, 0.5}, position, mass); }
BodyPlan Ball(const Vector3& position, const Vector3& velocity = Vector3::Zero()) {
  BodyPlan body{.form = BodyPlan::Form::kSphere};
  body.start.position_W = position;
  body.start.linear_velocity_W = velocity;
  return body;
}
BodyPlan Floor() { return Box({100, 100, 1}, {0, 0, -1}); }

// A scene of the program, as a plan.
WorldPlan FromScene(std::string_view name, std::optional<int> count = {}) {
  Settings settings;
  settings.threads = 1;
  const BuiltScene built = BuildScene(*FindScene(name), {.count = count}, settings);
  WorldPlan plan{.gravity = built.world.settings().gravity, .bodies = {}, .bounds = built.info.bounds};
  for (int i = 0; i < static_cast<int>(built.world.bodies().size()); ++i) {
    const Body& body = built.world.body(i);
    const Shape& shape = built.world.shape(i);
    BodyPlan one{.mass = body.kind == BodyKind::kDynamic ? body.mass : 0,
                 .start = {body.position_W, body.rotation_WB, body.linear_velocity_W, body.angular_velocity_W}};
    if (shape.kind() == ShapeKind::kSphere) {
      one.form = BodyPlan::Form::kSphere;
      one.radius = shape.radius();
    } else if (shape.kind() == ShapeKind::kBox) {
      one.half_extents = shape.half_extents();
    } else {
      throw std::logic_error("a shape that not every engine has");
    }
    plan.bodies.push_back(one);
    plan.friction = body.friction;
    plan.restitution = body.restitution;
  }
  return plan;
}

// One cube on a slab, at rest, at 0.99 of the angle of friction (in its tangent).
WorldPlan Incline() {
  const double angle = std::atan(0.99 * kFriction);
  const Quaternion tilt(Eigen::AngleAxisd(angle, Vector3::UnitY()));
  WorldPlan plan{.bodies = {Box({60, 5, 1}, tilt * Vector3(0, 0, -1)), Cube(tilt * Vector3(0, 0, 0.5))}};
  for (BodyPlan& body : plan.bodies) body.start.rotation_WB = tilt;
  return plan;
}

WorldPlan Slide(double angle) {
  WorldPlan plan{.bodies = {Floor(), Cube({0, 0, 0.5})}};
  plan.bodies[1].start.linear_velocity_W = kSlideSpeed * Vector3(std::cos(angle), std::sin(angle), 0);
  return plan;
}

WorldPlan Rolling() {
  const Vector3 along(std::cos(kSlideAngle), std::sin(kSlideAngle), 0);
  return {.bodies = {Floor(), Ball({0, 0, 0.5}, kSlideSpeed * along)}};
}

WorldPlan Heavy() {
  WorldPlan plan{.bodies = {Floor()}};
  double mass = 1;
  for (int level = 0; level < 4; ++level, mass *= 10) plan.bodies.push_back(Cube({0, 0, 0.5 + level}, mass));
  return plan;
}

// Five spheres, 5 cm between each two of the row: one collision at a time, so there is one right answer.
WorldPlan CradleApart() {
  WorldPlan plan{.gravity = Vector3::Zero(), .friction = 0, .restitution = 1, .bodies = {Ball({0, 0, 0}, {1, 0, 0})}};
  for (int i = 1; i < 5; ++i) plan.bodies.push_back(Ball({0.05 + 1.05 * i, 0, 0}));
  return plan;
}

// Cards 1 m high and 4 cm thick lean against each other, 20 degrees off the vertical: two pairs side by side, a long flat
// card across their tops, and a third pair in the middle of it. Everything is symmetric, so that no pair is loaded on one
// side alone.
WorldPlan CardHouse() {
  constexpr double kHalfThick = 0.02, kHalfHigh = 0.5, kHalfDeep = 0.35, kLean = std::numbers::pi / 9;
  constexpr double kMass = 0.1, kPairDistance = 0.9;
  const double sine = std::sin(kLean), cosine = std::cos(kLean);
  const double low = kHalfHigh * cosine + kHalfThick * sine;    // [m] from the foot up to the centre, and on to the top
  const double inner = kHalfHigh * sine + kHalfThick * cosine;  // [m] from the centre across to the partner's edge
  WorldPlan plan{.bodies = {Floor()}};
  const auto add_pair = [&](double x, double foot) {
    for (const double side : {-1.0, 1.0}) {
      BodyPlan card = Box({kHalfThick, kHalfDeep, kHalfHigh}, {x + side * inner, 0, foot + low}, kMass);
      card.start.rotation_WB = Quaternion(Eigen::AngleAxisd(-side * kLean, Vector3::UnitY()));
      plan.bodies.push_back(card);
    }
  };
  add_pair(-0.5 * kPairDistance, 0);
  add_pair(0.5 * kPairDistance, 0);
  plan.bodies.push_back(Box({kPairDistance, kHalfDeep, kHalfThick}, {0, 0, 2 * low + kHalfThick}, 2 * kMass));
  add_pair(0, 2 * low + 2 * kHalfThick);
  return plan;
}

Outcome Lost(const Measures& m) { return {0, !m.finite ? "not finite" : m.lost > 0 ? "lost bodies" : ""}; }

Outcome JudgeDrift(const WorldPlan&, std::span<const State>, const Measures& m) {
  return {m.drift, !m.finite ? "not finite" : m.drift_max > kBroken ? "collapsed" : ""};
}

Outcome JudgeOverlap(const WorldPlan&, std::span<const State>, const Measures& m) {
  return {m.overlap_mean, Lost(m).failed};
}

Outcome JudgeHeavy(const WorldPlan&, std::span<const State>, const Measures& m) {
  return {m.overlap_max, !m.finite ? "not finite" : m.drift_max > kBroken ? "collapsed" : ""};
}

Outcome JudgeFall(const WorldPlan&, std::span<const State>, const Measures& m) {
  return {m.overlap_max, !m.finite ? "not finite" : m.fell_at < 0 ? "did not fall" : ""};
}

// Where a body ends, over how far it should have come.
Outcome Against(const Vector3& exact, const WorldPlan& plan, std::span<const State> end, const Measures& m) {
  const Vector3 moved = end[1].position_W - plan.bodies[1].start.position_W;
  const double error = (moved - exact).head<2>().norm() / exact.norm();
  return {error, !m.finite ? "not finite" : error > 1 ? "off by more than the way" : ""};
}

Outcome JudgeSlide(const WorldPlan& plan, std::span<const State> end, const Measures& m) {
  const Vector3 velocity = plan.bodies[1].start.linear_velocity_W;
  return Against(velocity * velocity.norm() / (2 * kFriction * kGravity), plan, end, m);
}

Outcome JudgeRolling(const WorldPlan& plan, std::span<const State> end, const Measures& m) {
  const Vector3 velocity = plan.bodies[1].start.linear_velocity_W;
  const double slip_time = 2 * velocity.norm() / (7 * kFriction * kGravity);  // [s]
  const double slip_way = velocity.norm() * slip_time - 0.5 * kFriction * kGravity * slip_time * slip_time;
  const double way = slip_way + 5.0 / 7 * velocity.norm() * (kRollSeconds - slip_time);
  return Against(velocity.normalized() * way, plan, end, m);
}

// The incoming speed is the last sphere's, the others stand.
Outcome JudgeCradle(const WorldPlan& plan, std::span<const State> end, const Measures& m) {
  if (!m.finite) return {1, "not finite"};
  double error = 0;
  for (size_t i = 0; i < end.size(); ++i) {
    const Vector3 exact(i + 1 == plan.bodies.size() ? 1 : 0, 0, 0);
    error = std::max(error, (end[i].linear_velocity_W - exact).norm());
  }
  return {error, m.overlap_max > kThrough ? "passed through" : error > 0.9 ? "not passed on" : ""};
}

// Touching spheres: laws of impact differ in what they predict, but all keep momentum and, with restitution 1, energy.
Outcome JudgeLedger(const WorldPlan&, std::span<const State>, const Measures& m) {
  return {std::max(std::abs(m.energy_ratio - 1), m.momentum_error), !m.finite                  ? "not finite"
                                                                    : m.overlap_max > kThrough ? "passed through"
                                                                                               : ""};
}

constexpr ChartScene kScenes[] = {
    {"incline", 10, true, 10, "a cube at rest on a slope of 0.99 of the friction angle's tangent", "creep in 10 s [m]",
     "Coulomb friction holds it: it does not move.", Incline, JudgeDrift},
    {"slide0", 4, true, 10, "a cube slides along x at 5 m/s, friction 0.5", "stopping point, relative error",
     "v^2 / (2 mu g) along the velocity.", [] { return Slide(0); }, JudgeSlide},
    {"slide22", 4, true, 10, "a cube slides at 22.5 degrees to its sides at 5 m/s, friction 0.5",
     "stopping point, relative error", "v^2 / (2 mu g) along the velocity: friction has no preferred direction.",
     [] { return Slide(kSlideAngle); }, JudgeSlide},
    {"rolling", kRollSeconds, true, 10, "a sphere thrown without spin slips, then rolls, at 22.5 degrees",
     "position after 3 s, relative error", "slips for 2 v / (7 mu g), then rolls at 5/7 v.", Rolling, JudgeRolling},
    {"stack10", 10, true, 10, "ten cubes on each other, at rest, touching", "drift after 10 s [m]",
     "It stands: no centre moves. Soft contacts sink by design; that counts.", [] { return FromScene("stack", 10); },
     JudgeDrift},
    {"stack30", 10, false, 10, "thirty cubes on each other, at rest, touching", "drift after 10 s [m]",
     "It stands: no centre moves.", [] { return FromScene("stack", 30); }, JudgeDrift},
    {"heavy", 10, true, 10, "1, 10, 100, 1000 kg upward, at rest, touching", "deepest overlap [m]",
     "It stands: nothing moves and nothing overlaps.", Heavy, JudgeHeavy},
    {"cardhouse", 5, false, 10, "two pairs of leaning cards, a flat one across their tops, a third pair on it",
     "drift after 5 s [m]",
     "Statics: a pair needs friction tan(20 deg) / 2 = 0.18, loaded at its top less than tan(20 deg) = 0.36; it has "
     "0.5.",
     CardHouse, JudgeDrift},
    {"officetoy", 2, true, 10, "a sphere hits four that touch; restitution 1, no friction, no gravity",
     "energy or momentum, relative change", "Both are kept, whichever law of simultaneous impact an engine follows.",
     [] { return FromScene("officetoy"); }, JudgeLedger},
    {"cradle_apart", 2, true, 10,
     "five spheres in a row with 5 cm between them, hit by the first: one collision at a time",
     "final speeds, largest error [m/s]", "Equal masses, restitution 1: each collision swaps the velocities.",
     CradleApart, JudgeCradle},
    {"csstack", 5, false, 10, "cube, sphere, cube, ..., each up to 1 mm off the axis", "deepest overlap [m]",
     "Bodies do not overlap; the tower must fall.", [] { return FromScene("csstack"); }, JudgeFall},
    {"manystacks", 3, false, 20, "100 towers of five cubes", "drift after 3 s [m]", "They stand: no centre moves.",
     [] { return FromScene("manystacks"); }, JudgeDrift},
    {"cubejam", 15, true, 20, "100 cubes fall past beams into a container", "deepest overlap, mean over the run [m]",
     "Bodies do not overlap.", [] { return FromScene("cubejam"); }, JudgeOverlap},
    {"cubeglass300", 8, false, 20, "300 cubes pour through the hourglass", "deepest overlap, mean over the run [m]",
     "Bodies do not overlap.", [] { return FromScene("cubeglass", 300); }, JudgeOverlap},
    {"cubeglass", 5, false, 40, "1,000 cubes pour through the hourglass", "deepest overlap, mean over the run [m]",
     "Bodies do not overlap.", [] { return FromScene("cubeglass"); }, JudgeOverlap},
};

}  // namespace

std::span<const ChartScene> AllChartScenes() { return kScenes; }

const ChartScene* FindChartScene(std::string_view name) {
  const auto found = std::ranges::find(kScenes, name, &ChartScene::name);
  return found == std::end(kScenes) ? nullptr : &*found;
}

}  // namespace islet::charts
