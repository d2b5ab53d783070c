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
  out->AtMost(name + ": off the straight path", "m", off, 1e-6 * v.norm() * frames * h);
}

struct Glide {
  const char* name;
  Vector3 from, along;
  double friction, speed, turn;
};

constexpr double kRadius = 0.25, kHalfSide = 0.3, kSpeed = 3;
const Vector3 kOblique = Vector3(1, 0.37, 0).normalized(), kDiagonal = Vector3(1, 1, 0).normalized();

// With friction the ball rolls from the start.
void MeasureBall(const CheckSettings& settings, const Glide& glide, Measurements* out) {
  World world(settings.engine);
  AddTiles(&world, glide.friction);
  const int ball = world.Add(Ball(glide.from, kRadius, glide.friction));
  const Vector3 spin = Vector3::UnitZ().cross(glide.along) * glide.speed / kRadius;
  world.SetVelocity(ball, glide.speed * glide.along, glide.friction > 0 ? spin : Vector3::Zero());
  MeasureStraight(settings, glide.name, &world, ball, out);
}

void MeasureCube(const CheckSettings& settings, const Glide& glide, Measurements* out) {
  World world(settings.engine);
  AddTiles(&world, 0);
  const int cube = world.Add({.shape = Shape::Box({kHalfSide, kHalfSide, kHalfSide}),
                              .mass = 1,
                              .position_W = glide.from,
                              .rotation_WB = Turn(glide.turn, Vector3::UnitZ()),
                              .friction = 0,
                              .restitution = 0});
  world.SetVelocity(cube, glide.speed * glide.along, Vector3::Zero());
  MeasureStraight(settings, glide.name, &world, cube, out);
}

// Gravity leans by 10 deg: the ball starts to roll by itself and gains 5/7 g sin th, over 6 seams.
void MeasureSlope(const CheckSettings& settings, Measurements* out) {
  constexpr double kSlope = 0.1745, kSeconds = 3;
  Settings engine = settings.engine;
  engine.gravity = kGravity * Vector3(std::sin(kSlope), 0, -std::cos(kSlope));
  World world(engine);
  AddTiles(&world, 0.5);
  const int ball = world.Add(Ball({1.3, 1.4, kRadius}, kRadius, 0.5));
  const int frames = Frames(kSeconds, settings.dt);
  StepTimes(&world, frames, settings.dt);
  out->Relative("ball from rest down a slope of tiles: acceleration", "m/s^2", kGravity * 5 / 7 * std::sin(kSlope),
                world.body(ball).linear_velocity_W.x() / (frames * settings.dt), 1e-6);
}

}  // namespace

void MeasureSeams(const CheckSettings& settings, Measurements* out) {
  const double r = kRadius;
  MeasureBall(settings, {"sliding ball", {1.3, 0.8, r}, kOblique, 0, kSpeed, 0}, out);
  MeasureBall(settings, {"rolling ball", {1.3, 0.8, r}, kOblique, 0.5, kSpeed, 0}, out);
  MeasureBall(settings, {"slow rolling ball", {1.3, 0.8, r}, kOblique, 0.5, 0.1, 0}, out);
  MeasureBall(settings, {"ball over tile corners", {1.5, 1.5, r}, kDiagonal, 0, kSpeed, 0}, out);
  MeasureBall(settings, {"ball along a seam", {1.3, 1, r}, Vector3::UnitX(), 0.5, kSpeed, 0}, out);
  MeasureSlope(settings, out);
  MeasureCube(settings, {"sliding cube", {1.3, 1.2, kHalfSide}, kOblique, 0, kSpeed, 0}, out);
  MeasureCube(settings, {"turned cube", {1.3, 1.2, kHalfSide}, kOblique, 0, kSpeed, 0.3}, out);
  MeasureCube(settings, {"cube along a diagonal", {1.3, 1.2, kHalfSide}, kDiagonal, 0, kSpeed, 0}, out);
  {
    World world(settings.engine);
    AddTiles(&world, 0);
    AddWall(&world);
    const int ball = world.Add(Ball({1.3, r, r}, r, 0));
    world.SetVelocity(ball, kSpeed * Vector3::UnitX(), Vector3::Zero());
    MeasureStraight(settings, "ball in the corner of floor and wall", &world, ball, out);
  }
  World world(settings.engine);
  AddTiles(&world, 0);
  const int post = world.Add(Ball({4, 2, r}, r, 0));
  const int ball = world.Add(Ball({1.3, 2 - 2 * r, r}, r, 0));
  world.SetVelocity(ball, kSpeed * Vector3::UnitX(), Vector3::Zero());
  MeasureStraight(settings, "ball that grazes a free ball", &world, ball, out);
  out->AtMost("grazed ball: speed", "m/s", world.body(post).linear_velocity_W.norm(), 1e-6 * kSpeed);
}

}  // namespace islet::verify
