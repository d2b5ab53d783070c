#include <algorithm>
#include <cmath>
#include <random>
#include <string>

#include "scenes/verify/builders.h"
#include "scenes/verify/impact_family.h"

namespace islet::verify {
namespace {

// 27 spinning bodies that fly into each other. Boxes with three different edges: their free rotation is not trivial.
World BuildCloud(const CheckSettings& settings, bool boxes, double friction, double restitution) {
  World world(Weightless(settings.engine));
  std::mt19937 rng(31);
  const auto uniform = [&rng] {
    return 2.0 * static_cast<double>(rng()) / 4294967295.0 - 1;
  };  // the same on every platform
  const auto vector = [&uniform] {
    const double x = uniform(), y = uniform(), z = uniform();
    return Vector3(x, y, z);
  };
  for (int i = 0; i < 27; ++i) {
    const Vector3 place(2.0 * (i % 3 - 1), 2.0 * (i / 3 % 3 - 1), 2.0 * (i / 9 - 1));
    BodyDefinition body = boxes ? Cube(place, friction, restitution) : Ball(place, 0.5, friction, restitution);
    const Vector3 axis = vector();
    if (boxes) body.shape = Shape::Box({0.4, 0.5, 0.6}), body.rotation_WB = Turn(axis.x(), axis + Vector3(0, 0, 2));
    body.mass = 1.5 + uniform();
    body.linear_velocity_W = -2 * place + vector();
    body.angular_velocity_W = 3 * vector();
    world.Add(body);
  }
  return world;
}

// Momenta are compared with the sum of the sizes of what all bodies bring along: sums to zero have no scale of their own.
struct Scales {
  double momentum = 0, angular = 0;
};

Scales ScalesOf(const World& world) {
  Scales scales;
  for (const Body& body : world.bodies()) {
    const Vector3 p = body.mass * body.linear_velocity_W;
    scales.momentum += p.norm();
    scales.angular += body.position_W.norm() * p.norm() + body.AngularMomentumW().norm();
  }
  return scales;
}

void RunCloud(const CheckSettings& settings, bool boxes, double friction, double restitution, Measurements* out) {
  World world = BuildCloud(settings, boxes, friction, restitution);
  const Scales scales = ScalesOf(world);
  const Vector3 momentum = Momentum(world), angular = AngularMomentum(world);
  const double start = KineticEnergy(world);
  double momentum_error = 0, angular_error = 0, rise = 0, energy = start;
  int met = 0;
  for (int frame = 0; frame < Frames(settings.quick ? 2 : 4, settings.dt); ++frame) {
    const StepReport report = world.Step(settings.dt);
    met += report.contacts + report.bounces;
    momentum_error = std::max(momentum_error, (Momentum(world) - momentum).norm() / scales.momentum);
    angular_error = std::max(angular_error, (AngularMomentum(world) - angular).norm() / scales.angular);
    const double now = KineticEnergy(world);
    rise = std::max(rise, (now - energy) / start);
    energy = now;
  }
  const std::string which = std::string(boxes ? ", boxes" : ", balls") +
                            ", e = " + std::to_string(restitution).substr(0, 3) +
                            (friction > 0 ? ", mu = 0.5" : ", mu = 0");
  out->AtMost("momentum" + which, "", momentum_error, 1e-12);
  out->AtMost("angular momentum" + which, "", angular_error, 1e-12);
  out->AtMost("rise of energy in a frame" + which, "", rise,
              boxes ? Ledger::kMostEnergy : 1e-12);  // at the end 27 boxes jam: a crowd
  if (restitution == 1 && friction == 0) out->Relative("energy" + which, "J", start, energy, 1e-10);
  out->Verdict("bodies met" + which, true, met > 20);
}

}  // namespace

void MeasureCloud(const CheckSettings& settings, Measurements* out) {
  for (const bool boxes : {false, true})
    for (const double restitution : {0.0, 0.5, 1.0})
      for (const double friction : {0.0, 0.5}) RunCloud(settings, boxes, friction, restitution, out);
}

// 216 spheres of 10 kg, radius 0.1, in a lattice with gaps, each a little off its place; on a frictionless floor, so nothing
// holds the heap together once it is down.
void MeasureSphereLattice(const CheckSettings& settings, Measurements* out) {
  for (const double restitution : {0.0, 1.0}) {
    World world(settings.engine);
    world.Add(Floor(0, restitution));
    std::mt19937 rng(666);
    const auto uniform = [&rng] { return 2.0 * static_cast<double>(rng()) / 4294967295.0 - 1; };
    for (int i = 0; i < 216; ++i) {
      const double x = 0.3 * (i % 6) + 0.01 * uniform(), y = 0.3 * (i / 6 % 6) + 0.01 * uniform();
      world.Add(Ball({x, y, 0.4 + 0.3 * (i / 36) + 0.01 * uniform()}, 0.1, 0, restitution, 10));
    }
    const double start = Energy(world);
    double deepest = 0, rise = 0, energy = start, off = 0;
    for (int frame = 0; frame < Frames(settings.quick ? 1.5 : 4, settings.dt); ++frame) {
      deepest = std::max(deepest, world.Step(settings.dt).penetration_max);
      const double now = Energy(world);
      rise = std::max(rise, (now - energy) / start);
      off = std::max(off, std::abs(now / start - 1));
      energy = now;
    }
    const std::string which = restitution == 1 ? ", e = 1" : ", e = 0";
    double squares = 0;  // [m^2] of overlap, over all pairs
    for (const Contact& c : world.contacts()) squares += c.gap < 0 ? c.gap * c.gap : 0;
    out->AtMost("deepest overlap" + which, "m", deepest, 2e-3 * 0.2,
                "2e-3 of a diameter: what a crowd's step may leave");
    out->AtMost("mean squared overlap at the end" + which, "m^2", squares / 216, 1e-9);
    const std::string note =
        "a correction that lifts what something supports is for nothing, and in the paper every one";
    out->AtMost("rise of energy in a frame" + which, "", rise, 1e-6, note);
    out->Open();
    if (restitution < 1) continue;
    out->AtMost("energy off" + which, "", off, 1e-3, note);
    if (settings.engine.bounce_law != BounceLaw::kExact) out->Open();
  }
}

}  // namespace islet::verify
