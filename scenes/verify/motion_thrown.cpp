// T50, T51, T54, T55, T57: thrown bodies, heaps, and what meets in flight.
#include <algorithm>
#include <array>
#include <cmath>
#include <string>

#include "scenes/random.h"
#include "scenes/verify/motion_family.h"

namespace islet::verify {
namespace {

double FastestSpeed(const World& world) {
  double fastest = 0;
  for (const Body& b : world.bodies())
    if (b.kind == BodyKind::kDynamic)
      fastest = std::max(fastest, b.linear_velocity_W.norm() + b.radius * b.angular_velocity_W.norm());
  return fastest;
}

}  // namespace

void MeasureThrownRods(const CheckSettings& s, Measurements* out) {
  const struct {
    const char* name;
    Vector3 half;  // [m]
  } kThings[] = {{"pen", {0.07, 0.004, 0.004}},
                 {"match", {0.025, 0.001, 0.001}},
                 {"card", {0.044, 0.0315, 0.00015}},
                 {"needle", {0.15, 0.001, 0.001}},
                 {"wire", {0.5, 0.0005, 0.0005}}};
  for (const auto& thing : kThings) {
    SplitMix64 random(7);
    Watch watch;
    double left = 0;
    for (int k = 0; k < (s.quick ? 3 : 20); ++k) {
      World world(s.engine);
      world.Add(Floor(0.4, 0.3));
      BodyDefinition d{.shape = Shape::Box(thing.half), .position_W = {0, 0, 0.6}, .friction = 0.4, .restitution = 0.3};
      d.rotation_WB = random.Rotation(3);
      d.linear_velocity_W = {random.Uniform(-2, 2), random.Uniform(-2, 2), -3};
      d.angular_velocity_W = 30 * random.Direction();
      world.Add(d);
      const double energy = Energy(world);
      for (int i = 0; i < Frames(4, s.dt); ++i) watch.Step(&world, s.dt, energy);
      left = std::max(left, FastestSpeed(world));
    }
    watch.Report(thing.name, out);
    out->AtMost(std::string(thing.name) + ": speed after 4 s", "m/s", left, 1e-5);
  }
}

void MeasureCards(const CheckSettings& s, Measurements* out) {
  const int cards = s.quick ? 6 : 16;
  SplitMix64 random(3);
  World world(s.engine);
  world.Add(Floor(0.4, 0.1));
  for (int i = 0; i < cards; ++i) {
    BodyDefinition card{.shape = Shape::Box({0.044, 0.0315, 0.0015}), .friction = 0.4, .restitution = 0.1};
    card.position_W = {random.Uniform(-0.02, 0.02), random.Uniform(-0.02, 0.02), 0.1 + 0.06 * i};
    card.rotation_WB = random.Rotation(0.5);
    world.Add(card);
  }
  Watch watch;
  const double energy = Energy(world);
  for (int i = 0; i < Frames(4, s.dt); ++i) watch.Step(&world, s.dt, energy);
  out->AtMost("speed of the fastest of " + std::to_string(cards) + " cards after 4 s", "m/s", FastestSpeed(world),
              1e-4);
  watch.Report("the heap", out);
}

void MeasurePassing(const CheckSettings& s, Measurements* out) {
  Settings engine = s.engine;
  engine.gravity.setZero();
  double changed = 0, momentum = 0, energy_off = 0;
  int through = 0;
  for (const double apart :
       {0.87, 0.72, 0.3}) {  // the bodies' half diagonal is 0.433: they miss, may touch, must touch
    SplitMix64 random(9);
    for (int k = 0; k < (s.quick ? 4 : 16); ++k) {
      World world(engine);
      int numbers[2];
      for (int side = 0; side < 2; ++side) {
        BodyDefinition box = Cube({side ? 3.0 : -3.0, side ? apart : 0, 0}, 0, 1);
        box.shape = Shape::Box({0.25, 0.25, 0.25});
        box.rotation_WB = random.Rotation(3);
        box.linear_velocity_W = {side ? -15.0 : 15.0, 0, 0};
        box.angular_velocity_W = 25 * random.Direction();
        numbers[side] = world.Add(box);
      }
      const Vector3 start = Momentum(world);
      const double energy = KineticEnergy(world), brought = 2 * 15;
      for (int i = 0; i < Frames(0.4, s.dt); ++i) {
        const Vector3 before = world.body(numbers[0]).linear_velocity_W;
        through += world.Step(s.dt).ledger.sides_changed;
        if (world.impulses().empty())
          changed = std::max(changed, (world.body(numbers[0]).linear_velocity_W - before).norm() / 15);
        else if (apart > 0.866)
          changed = INFINITY;
      }
      momentum = std::max(momentum, (Momentum(world) - start).norm() / brought);
      energy_off = std::max(energy_off, std::abs(KineticEnergy(world) / energy - 1));
    }
  }
  out->AtMost("change of velocity without a contact", "of 15 m/s", changed, 0);
  out->AtMost("momentum", "of what they bring", momentum, 1e-12);
  out->AtMost("energy, e = 1, no friction", "of the start's", energy_off, 1e-9);
  out->Absolute("boxes that pass through", "", 0, through, 0);
}

// A ball of 7 kg at ten pins of 1.5 kg, as boxes; from straight ahead to beside.
void MeasureBowling(const CheckSettings& s, Measurements* out) {
  Watch watch;
  int hit = 0, fewest = 10;
  double overlap = 0;
  for (const double aside : {0.0, 0.07, 0.2}) {
    World world(s.engine);
    world.Add(Floor(0.2, 0.3));
    for (int row = 0; row < 4; ++row)
      for (int i = 0; i <= row; ++i) {
        BodyDefinition pin{.shape = Shape::Box({0.03, 0.03, 0.19}), .friction = 0.3, .restitution = 0.4};
        pin.mass = 1.5;
        pin.position_W = {0.264 * row, 0.305 * (i - 0.5 * row), 0.19};
        world.Add(pin);
      }
    BodyDefinition ball = Ball({-1, aside, 0.109}, 0.109, 0.2, 0.4, 7);
    ball.linear_velocity_W = {8, 0, 0};
    ball.angular_velocity_W = {0, 8 / 0.109, 0};
    world.Add(ball);
    const double energy = Energy(world);
    for (int i = 0; i < Frames(s.quick ? 1 : 2, s.dt); ++i) {
      watch.Step(&world, s.dt, energy);
      for (const Contact& c : world.contacts()) overlap = std::max(overlap, -c.gap);
    }
    int fell = 0;
    for (int pin = 1; pin <= 10; ++pin) fell += (world.body(pin).rotation_WB * Vector3::UnitZ()).z() < 0.7;
    hit += fell;
    fewest = std::min(fewest, fell);
  }
  // Straight ahead, the first takes the one in the middle along, and both pass between the others.
  out->Verdict("pins fall in every throw", true, hit >= 3 * 3 && fewest >= 2);
  out->AtMost("deepest overlap", "m", overlap, 2.5e-4 * 0.06);
  watch.Report("all throws", out);
}

void MeasureClosedShell(const CheckSettings& s, Measurements* out) {
  Settings engine = s.engine;
  engine.gravity.setZero();
  SplitMix64 random(13);
  constexpr double kHalf = 1, kThick = 0.02;
  int escaped = 0;
  double lost = 0;
  Watch watch;
  for (int k = 0; k < (s.quick ? 3 : 10); ++k) {
    World world(engine);
    for (int axis = 0; axis < 3; ++axis)
      for (const double side : {-1.0, 1.0}) {
        Vector3 half = Vector3::Constant(kHalf + kThick), place = Vector3::Zero();
        half[axis] = 0.5 * kThick;
        place[axis] = side * (kHalf + 0.5 * kThick);
        world.Add({.shape = Shape::Box(half),
                   .kind = BodyKind::kFixed,
                   .position_W = place,
                   .friction = 0,
                   .restitution = 1});
      }
    const std::array<Vector3, 6> corners{Vector3(0.2, 0, 0),  Vector3(-0.2, 0, 0), Vector3(0, 0.2, 0),
                                         Vector3(0, -0.2, 0), Vector3(0, 0, 0.05), Vector3(0, 0, -0.05)};
    BodyDefinition flat{
        .shape = Shape::ConvexHull(corners), .position_W = {0.1, 0, 0}, .friction = 0, .restitution = 1};
    flat.mass = 1;
    flat.rotation_WB = random.Rotation(3);
    flat.linear_velocity_W = 20 * random.Direction();
    flat.angular_velocity_W = 30 * random.Direction();
    BodyDefinition ball = Ball({-0.6, 0.3, 0.2}, 0.1, 0, 1, 0.01);
    ball.linear_velocity_W = 40 * random.Direction();
    const int numbers[] = {world.Add(flat), world.Add(ball)};
    const double energy = KineticEnergy(world);
    for (int i = 0; i < Frames(1, s.dt); ++i) watch.Step(&world, s.dt, energy);
    lost = std::max(lost, std::abs(KineticEnergy(world) / energy - 1));
    for (const int number : numbers) escaped += world.body(number).position_W.cwiseAbs().maxCoeff() > kHalf;
  }
  out->Absolute("bodies that escape", "", 0, escaped, 0);
  out->AtMost("change of energy in 1 s, e = 1, no friction", "of the start's", lost, 1e-9);
  watch.Report("octahedron and ball", out);
}

}  // namespace islet::verify
