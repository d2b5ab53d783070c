#include "bench/charts/chart_scenes.h"

#include <algorithm>
#include <cmath>

#include "bench/charts/chart_plans.h"

namespace islet::charts {
namespace {

using peers::State;
using peers::WorldPlan;

constexpr double kRollSeconds = 3;     // [s]
constexpr double kCarrierSeconds = 4;  // [s]
constexpr double kBroken = 0.5;        // [m] a pile that has moved by this has not stood
constexpr double kThrough = 0.5;       // [m] spheres of radius 0.5 that overlap by this pass through each other

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

// The plate's equation of motion, with spheres that roll: each follows with 2/7 of its acceleration.
Outcome JudgeCarrier(const WorldPlan& plan, std::span<const State> end, const Measures& m) {
  if (!m.finite) return {1, "not finite"};
  const double weight = (kCarrierMass + kCarriedBalls) * kGravity;
  const double acceleration = (kCarrierPush - kCarrierFriction * weight) / (kCarrierMass + 2.0 / 7 * kCarriedBalls);
  const Vector3 exact = kCarrierSeconds * acceleration * Vector3(1, 1, 0).normalized();
  double error = 0;
  for (size_t i = 1; i < plan.bodies.size(); ++i) {
    const Vector3& velocity = end[i].linear_velocity_W;
    error = std::max(error, (velocity - (i == 1 ? 1 : 2.0 / 7) * exact).norm() / exact.norm());
  }
  return {error, error > 0.9 ? "stuck or off" : ""};
}

Outcome JudgeEnergy(const WorldPlan&, std::span<const State>, const Measures& m) {
  return {std::abs(m.energy_ratio - 1), Lost(m).failed};
}

constexpr ChartScene kScenes[] = {
    {"incline", 10, true, 10, 1, false, "a cube at rest on a slope of 0.99 of the friction angle's tangent",
     "creep in 10 s [m]", "Coulomb friction holds it: it does not move.", Incline, JudgeDrift},
    {"slide0", 4, true, 10, 1, false, "a cube slides along x at 5 m/s, friction 0.5", "stopping point, relative error",
     "v^2 / (2 mu g) along the velocity.", [] { return Slide(0); }, JudgeSlide},
    {"slide22", 4, true, 10, 1, false, "a cube slides at 22.5 degrees to its sides at 5 m/s, friction 0.5",
     "stopping point, relative error", "v^2 / (2 mu g) along the velocity: friction has no preferred direction.",
     [] { return Slide(kThrownAngle); }, JudgeSlide},
    {"rolling", kRollSeconds, true, 10, 1, false, "a sphere thrown without spin slips, then rolls, at 22.5 degrees",
     "position after 3 s, relative error", "slips for 2 v / (7 mu g), then rolls at 5/7 v.", Rolling, JudgeRolling},
    {"stack10", 10, true, 10, 1, false, "ten cubes on each other, at rest, touching", "drift after 10 s [m]",
     "It stands: no centre moves. Soft contacts sink by design; that counts.", [] { return FromScene("stack", 10); },
     JudgeDrift},
    {"stack30", 10, false, 10, 1, false, "thirty cubes on each other, at rest, touching", "drift after 10 s [m]",
     "It stands: no centre moves.", [] { return FromScene("stack", 30); }, JudgeDrift},
    {"stack100", 5, false, 10, 1, true, "a hundred cubes on each other, at rest, touching", "drift after 5 s [m]",
     "It stands: no centre moves.", [] { return FromScene("stack", 100); }, JudgeDrift},
    {"heavy", 10, true, 10, 1, false, "1, 10, 100, 1000 kg upward, at rest, touching", "deepest overlap [m]",
     "It stands: nothing moves and nothing overlaps.", Heavy, JudgeHeavy},
    {"cardhouse", 5, false, 10, 1, false,
     "two pairs of leaning cards, a flat one across their tops, a third pair on it", "drift after 5 s [m]",
     "Statics: a pair needs friction tan(20 deg) / 2 = 0.18, loaded at its top less than tan(20 deg) = 0.36; it has "
     "0.5.",
     CardHouse, JudgeDrift},
    {"arch", 5, false, 10, 1, false, "a semicircle of 13 wedges, 0.15 of its radius thick, friction 0.7",
     "drift after 5 s [m]", "It stands: the least thickness is 0.107 of the radius, the least friction 0.31.",
     ArchOfWedges, JudgeDrift},
    {"carrier", kCarrierSeconds, false, 10, 1, false,
     "SimBenchmark's rolling: a sliding plate with 25 spheres on it, pushed along its diagonal",
     "velocities after 4 s, largest error over the plate's",
     "Spheres that roll follow with 2/7 of the plate's acceleration, which is 0.7385 m/s^2.", Carrier, JudgeCarrier},
    {"cloud666", 3, false, 10, 3, true, "SimBenchmark's 666: 216 spheres fall on a floor, no restitution, no friction",
     "deepest overlap, mean over the run [m]", "Bodies do not overlap.", [] { return Cloud(0); }, JudgeOverlap},
    {"elastic666", 3, false, 10, 3, true, "the same with restitution 1", "energy, relative change",
     "Nothing takes energy.", [] { return Cloud(1); }, JudgeEnergy},
    {"officetoy", 2, true, 10, 1, false, "a sphere hits four that touch; restitution 1, no friction, no gravity",
     "energy or momentum, relative change", "Both are kept, whichever law of simultaneous impact an engine follows.",
     [] { return FromScene("officetoy"); }, JudgeLedger},
    {"cradle_apart", 2, true, 10, 1, false,
     "five spheres in a row with 5 cm between them, hit by the first: one collision at a time",
     "final speeds, largest error [m/s]", "Equal masses, restitution 1: each collision swaps the velocities.",
     CradleApart, JudgeCradle},
    {"csstack", 5, false, 10, 1, false, "cube, sphere, cube, ..., each up to 1 mm off the axis", "deepest overlap [m]",
     "Bodies do not overlap; the tower must fall.", [] { return FromScene("csstack"); }, JudgeFall},
    {"manystacks", 3, false, 10, 1, false, "100 towers of five cubes", "drift after 3 s [m]",
     "They stand: no centre moves.", [] { return FromScene("manystacks"); }, JudgeDrift},
    {"cubejam", 15, true, 15, 5, false, "100 cubes fall past beams into a container",
     "deepest overlap, mean over the run [m]", "Bodies do not overlap.", [] { return FromScene("cubejam"); },
     JudgeOverlap},
    {"bin200", 10, false, 20, 1, true, "200 boxes of several sizes fall into a bin and come to rest",
     "deepest overlap, mean over the run [m]", "Bodies do not overlap.", [] { return Bin(200, 5); }, JudgeOverlap},
    {"cubeglass300", 8, false, 15, 1, true, "300 cubes pour through the hourglass",
     "deepest overlap, mean over the run [m]", "Bodies do not overlap.", [] { return FromScene("cubeglass", 300); },
     JudgeOverlap},
    {"cubeglass", 5, false, 40, 3, true, "1,000 cubes pour through the hourglass",
     "deepest overlap, mean over the run [m]", "Bodies do not overlap.", [] { return FromScene("cubeglass"); },
     JudgeOverlap},
    {"cubeglass7", 5, false, 40, 1, true, "1,000 cubes in the narrow hourglass, where they wedge",
     "deepest overlap, mean over the run [m]", "Bodies do not overlap.", [] { return FromScene("cubeglass7"); },
     JudgeOverlap},
};

}  // namespace

peers::WorldPlan PlanOf(const ChartScene& scene, int start) {
  peers::WorldPlan plan = scene.plan();
  if (start > 0) Shift(start, kShift, &plan);
  return plan;
}

std::span<const ChartScene> AllChartScenes() { return kScenes; }

const ChartScene* FindChartScene(std::string_view name) {
  const auto found = std::ranges::find(kScenes, name, &ChartScene::name);
  return found == std::end(kScenes) ? nullptr : &*found;
}

}  // namespace islet::charts
