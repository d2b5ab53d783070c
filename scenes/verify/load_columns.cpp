// T14, T15: columns. What stands on a floor without friction forces has one answer: contact k carries all that is above it.
#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "scenes/verify/builders.h"
#include "scenes/verify/load_measures.h"

namespace islet::verify {
namespace {

// A column of unit cubes, lowest first, that touch; masses in kg.
struct Column {
  World world;
  int floor;
  std::vector<int> cubes;
  std::vector<double> masses;
};

Column BuildColumn(const Settings& settings, const std::vector<double>& masses) {
  Column column{World(settings), 0, {}, masses};
  column.floor = column.world.Add(Floor());
  for (size_t i = 0; i < masses.size(); ++i)
    column.cubes.push_back(column.world.Add(Cube({0, 0, 0.5 + static_cast<double>(i)}, 0.5, 0, masses[i])));
  return column;
}

// The worst of a run. Load errors are relative to the load; overlap is that of a cube's lower corners with the top face
// below, from the poses.
struct ColumnWorst {
  double load = 0;     // relative
  double side = 0;     // horizontal part of a load, over the load
  double overlap = 0;  // [m]
  double travel = 0;   // [m] of any corner
  double speed = 0;    // [m/s]
};

double Overlap(const Body& below, const Body& above) {
  double deepest = 0;
  for (const double x : {-0.5, 0.5}) {
    for (const double y : {-0.5, 0.5}) {
      const Vector3 corner = above.position_W + above.rotation_WB * Vector3(x, y, -0.5);
      const Vector3 in_below = below.rotation_WB.conjugate() * (corner - below.position_W);
      deepest = std::max(deepest, 0.5 - in_below.z());
    }
  }
  return deepest;
}

void IncludeFrame(const Column& column, std::span<const Body> start, double dt, ColumnWorst* worst) {
  const World& world = column.world;
  std::vector<Vector3> impulses(world.bodies().size(), Vector3::Zero());  // from below, by the upper cube's number
  for (size_t c = 0; c < world.resolved_contacts().size(); ++c)
    impulses[world.resolved_contacts()[c].body_b] += world.impulses()[c];
  double load = 0;  // [N s] of all that is above
  Body ground;
  ground.position_W = {0, 0, -0.5};
  for (size_t i = column.cubes.size(); i-- > 0;) {
    const int cube = column.cubes[i];
    load += column.masses[i] * kGravity * dt;
    worst->load = std::max(worst->load, std::abs(impulses[cube].z() / load - 1));
    worst->side = std::max(worst->side, impulses[cube].head<2>().norm() / load);
    const Body& body = world.body(cube);
    worst->overlap = std::max(worst->overlap, Overlap(i == 0 ? ground : world.body(column.cubes[i - 1]), body));
    worst->travel = std::max(worst->travel, Travel(world.shape(cube), start[cube], body));
    worst->speed = std::max(worst->speed, body.linear_velocity_W.norm() + body.radius * body.angular_velocity_W.norm());
  }
}

ColumnWorst RunColumn(const CheckSettings& settings, const std::vector<double>& masses, double seconds) {
  Column column = BuildColumn(settings.engine, masses);
  const std::vector<Body> start(column.world.bodies().begin(), column.world.bodies().end());
  ColumnWorst worst;
  for (int frame = 0; frame < Frames(seconds, settings.dt); ++frame) {
    column.world.Step(settings.dt);
    IncludeFrame(column, start, settings.dt, &worst);
  }
  return worst;
}

ColumnWorst Worse(const ColumnWorst& x, const ColumnWorst& y) {
  return {std::max(x.load, y.load), std::max(x.side, y.side), std::max(x.overlap, y.overlap),
          std::max(x.travel, y.travel), std::max(x.speed, y.speed)};
}

// Nothing should move. What the solver's tolerance of 1e-6 g dt per step would allow is a creep of 1e-6 g dt, 1e-5 m in a
// minute at 60 Hz; the bound is a tenth of that, and a millionth of a side.
void ReportRest(const std::string& name, const ColumnWorst& worst, Measurements* out) {
  out->AtMost("worst sideways force, " + name, "of the load", worst.side, 1e-6);
  out->AtMost("deepest overlap, " + name, "side", worst.overlap, 1e-6);
  out->AtMost("farthest travel of a corner, " + name, "m", worst.travel, 1e-6);
  out->AtMost("fastest point, " + name, "m/s", worst.speed, 1e-6);
}

}  // namespace

void MeasureColumn(const CheckSettings& settings, Measurements* out) {
  const auto column = [&](int cubes, double seconds) {
    const std::string frames = std::to_string(Frames(seconds, settings.dt)) + " frames";
    const std::string name = std::to_string(cubes) + " cubes, " + frames;
    const ColumnWorst worst = RunColumn(settings, std::vector<double>(cubes, 1.0), seconds);
    out->AtMost("worst contact load, " + name, "of the load", worst.load, 1e-6);
    ReportRest(name, worst, out);
  };
  column(10, 60);
  column(100, settings.quick ? 3 : 60);
  if (!settings.quick) column(1000, 0.1);
}

void MeasureHeavyOnLight(const CheckSettings& settings, Measurements* out) {
  ColumnWorst all;
  const auto column = [&](const std::string& name, const std::vector<double>& masses) {
    const ColumnWorst worst = RunColumn(settings, masses, 10);
    out->AtMost("worst contact load, " + name, "of the load", worst.load, 1e-6);
    all = Worse(all, worst);
  };
  for (int exponent = 2; exponent <= 6; exponent += 2) {
    const double ratio = std::pow(10.0, exponent);
    const std::string name = "1 : 1e" + std::to_string(exponent);
    column(name + ", the heavy on the light", {1, ratio});
    column(name + ", the light on the heavy", {ratio, 1});
  }
  column("masses 1, 100, 1, 100, 1", {1, 100, 1, 100, 1});
  column("masses 100, 1, 100, 1, 100", {100, 1, 100, 1, 100});
  ReportRest("all of these, 10 s", all, out);
}

}  // namespace islet::verify
