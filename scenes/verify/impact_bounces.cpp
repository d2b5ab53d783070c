#include <algorithm>
#include <cmath>
#include <string>

#include "scenes/verify/builders.h"
#include "scenes/verify/impact_family.h"

namespace islet::verify {
namespace {

constexpr double kRadius = 0.5, kHeight = 1;  // [m]

std::string Named(const std::string& what, double restitution) {
  return what + ", e = " + std::to_string(restitution).substr(0, restitution == 1 ? 1 : 3);
}

struct Flight {
  double height = 0, apex_time = 0;  // [m] above the floor, [s]
};

// A body under gravity alone: the apex of the flight it is on, from its state at any moment of it.
Flight ApexOf(const World& world, int body, double rest_height) {
  const Body& b = world.body(body);
  const double speed = b.linear_velocity_W.z();
  return {b.position_W.z() - rest_height + 0.5 * speed * speed / kGravity, world.time() + speed / kGravity};
}

// The peak after n bounces is e^(2 n) h0, at the time t_n = sqrt(2 h0 / g) (1 + 2 (e + ... + e^(n-1)) + e^n): flights between
// bounces take 2 e^k sqrt(2 h0 / g). Peaks and times are read from each frame in which the ball has left the floor and not
// come back: energy and phase of the flight, free of what sampling at frames would lose. Flights shorter than four frames
// have no such frame for certain.
void MeasurePeaks(const CheckSettings& settings, double restitution, Measurements* out) {
  const int most = restitution == 1 ? 50 : 1000;
  World world(settings.engine);
  world.Add(Floor(0, restitution));
  const int ball = world.Add(Ball({0, 0, kRadius + kHeight}, kRadius, 0, restitution));
  const double fall = std::sqrt(2 * kHeight / kGravity);
  double worst_low = 0, worst_high = 0, worst_time = 0, last_speed = 0, expected = kHeight, apex = 0, rise = fall;
  int bounces = 0, due = 0;
  for (double up = fall; due < most && 2 * up > 4 * settings.dt; up *= restitution) ++due;
  while (bounces < most && 2 * rise > 4 * settings.dt && world.time() < 100) {
    world.Step(settings.dt);
    const double speed = world.body(ball).linear_velocity_W.z();
    if (last_speed < 0 && speed > 0) {
      ++bounces;
      expected *= restitution * restitution;
      apex += (1 + restitution) * rise;
      rise *= restitution;
    }
    last_speed = speed;
    if (bounces == 0 || speed <= 0) continue;
    const Flight flight = ApexOf(world, ball, kRadius);
    worst_low = std::max(worst_low, expected - flight.height);
    worst_high = std::max(worst_high, flight.height - expected);
    worst_time = std::max(worst_time, std::abs(flight.apex_time - apex));
  }
  if (bounces != due) worst_low = INFINITY;
  const std::string bounced = ", " + std::to_string(bounces) + " bounces";
  out->AtMost(Named("peaks too low", restitution) + bounced, "m", worst_low, restitution == 1 ? 1e-6 : 1e-5);
  out->AtMost(Named("peaks too high", restitution) + bounced, "m", worst_high, restitution == 1 ? 1e-6 : 1e-5);
  out->AtMost(Named("peaks early or late", restitution) + bounced, "s", worst_time, 1e-4);
}

// Zeno's ball: infinitely many bounces, all over at sqrt(2 h0 / g) (1 + e) / (1 - e), then rest. Seen at frames: + dt, and one
// more in which the last bounces are paid for.
void MeasureEnd(const CheckSettings& settings, double restitution, Measurements* out) {
  World world(settings.engine);
  world.Add(Floor(0, restitution));
  const int ball = world.Add(Ball({0, 0, kRadius + kHeight}, kRadius, 0, restitution));
  const double end = std::sqrt(2 * kHeight / kGravity) * (1 + restitution) / (1 - restitution);
  double moved = 0;  // [s] last moment at which it moved
  while (world.time() < end + 1) {
    world.Step(settings.dt);
    if (world.body(ball).linear_velocity_W.norm() > 1e-6) moved = world.time();
  }
  out->Absolute(Named("end of all bounces", restitution), "s", end, moved, 2 * settings.dt, "two frames");
  out->Absolute(Named("height at rest", restitution), "m", kRadius, world.body(ball).position_W.z(), 1e-5);
}

// No speed is too low: a ball that meets the floor as if dropped from a hair's breadth bounces on with e = 1, below what a
// frame can show (8 h > g dt^2).
void MeasureSmallBounces(const CheckSettings& settings, Measurements* out) {
  for (const double height : {1e-2, 1e-4, 1e-5}) {
    World world(settings.engine);
    world.Add(Floor(0, 1));
    BodyDefinition definition = Ball({0, 0, kRadius}, kRadius, 0, 1);
    definition.linear_velocity_W.z() = -std::sqrt(2 * kGravity * height);
    const int ball = world.Add(definition);
    double low = 0, high = 0;
    for (int frame = 0; frame < Frames(10, settings.dt); ++frame) {
      world.Step(settings.dt);
      const double now = ApexOf(world, ball, kRadius).height;
      low = std::max(low, height - now);
      high = std::max(high, now - height);
    }
    char name[64];
    std::snprintf(name, sizeof name, "energy lost in 10 s from h0 = %.0e m, e = 1", height);
    out->AtMost(name, "m", low, 1e-6);
    std::snprintf(name, sizeof name, "energy won in 10 s from h0 = %.0e m, e = 1", height);
    out->AtMost(name, "m", high, 1e-6);
  }
}

void DropCube(const CheckSettings& settings, bool pedestal, double friction, Measurements* out) {
  World world(settings.engine);
  if (pedestal) {
    world.Add({.shape = Shape::Box({0.25, 0.25, 0.5}),
               .kind = BodyKind::kFixed,
               .position_W = {0, 0, -0.5},
               .friction = friction,
               .restitution = 1});
  } else {
    world.Add(Floor(friction, 1));
  }
  const int cube = world.Add(Cube({0, 0, 0.5 + kHeight}, friction, 1));
  double low = 0, high = 0, spin = 0, away = 0;
  for (int frame = 0; frame < Frames(10, settings.dt); ++frame) {
    world.Step(settings.dt);
    const Body& b = world.body(cube);
    const double now = ApexOf(world, cube, 0.5).height;
    low = std::max(low, kHeight - now);
    high = std::max(high, now - kHeight);
    spin = std::max(spin, b.angular_velocity_W.norm());
    away = std::max(away, std::hypot(b.position_W.x(), b.position_W.y()));
  }
  const std::string where =
      std::string(pedestal ? ", pedestal" : ", floor") + (friction > 0 ? ", mu = 0.5" : ", mu = 0");
  out->AtMost("lower than dropped in 10 s" + where, "m", low, 1e-6);
  out->AtMost("higher than dropped in 10 s" + where, "m", high, 1e-6);
  out->AtMost("spin" + where, "rad/s", spin, 1e-9);
  out->AtMost("sideways" + where, "m", away, 1e-9);
}

}  // namespace

void MeasureBouncingBall(const CheckSettings& settings, Measurements* out) {
  for (const double restitution : {0.5, 0.9, 1.0}) MeasurePeaks(settings, restitution, out);
  for (const double restitution : {0.5, 0.9}) MeasureEnd(settings, restitution, out);
  MeasureSmallBounces(settings, out);
}

void MeasureBouncingCube(const CheckSettings& settings, Measurements* out) {
  for (const bool pedestal : {false, true})
    for (const double friction : {0.0, 0.5}) DropCube(settings, pedestal, friction, out);
}

}  // namespace islet::verify
