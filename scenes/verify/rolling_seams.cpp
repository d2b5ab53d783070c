// T30: things that slide or roll over the seams of coplanar tiles, on a floor and along a wall, and past what they graze.
#include <algorithm>
#include <cmath>
#include <string>

#include "scenes/verify/builders.h"
#include "scenes/verify/rolling_checks.h"

namespace islet::verify {
namespace {

constexpr int kTiles = 8;           // a side, of 1 m
constexpr double kThickness = 0.5;  // [m] of a tile

void AddTiles(World* world, double friction) {
  for (int x = 0; x < kTiles; ++x)
    for (int y = 0; y < kTiles; ++y)
      world->Add({.shape = Shape::Box({0.5, 0.5, kThickness / 2}),
                  .kind = BodyKind::kFixed,
                  .position_W = {x + 0.5, y + 0.5, -kThickness / 2},
                  .friction = friction,
                  .restitution = 0});
}

// A wall of tiles over y = 0, its face towards +y.
void AddWall(World* world) {
  for (int x = 0; x < kTiles; ++x)
    world->Add({.shape = Shape::Box({0.5, kThickness / 2, 0.5}),
                .kind = BodyKind::kFixed,
                .position_W = {x + 0.5, -kThickness / 2, 0.5},
                .friction = 0,
                .restitution = 0});
}

// Runs `body` for as long as the tiles reach and measures how far it leaves the straight line it began.
void MeasureStraight(const CheckSettings& settings, const std::string& name, World* world, int body,
                     Measurements* out) {
  const double h = settings.dt;
  const Body start = world->body(body);
  const Vector3 v = start.linear_velocity_W;
  double kick = 0, height = 0, off = 0, turn = 0;
  const int frames = Frames(6 / v.norm(), h);
  for (int i = 1; i <= frames; ++i) {
    world->Step(h);
    const Body& b = world->body(body);
    kick = std::max(kick, (b.linear_velocity_W - v).norm());
    turn = std::max(turn, (b.angular_velocity_W - start.angular_velocity_W).norm());
    height = std::max(height, std::abs(b.position_W.z() - start.position_W.z()));
    off = std::max(off, (b.position_W - start.position_W - i * h * v).norm());
  }
  out->AtMost(name + ": change of velocity", "m/s", kick, 1e-6 * v.norm());
  out->AtMost(name + ": change of spin", "rad/s", turn, 1e-6 * v.norm());
  out->AtMost(name + ": height off the tiles", "m", height, 1e-7);
  out->AtMost(name + ": off the straight path", "m", off, 1e-6);
}

}  // namespace

void MeasureSeams(const CheckSettings& settings, Measurements* out) {
  constexpr double r = 0.25, speed = 3;
  const Vector3 oblique = Vector3(1, 0.37, 0).normalized(), diagonal = Vector3(1, 1, 0).normalized();
  const auto with_ball = [&](const std::string& name, const Vector3& from, const Vector3& along, double friction) {
    World world(settings.engine);
    AddTiles(&world, friction);
    const int ball = world.Add(Ball(from, r, friction));
    world.SetVelocity(ball, speed * along,
                      friction > 0 ? Vector3(Vector3::UnitZ().cross(along) * speed / r) : Vector3::Zero());
    MeasureStraight(settings, name, &world, ball, out);
  };
  with_ball("sliding ball", {1.3, 0.8, r}, oblique, 0);
  with_ball("rolling ball", {1.3, 0.8, r}, oblique, 0.5);
  with_ball("ball over tile corners", {1.5, 1.5, r}, diagonal, 0);
  with_ball("ball along a seam", {1.3, 1, r}, Vector3::UnitX(), 0.5);
  for (const auto& [along, turn, name] : {std::tuple{oblique, 0.0, "sliding cube"},
                                          {oblique, 0.3, "turned cube"},
                                          {diagonal, 0.0, "cube along a diagonal"}}) {
    World world(settings.engine);
    AddTiles(&world, 0);
    BodyDefinition cube = {.shape = Shape::Box({0.3, 0.3, 0.3}),
                           .mass = 1,
                           .position_W = {1.3, 1.2, 0.3},
                           .rotation_WB = Turn(turn, Vector3::UnitZ()),
                           .friction = 0,
                           .restitution = 0};
    const int body = world.Add(cube);
    world.SetVelocity(body, speed * along, Vector3::Zero());
    MeasureStraight(settings, name, &world, body, out);
  }
  {
    World world(settings.engine);
    AddTiles(&world, 0);
    AddWall(&world);
    const int ball = world.Add(Ball({1.3, r, r}, r, 0));
    world.SetVelocity(ball, speed * Vector3::UnitX(), Vector3::Zero());
    MeasureStraight(settings, "ball in the corner of floor and wall", &world, ball, out);
  }
  {
    World world(settings.engine);
    AddTiles(&world, 0);
    const int post = world.Add(Ball({4, 2, r}, r, 0));
    world.SetVelocity(post, Vector3::Zero(), Vector3::Zero());
    const int ball = world.Add(Ball({1.3, 2 - 2 * r, r}, r, 0));
    world.SetVelocity(ball, speed * Vector3::UnitX(), Vector3::Zero());
    MeasureStraight(settings, "ball that grazes a free ball", &world, ball, out);
    out->AtMost("grazed ball: speed", "m/s", world.body(post).linear_velocity_W.norm(), 1e-6 * speed);
  }
}

}  // namespace islet::verify
