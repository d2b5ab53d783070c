// T37: a row of dominoes. Smooth faces, rough feet: then the train of those that fall and lean on each other has one degree
// of freedom, and its steady speed follows from energy between the hits and angular momentum in them.
//
// van Leeuwen, The domino effect, Am. J. Phys. 78 (2010), without friction between the faces. Height h, thickness d, gap s; a
// domino turns about its front lower edge by th. The front upper edge of the one behind, at th', slides on its back face:
//   h sin(th' - th) = (s + d) cos th - d,   d th' / d th = 1 - (s + d) sin th / (h cos(th' - th))
// It first meets the face of an upright one at sin th' = s / h. Potential energy m g (h cos th + d sin th) / 2, inertia about
// the edge I = m (h^2 + d^2) / 3; its head's speed sees the train as J = sum I (d th_i / d th_head)^2. The impulse of a hit is
// horizontal and has the same arm, h cos th', about both edges, so both turn with J / (J + I) of the old head's speed.
#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "scenes/verify/builders.h"
#include "scenes/verify/structure_measures.h"

namespace islet::verify {
namespace {

struct Row {
  double height = 1, thickness = 0.2, gap = 0.35, breadth = 0.5;  // [m]
  double Pitch() const { return gap + thickness; }
  double HitAngle() const { return std::asin(gap / height); }
};

// The train when its head stands at `angle`: per mass, of those that fall behind it, head included.
struct Train {
  double potential = 0;  // [m^2/s^2]
  double inertia = 0;    // [m^2] that the head's speed sees
};

Train TrainAt(const Row& row, double angle, int length) {
  Train train;
  const double one = (row.height * row.height + row.thickness * row.thickness) / 3;
  double weight = 1;  // d th_i / d th_head
  for (int i = 0; i < length; ++i) {
    train.potential += 0.5 * kGravity * (row.height * std::cos(angle) + row.thickness * std::sin(angle));
    train.inertia += one * weight * weight;
    const double lean = std::asin((row.Pitch() * std::cos(angle) - row.thickness) / row.height);
    weight *= 1 - row.Pitch() * std::sin(angle) / (row.height * std::cos(lean));
    angle += lean;
  }
  return train;
}

// [s] at which each of `count` dominoes leans by half the hit angle, if the first starts with `push` [rad/s].
std::vector<double> TheoryTimes(const Row& row, double push, int count) {
  constexpr int kSteps = 1000;  // even: of the way from upright to the hit
  std::vector<double> times;
  double time = 0, speed = push;
  for (int head = 0; head < count; ++head) {
    const Train start = TrainAt(row, 0, head + 1);
    const double energy = start.potential + 0.5 * start.inertia * speed * speed;
    const double step = row.HitAngle() / kSteps;
    const auto speed_at = [&](double angle) {
      const Train train = TrainAt(row, angle, head + 1);
      return std::sqrt(2 * (energy - train.potential) / train.inertia);
    };
    for (int k = 0; k < kSteps; ++k) {
      if (k == kSteps / 2) times.push_back(time);
      time += step / speed_at((k + 0.5) * step);
    }
    const double inertia = TrainAt(row, row.HitAngle(), head + 1).inertia;
    speed = inertia * speed_at(row.HitAngle()) / (inertia + TrainAt(row, 0, 1).inertia);
  }
  return times;
}

// The same, from the engine; NaN for those that were not hit.
std::vector<double> SimulatedTimes(const CheckSettings& settings, double dt, const Row& row, double push, int count) {
  World world(settings.engine);
  const int ground = world.Add(Floor());
  world.SetMaterialCallback([ground](const Contact& contact, const Body&, const Body&) {
    return Material{contact.body_a == ground ? 10.0 : 0.0, 0.0};
  });
  std::vector<int> dominoes;
  for (int i = 0; i < count; ++i)
    dominoes.push_back(world.Add({.shape = Shape::Box({0.5 * row.thickness, 0.5 * row.breadth, 0.5 * row.height}),
                                  .mass = 1,
                                  .position_W = {i * row.Pitch(), 0, 0.5 * row.height}}));
  const Vector3 spin(0, push, 0);  // about the front lower edge
  world.SetVelocity(dominoes[0], spin.cross(Vector3(-0.5 * row.thickness, 0, 0.5 * row.height)), spin);
  const double passed = 0.5 * row.HitAngle();  // [rad] a domino counts as hit when it leans so far
  std::vector<double> tilt(count, 0.0), times(count, NAN);
  for (int frame = 0; frame < Frames(0.5 * count, dt) && std::isnan(times.back()); ++frame) {
    world.Step(dt);
    for (int i = 0; i < count; ++i) {
      const double before = tilt[i];
      tilt[i] = std::acos(std::clamp((world.body(dominoes[i]).rotation_WB * Vector3::UnitZ()).z(), -1.0, 1.0));
      if (std::isnan(times[i]) && tilt[i] >= passed)
        times[i] = world.time() - dt * (tilt[i] - passed) / (tilt[i] - before);
    }
  }
  return times;
}

}  // namespace

// The step finds a hit up to dt late, so the error is of first order: half a step for each hit.
void MeasureDominoes(const CheckSettings& settings, Measurements* out) {
  constexpr double kPush = 2;  // [rad/s]
  constexpr int kFirst = 4;
  const Row row;
  const int last = settings.quick ? 10 : 20;
  const auto speed = [&](const std::vector<double>& times) {
    return (last - kFirst) * row.Pitch() / (times[last] - times[kFirst]) / std::sqrt(kGravity * row.height);
  };
  const double theory = speed(TheoryTimes(row, kPush, last + 1));
  const double coarse = speed(SimulatedTimes(settings, settings.dt, row, kPush, last + 3));
  const double fine = speed(SimulatedTimes(settings, settings.dt / 2, row, kPush, last + 3));
  const double hits_per_step = theory * std::sqrt(kGravity * row.height) * settings.dt / row.Pitch();
  out->Relative("speed of the wave", "sqrt(g h)", theory, coarse, 0.5 * hits_per_step);
  out->Relative("speed of the wave at half the step", "sqrt(g h)", theory, fine, 0.25 * hits_per_step);
  out->Relative("speed of the wave against that at half the step", "sqrt(g h)", fine, coarse, 0.5 * hits_per_step);
}

}  // namespace islet::verify
