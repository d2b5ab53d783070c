// T24: two walls close on a cube. No velocity satisfies both; that must be said, and the world must stay usable.
#include <algorithm>
#include <array>
#include <cmath>
#include <string>

#include "scenes/verify/builders.h"
#include "scenes/verify/structure_measures.h"

namespace islet::verify {
namespace {

constexpr double kWallSpeed = 0.5;  // [m/s]

struct Press {
  World world;
  int cube;
  std::array<int, 2> walls;  // left, right: they touch the cube at the start
};

Press BuildPress(const Settings& settings, double gap, double friction) {
  Press press{World(settings), 0, {}};
  press.world.Add(Floor(0.5));
  press.cube = press.world.Add(Cube({0, 0, 0.5}, friction));
  for (const int side : {0, 1}) {
    const double x = (side == 0 ? -1 : 1) * (1 + gap);
    press.walls[side] = press.world.Add({.shape = Shape::Box({0.5, 1, 1}),
                                         .kind = BodyKind::kKinematic,
                                         .position_W = {x, 0, 1.2},
                                         .friction = friction,
                                         .restitution = 0});
  }
  return press;
}

void MoveWalls(Press* press, double left, double right) {
  press->world.SetVelocity(press->walls[0], {left, 0, 0}, Vector3::Zero());
  press->world.SetVelocity(press->walls[1], {right, 0, 0}, Vector3::Zero());
}

struct PressRun {
  int steps = 0, reported = 0;  // with a problem that has no solution
  double speed = 0;             // [m/s] of the cube's fastest point
  bool finite = true;
};

PressRun RunPress(const CheckSettings& settings, double seconds, Press* press) {
  PressRun run;
  for (int frame = 0; frame < Frames(seconds, settings.dt); ++frame) {
    const StepReport report = press->world.Step(settings.dt);
    ++run.steps;
    run.reported += report.collision_qp.failed + report.static_qp.failed > 0;
    const Body& cube = press->world.body(press->cube);
    run.speed = std::max(run.speed, cube.linear_velocity_W.norm() + cube.radius * cube.angular_velocity_W.norm());
    run.finite = run.finite && AllFinite(press->world);
  }
  return run;
}

void MeasurePress(const CheckSettings& settings, double friction, Measurements* out) {
  const std::string name = friction > 0 ? ", rough" : ", smooth";
  Press press = BuildPress(settings.engine, 0, friction);
  const double before = RunPress(settings, 0.5, &press).speed;  // at rest, frozen if bodies freeze
  MoveWalls(&press, kWallSpeed, -kWallSpeed);
  const PressRun closing = RunPress(settings, 0.2, &press);
  out->AtMost("speed of the cube between walls at rest" + name, "m/s", before, 1e-6);
  out->Absolute("steps reported as without a solution" + name, "steps", closing.steps, closing.reported, 0);
  out->Verdict("all finite while the walls close" + name, true, closing.finite);
  out->AtMost("speed of the cube while the walls close" + name, "m/s", closing.speed, 2 * kWallSpeed,
              "no faster than the walls approach each other");
  MoveWalls(&press, -kWallSpeed, kWallSpeed);
  RunPress(settings, 1, &press);
  const PressRun open = RunPress(settings, 1, &press);
  out->AtMost("steps without a solution after the walls opened" + name, "steps", open.reported, 0);
  out->AtMost("speed of the cube after the walls opened" + name, "m/s", open.speed, 1e-4);
}

// Walls that move side by side carry the cube along: that has a solution.
void MeasureConveyor(const CheckSettings& settings, Measurements* out) {
  Press press = BuildPress(settings.engine, 0, 0.5);
  RunPress(settings, 0.5, &press);
  MoveWalls(&press, kWallSpeed, kWallSpeed);
  const PressRun run = RunPress(settings, 1, &press);
  const std::string note =
      "there is one: the cube goes along and slides on the floor; the convex problem from which the solver starts has "
      "none "
      "(what slides on the floor would have to lift off, and would then rub at the walls)";
  out->AtMost("steps without a solution, walls that move side by side", "steps", run.reported, 0, note);
  out->Relative("speed of the cube between them", "m/s", kWallSpeed, press.world.body(press.cube).linear_velocity_W.x(),
                1e-6);
}

}  // namespace

void MeasureSqueeze(const CheckSettings& settings, Measurements* out) {
  MeasurePress(settings, 0, out);
  MeasurePress(settings, 0.5, out);
  MeasureConveyor(settings, out);
}

}  // namespace islet::verify
