// Things that slide fast: T4 a cube that stops, T5 one contact that must not lift off, T6 a sphere that hits the floor askew.
#include <algorithm>
#include <cmath>
#include <numbers>

#include "scenes/verify/builders.h"
#include "scenes/verify/friction_family.h"

namespace islet::verify {
namespace {

constexpr double kRadius = 0.5;  // [m]

struct Stop {
  double way = 0, time = 0;    // [m], [s]
  double heading = 0;          // [rad] off the direction it was sent in
  double apex = 0, drift = 0;  // [m] highest of its centre, and farthest of a corner of its foot from the floor
};

Stop SlideToStop(const CheckSettings& settings, double speed, double friction, double azimuth, double longest) {
  World world(settings.engine);
  world.Add(Floor(friction));
  BodyDefinition definition = BoxOnIncline({0.05, 0.05, 0.05}, 0, friction);
  const Vector3 direction(std::cos(azimuth), std::sin(azimuth), 0);
  definition.linear_velocity_W = speed * direction;
  const int cube = world.Add(definition);
  const Body start = world.body(cube);
  Stop stop;
  while (world.time() < longest && world.body(cube).linear_velocity_W.norm() > 1e-9) {
    world.Step(settings.dt);
    const Body& body = world.body(cube);
    stop.apex = std::max(stop.apex, body.position_W.z() - start.position_W.z());
    stop.drift = std::max(stop.drift, FootDrift(world, cube, start));
  }
  const Vector3 way = world.body(cube).position_W - start.position_W;
  stop.way = way.norm();
  stop.time = world.time();
  stop.heading = std::atan2(direction.cross(way).z(), direction.dot(way));
  return stop;
}

// One sphere that touches the floor and moves like this, one frame later. Without gravity a bounce shows as it is.
Body AfterOneFrame(const CheckSettings& settings, const Settings& engine, double friction, double restitution,
                   const Vector3& velocity, const Vector3& spin) {
  World world(engine);
  world.Add(Floor(friction, restitution));
  BodyDefinition definition = Ball({0, 0, kRadius}, kRadius, friction, restitution);
  definition.linear_velocity_W = velocity;
  definition.angular_velocity_W = spin;
  const int ball = world.Add(definition);
  world.Step(settings.dt);
  return world.body(ball);
}

// Bounces go through the priority queue as a rule; with a limit of none the collision problem has to do them.
struct BouncePath {
  const char* name;
  Settings engine;
};

std::vector<BouncePath> BouncePaths(const Settings& engine) {
  BouncePath queue{"by the queue", engine}, problem{"by the collision problem", engine};
  queue.engine.gravity = problem.engine.gravity = Vector3::Zero();
  problem.engine.bounce_limit = 0;
  return {queue, problem};
}

struct Twist6 {
  Vector3 velocity, spin;
};

// The contact point of a solid sphere moves with u = v + w x (-r n). A tangential impulse J changes u by (1 + 5/2) J / m, so
// J = -2/7 m u_t makes it grip; where that is more than mu times the normal impulse (1 + e) m |v_n| it slides, and J is that.
Twist6 ObliqueBounce(double friction, double restitution, const Vector3& velocity, const Vector3& spin) {
  const Vector3 normal = Vector3::UnitZ(), arm = -kRadius * normal;
  const Vector3 slip = velocity + spin.cross(arm) - velocity.z() * normal;
  const double push = (1 + restitution) * -velocity.z();  // per mass, like all below
  const bool grips = 2.0 / 7 * slip.norm() <= friction * push;
  const Vector3 tangential = grips ? Vector3(-2.0 / 7 * slip) : Vector3(-friction * push * slip.normalized());
  return {velocity + push * normal + tangential, spin + arm.cross(tangential) / (0.4 * kRadius * kRadius)};
}

}  // namespace

// The speed falls by mu g dt per frame, and a frame moves by its mean velocity, so the way is exact but for the last frame:
// there a fraction f of a frame's braking is left and takes a whole frame instead of f of one, which adds
// mu g dt^2 f (1 - f) / 2 <= mu g dt^2 / 8. The stop is seen at the end of that frame.
void MeasureStop(const CheckSettings& settings, Measurements* out) {
  constexpr double kSpeed = 6, kFriction = 0.5;
  const double way = kSpeed * kSpeed / (2 * kFriction * kGravity), time = kSpeed / (kFriction * kGravity);
  const double step_error = kFriction * kGravity * settings.dt * settings.dt / 8;
  Stop worst;
  double worst_way = way, worst_time = time;
  for (const double degrees : {0.0, 10.0, 22.5, 33.0, 45.0}) {
    const Stop stop = SlideToStop(settings, kSpeed, kFriction, Radians(degrees), 3 * time);
    if (!(std::abs(stop.way - way) <= std::abs(worst_way - way))) worst_way = stop.way;
    if (!(std::abs(stop.time - time) <= std::abs(worst_time - time))) worst_time = stop.time;
    worst.heading = std::max(worst.heading, std::abs(stop.heading));
    worst.apex = std::max(worst.apex, stop.apex);
    worst.drift = std::max(worst.drift, stop.drift);
  }
  out->Absolute("stopping distance, worst of 5 headings", "m", way, worst_way, step_error + 1e-6 * way);
  out->Absolute("time to stop", "s", time, worst_time, settings.dt * (1 + 1e-6));
  out->AtMost("heading error", "rad", worst.heading, 1e-6);
  out->AtMost("apex of the flight it must not take", "m", worst.apex, 1e-9);
  out->AtMost("a corner of its foot off the floor", "m", worst.drift, ToleratedDrift(settings, time));
}

void MeasureLiftOff(const CheckSettings& settings, Measurements* out) {
  double resting = 0;
  for (const double friction : {0.1, 0.5, 1.0})
    for (const double slip : {0.1, 1.0, 10.0}) {
      const Body ball = AfterOneFrame(settings, settings.engine, friction, 0, {slip, 0.5 * slip, 0}, Vector3::Zero());
      resting = std::max(resting, ball.linear_velocity_W.z() / (friction * std::hypot(slip, 0.5 * slip)));
    }
  out->AtMost("lift-off of a resting contact, over mu u_t", "", resting, 1e-9);
  for (const BouncePath& path : BouncePaths(settings.engine)) {
    double worst = 0;
    for (const double friction : {0.1, 0.5, 1.0})
      for (const double slip : {0.0, 0.1, 1.0, 10.0})
        for (const double restitution : {0.0, 0.2, 0.5, 1.0})
          for (const double approach : {0.5, 2.0}) {
            const Body ball = AfterOneFrame(settings, path.engine, friction, restitution, {slip, 0.5 * slip, -approach},
                                            Vector3::Zero());
            const double error = std::abs(ball.linear_velocity_W.z() - restitution * approach) / approach;
            if (!(error <= worst)) worst = error;
          }
    out->AtMost(std::string("rebound off e |u_n-|, over |u_n-|, ") + path.name, "", worst, 1e-9);
  }
}

void MeasureObliqueBounce(const CheckSettings& settings, Measurements* out) {
  const Vector3 velocities[] = {{1, 0, -2}, {0.3, -0.4, -1}, {5, 2, -1}, {12, -3, -2}, {0, 0, -1}};
  const Vector3 spins[] = {{0, 0, 0}, {0, 6, 3}, {-2, -20, 1}, {40, 30, -5}};
  for (const BouncePath& path : BouncePaths(settings.engine)) {
    double worst[2] = {0, 0};  // slides, grips
    for (const Vector3& velocity : velocities)
      for (const Vector3& spin : spins)
        for (const double friction : {0.1, 0.5, 1.0})
          for (const double restitution : {0.0, 0.5, 1.0}) {
            const Body ball = AfterOneFrame(settings, path.engine, friction, restitution, velocity, spin);
            const Twist6 expected = ObliqueBounce(friction, restitution, velocity, spin);
            const Vector3 slip = expected.velocity + expected.spin.cross(Vector3(0, 0, -kRadius));
            const bool grips = std::hypot(slip.x(), slip.y()) < 1e-9;
            const double error = std::max((ball.linear_velocity_W - expected.velocity).norm(),
                                          kRadius * (ball.angular_velocity_W - expected.spin).norm()) /
                                 (velocity.norm() + kRadius * spin.norm());
            if (!(error <= worst[grips])) worst[grips] = error;
          }
    out->AtMost(std::string("where it slides: velocity and spin, over speed, ") + path.name, "", worst[0], 1e-9);
    out->AtMost(std::string("where it grips: velocity and spin, over speed, ") + path.name, "", worst[1], 1e-9);
  }
}

}  // namespace islet::verify
