// T46 to T49, T59: what is faster than a wall is thick, in a step.
#include <algorithm>
#include <cmath>
#include <string>

#include "scenes/random.h"
#include "scenes/verify/motion_family.h"

namespace islet::verify {
namespace {

constexpr double kThin = 0.02;  // [m]

BodyDefinition Plate(double thickness, BodyKind kind, double height) {
  BodyDefinition plate{.shape = Shape::Box({0.5, 0.5, 0.5 * thickness}), .kind = kind, .position_W = {0, 0, height}};
  plate.friction = 0.5;
  plate.restitution = 0.2;
  if (kind == BodyKind::kDynamic) plate.mass = 8;
  return plate;
}

// The plate's side of which a body is: where its centre is over or under it, in the plate's frame.
bool IsUnder(const Body& body, const Body& plate) {
  const Vector3 at = plate.rotation_WB.conjugate() * (body.position_W - plate.position_W);
  return std::abs(at.x()) < 0.45 && std::abs(at.y()) < 0.45 && at.z() < 0;
}

}  // namespace

void MeasureThinWalls(const CheckSettings& s, Measurements* out) {
  Settings engine = s.engine;
  engine.gravity.setZero();
  constexpr double kRestitution = 0.5;
  const int throws = s.quick ? 6 : 24;
  double off = 0;
  int through = 0, posts = 0;
  Watch watch;
  for (const double speed : {10.0, 30.0}) {
    for (int k = 0; k < throws; ++k) {  // hits at another part of the step each time
      World world(engine);
      world.Add({.shape = Shape::Box({0.5 * kThin, 2, 2}),
                 .kind = BodyKind::kFixed,
                 .friction = 0.5,
                 .restitution = kRestitution});
      BodyDefinition ball = Ball({-1 - k * speed * s.dt / throws, 0, 0}, 0.1, 0.5, kRestitution);
      ball.linear_velocity_W = {speed, 0, 0};
      ball.angular_velocity_W = {0, 0, 60};
      const int number = world.Add(ball);
      const double energy = KineticEnergy(world);
      for (int i = 0; i < Frames(0.3, s.dt); ++i) watch.Step(&world, s.dt, energy);
      through += world.body(number).position_W.x() > 0;
      off = std::max(off, std::abs(world.body(number).linear_velocity_W.x() / speed + kRestitution));
    }
  }
  for (const double speed : {3.0, 20.0}) {
    for (int k = 0; k < throws; ++k) {  // rolls on the floor at the middle of a post as thick as a finger
      World world(s.engine);
      world.Add(Floor(0.5, kRestitution));
      world.Add({.shape = Shape::Box({0.5 * kThin, 0.5 * kThin, 0.5}),
                 .kind = BodyKind::kFixed,
                 .position_W = {0, 0, 0.5},
                 .friction = 0.5,
                 .restitution = kRestitution});
      BodyDefinition ball = Ball({-1 - k * speed * s.dt / throws, 0, 0.1}, 0.1, 0.5, kRestitution);
      ball.linear_velocity_W = {speed, 0, 0};
      ball.angular_velocity_W = {0, speed / 0.1, 0};
      const int number = world.Add(ball);
      const double energy = KineticEnergy(world);
      for (int i = 0; i < Frames(0.5, s.dt); ++i) {
        watch.Step(&world, s.dt, energy);
        if (std::abs(world.body(number).position_W.y()) < 0.1 && world.body(number).position_W.x() > 0) {
          ++posts;
          break;
        }
      }
    }
  }
  out->Absolute("balls that pass a wall of 2 cm", "", 0, through, 0);
  out->AtMost("rebound off e v", "of v", off, 1e-9);
  out->Absolute("balls that roll through a post of 2 cm", "", 0, posts, 0);
  watch.Report("all throws", out);
}

void MeasureDice(const CheckSettings& s, Measurements* out) {
  const int dice = s.quick ? 20 : 100;
  for (const auto& [kind, name] : {std::pair(BodyKind::kFixed, "fixed"), std::pair(BodyKind::kKinematic, "kinematic"),
                                   std::pair(BodyKind::kDynamic, "dynamic")}) {
    SplitMix64 random(5);
    int through = 0;
    Watch watch;
    for (int k = 0; k < dice; ++k) {
      World world(s.engine);
      if (kind == BodyKind::kDynamic) {
        world.Add(Floor(0.5, 0.2));
        for (int leg = 0; leg < 4; ++leg)
          world.Add({.shape = Shape::Box({0.05, 0.05, 0.25}),
                     .kind = BodyKind::kFixed,
                     .position_W = {leg % 2 ? 0.4 : -0.4, leg / 2 ? 0.4 : -0.4, 0.25},
                     .friction = 0.5});
      }
      const int plate = world.Add(Plate(kThin, kind, 0.5 + 0.5 * kThin));
      BodyDefinition die{.shape = Shape::Box({0.01, 0.01, 0.01}), .friction = 0.4, .restitution = 0.4};
      die.mass = 0.01;
      die.position_W = {random.Uniform(-0.2, 0.2), random.Uniform(-0.2, 0.2), random.Uniform(0.8, 1.1)};
      die.rotation_WB = random.Rotation(3);
      die.linear_velocity_W = {random.Uniform(-0.5, 0.5), random.Uniform(-0.5, 0.5), -4};
      die.angular_velocity_W = 40 * random.Direction();
      const int number = world.Add(die);
      const double energy = KineticEnergy(world);
      for (int i = 0; i < Frames(0.6, s.dt); ++i) watch.Step(&world, s.dt, energy);
      through += IsUnder(world.body(number), world.body(plate));
    }
    out->Absolute(std::string(name) + " plate of 2 cm: dice that pass, of " + std::to_string(dice), "", 0, through, 0);
    watch.Report(std::string(name) + " plate", out);
  }
}

void MeasureCoins(const CheckSettings& s, Measurements* out) {
  SplitMix64 random(11);
  int through = 0;
  Watch watch;
  for (int k = 0; k < (s.quick ? 5 : 20); ++k) {
    World world(s.engine);
    world.Add(Floor(0.5, 0.2));
    BodyDefinition plate = Plate(0.01, BodyKind::kDynamic, 0.3);
    plate.mass = 2;
    const int top = world.Add(plate);
    for (int leg = 0; leg < 4; ++leg)
      world.Add(Ball({leg % 2 ? 0.35 : -0.35, leg / 2 ? 0.35 : -0.35, 0.1475}, 0.1475, 0.5, 0.2, 0.5));
    BodyDefinition coin{.shape = Shape::Box({0.02, 0.02, 0.002}), .friction = 0.5, .restitution = 0.2};
    coin.mass = 0.02;
    coin.position_W = {random.Uniform(-0.2, 0.2), random.Uniform(-0.2, 0.2), 0.6};
    coin.rotation_WB = random.Rotation(3);
    coin.linear_velocity_W = {0, 0, -15};
    coin.angular_velocity_W = 60 * random.Direction();
    const int number = world.Add(coin);
    const double energy = Energy(world);
    bool under = false;
    for (int i = 0; i < Frames(0.7, s.dt); ++i) {
      watch.Step(&world, s.dt, energy);
      under = under || IsUnder(world.body(number), world.body(top));
    }
    through += under;
  }
  out->Absolute("coins that pass a plate of 1 cm", "", 0, through, 0);
  watch.Report("all coins", out);
}

void MeasureTurningRod(const CheckSettings& s, Measurements* out) {
  int through = 0;
  Watch watch;
  for (const double turns : {2.0, 20.0, 100.0}) {  // [1/s]
    World world(s.engine);
    const int plate = world.Add(Plate(0.01, BodyKind::kFixed, -0.005));
    BodyDefinition rod{.shape = Shape::Box({0.25, 0.005, 0.005}), .friction = 0.3, .restitution = 0.5};
    rod.mass = 0.1;
    rod.position_W = {0, 0, 0.3};
    rod.angular_velocity_W = {0, turns * 6.283185307179586, 0};
    const int number = world.Add(rod);
    const double energy = Energy(world);
    for (int i = 0; i < Frames(1, s.dt); ++i) {
      watch.Step(&world, s.dt, energy);
      const Body& b = world.body(number);
      for (const double end : {-0.25, 0.25}) {  // of its axis; on the plate it may come to lie on 5 mm of itself
        const Vector3 tip = b.position_W + b.rotation_WB * Vector3(end, 0, 0);
        const Vector3 at = tip - world.body(plate).position_W;
        through += std::abs(at.x()) < 0.45 && std::abs(at.y()) < 0.45 && at.z() < 0.005;
      }
    }
  }
  out->Absolute("frames in which an end is within the plate or below it", "", 0, through, 0);
  watch.Report("the rod", out);
}

// 64 bodies, more than one small group holds, fly about in a box with walls of 2 cm.
void MeasureFastCrowd(const CheckSettings& s, Measurements* out) {
  constexpr double kInside = 1, kHalfWall = 0.01;  // [m]
  for (const bool tiles : {false, true}) {
    for (const double speed : {5.0, 20.0, 60.0}) {
      SplitMix64 random(11);
      Settings engine = s.engine;
      engine.gravity.setZero();
      World world(engine);
      for (int axis = 0; axis < 3; ++axis) {
        for (const double side : {-1.0, 1.0}) {
          Vector3 half = Vector3::Constant(kInside + 2 * kHalfWall);
          half[axis] = kHalfWall;
          world.Add({.shape = Shape::Box(half),
                     .kind = BodyKind::kFixed,
                     .position_W = side * (kInside + kHalfWall) * Vector3::Unit(axis),
                     .friction = 0.3,
                     .restitution = 0.8});
        }
      }
      for (int i = 0; i < 64; ++i) {
        BodyDefinition d{
            .shape = tiles ? Shape::Box({0.08, 0.06, 0.02}) : Shape::Sphere(0.08), .friction = 0.3, .restitution = 0.8};
        d.position_W = {-0.75 + 0.5 * (i % 4), -0.75 + 0.5 * (i / 4 % 4), -0.75 + 0.5 * (i / 16)};
        d.rotation_WB = random.Rotation(3);
        d.linear_velocity_W = speed * random.Direction();
        d.angular_velocity_W = 20 * random.Direction();
        world.Add(d);
      }
      Watch watch;
      const double energy = KineticEnergy(world);
      for (int i = 0; i < Frames(s.quick ? 0.2 : 0.5, s.dt); ++i) watch.Step(&world, s.dt, energy);
      int escaped = 0;
      for (const Body& b : world.bodies())
        escaped += b.kind == BodyKind::kDynamic && b.position_W.cwiseAbs().maxCoeff() > kInside;
      const std::string of =
          std::string(tiles ? "tiles" : "balls") + " of " + std::to_string(static_cast<int>(speed)) + " m/s";
      out->Absolute(of + ": outside", "", 0, escaped, 0);
      watch.Report(of, out);
    }
  }
}

}  // namespace islet::verify
