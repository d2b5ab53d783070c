#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "scenes/verify/builders.h"
#include "scenes/verify/impact_family.h"

namespace islet::verify {
namespace {

constexpr double kRadius = 0.5;  // [m]

struct Row {
  std::vector<double> masses;  // [kg]
  int incoming = 1;            // the first ones fly at 1 m/s, one gap before the others, and touch each other
  double gap = 0;              // [m] between those that wait
};

struct RowEnd {
  std::vector<double> speeds;       // [m/s] along the row
  double momentum = 0, energy = 0;  // changes, over what came in
  double sideways = 0;              // [m/s]
};

// Smooth elastic balls without weight, until every ball has had the time to fly through all gaps.
RowEnd RunRow(const CheckSettings& settings, const Row& row) {
  World world(Weightless(settings.engine));
  const int count = static_cast<int>(row.masses.size());
  double x = 0;
  for (int i = 0; i < count; ++i) {
    if (i > 0) x += 2 * kRadius;
    if (i == row.incoming) x += 0.3;
    if (i > row.incoming) x += row.gap;
    BodyDefinition ball = Ball({x, 0, 0}, kRadius, 0, 1, row.masses[i]);
    if (i < row.incoming) ball.linear_velocity_W = {1, 0, 0};
    world.Add(ball);
  }
  const double momentum = Momentum(world).x(), energy = KineticEnergy(world);
  StepTimes(&world, Frames(1.5 + 4 * row.gap * count, settings.dt), settings.dt);
  RowEnd end;
  for (int i = 0; i < count; ++i) {
    const Vector3& v = world.body(i).linear_velocity_W;
    end.speeds.push_back(v.x());
    end.sideways = std::max(end.sideways, std::hypot(v.y(), v.z()));
  }
  end.momentum = Momentum(world).x() / momentum - 1;
  end.energy = KineticEnergy(world) / energy - 1;
  return end;
}

void Compare(const std::string& name, const RowEnd& end, const std::vector<double>& expected, Measurements* out) {
  double worst = 0;
  for (size_t i = 0; i < expected.size(); ++i) worst = std::max(worst, std::abs(end.speeds[i] - expected[i]));
  out->AtMost("velocities, " + name, "m/s", std::max(worst, end.sideways), 1e-9);
  out->AtMost("momentum, " + name, "", std::abs(end.momentum), 1e-12);
  out->AtMost("energy, " + name, "", std::abs(end.energy), 1e-12);
}

}  // namespace

// Equal masses exchange velocities, so the front of k moving balls runs through the row. Masses that fall along the row: each
// hits the next at v' = 2 m v / (m + m') and follows it more slowly at (m - m') v / (m + m'), so that no two meet again and the
// answer is the same for balls that touch and balls that do not.
void MeasureCradle(const CheckSettings& settings, Measurements* out) {
  for (const int count : {3, 5, 10}) {
    for (const int incoming : {1, 2}) {
      for (const double gap : {0.0, 0.05}) {
        const RowEnd end = RunRow(settings, {std::vector<double>(count, 1.0), incoming, gap});
        std::vector<double> expected(count, 0.0);
        for (int i = count - incoming; i < count; ++i) expected[i] = 1;
        Compare(std::to_string(incoming) + " into " + std::to_string(count - incoming) + (gap > 0 ? " with gaps" : ""),
                end, expected, out);
      }
    }
  }
  for (const int count : {3, 5, 10}) {
    for (const double gap : {0.0, 0.05}) {
      Row row{.masses = {}, .incoming = 1, .gap = gap};
      for (int i = 0; i < count; ++i) row.masses.push_back(std::pow(0.8, i));
      std::vector<double> expected;
      double speed = 1;
      for (int i = 0; i + 1 < count; ++i) {
        const double m = row.masses[i], next = row.masses[i + 1];
        expected.push_back((m - next) / (m + next) * speed);
        speed *= 2 * m / (m + next);
      }
      expected.push_back(speed);
      Compare("masses falling by a fifth, " + std::to_string(count) + (gap > 0 ? " with gaps" : ""),
              RunRow(settings, row), expected, out);
    }
  }
}

// Impulses p along the lines of centres, 30 degrees off the way: momentum m v = m w + 2 p cos 30, targets p / m each; energy
// v^2 = w^2 + 2 p^2 / m^2 gives p = 2 sqrt(3) / 5 m v and w = -v / 5.
void MeasureSymmetricHit(const CheckSettings& settings, Measurements* out) {
  World world(Weightless(settings.engine));
  BodyDefinition ball = Ball({-2 * kRadius * std::sqrt(3.0) / 2 - 0.3, 0, 0}, kRadius, 0, 1);
  ball.linear_velocity_W = {1, 0, 0};
  world.Add(ball);
  for (const double side : {-1.0, 1.0}) world.Add(Ball({0, side * kRadius, 0}, kRadius, 0, 1));
  StepTimes(&world, Frames(1, settings.dt), settings.dt);
  const Vector3 hit = world.body(0).linear_velocity_W;
  const Vector3 right = world.body(1).linear_velocity_W, left = world.body(2).linear_velocity_W;
  const double speed = 2 * std::sqrt(3.0) / 5;
  out->Absolute("rebound", "m/s", -0.2, hit.x(), 1e-9);
  out->Absolute("speed of a target", "m/s", speed, left.norm(), 1e-9);
  out->Absolute("its direction", "rad", std::acos(-1.0) / 6, std::atan2(left.y(), left.x()), 1e-9);
  const double asymmetry =
      std::max({std::abs(hit.y()), std::abs(left.x() - right.x()), std::abs(left.y() + right.y())});
  out->AtMost("asymmetry", "m/s", asymmetry, 1e-9);
  out->Absolute("momentum", "N s", 1, Momentum(world).x(), 1e-12);
  out->Absolute("energy", "J", 0.5, KineticEnergy(world), 1e-12);
}

}  // namespace islet::verify
