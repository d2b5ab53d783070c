// Random worlds of one to twenty bodies: whatever they are and do, no step lets anything pass anything, creates energy, leaves
// momentum unexplained, or gives up. ISLET_RANDOM_WORLDS=N asks for more of them than the tests do.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>

#include "engine/world.h"
#include "scenes/random.h"

namespace islet {
namespace {

double LogUniform(SplitMix64* random, double low, double high) {
  return std::exp(random->Uniform(std::log(low), std::log(high)));
}
bool Chance(SplitMix64* random, double share) { return random->Uniform(0, 1) < share; }

// A sphere, box or octahedron, one of three with an aspect of up to 100.
Shape AnyShape(SplitMix64* random, double size) {
  const double kind = random->Uniform(0, 1);
  if (kind < 0.3) return Shape::Sphere(size);
  const double aspect = LogUniform(random, 1, Chance(random, 0.3) ? 100 : 10);
  const Vector3 half(size, size / (Chance(random, 0.5) ? aspect : LogUniform(random, 1, 4)), size / aspect);
  if (kind < 0.8) return Shape::Box(half);
  std::array<Vector3, 6> corners;
  for (int k = 0; k < 6; ++k) corners[k] = (k % 2 ? 1 : -1) * half[k / 2] * Vector3::Unit(k / 2);
  return Shape::ConvexHull(corners);
}

struct Drawn {
  World world;
  double dt;  // [s]
  bool walls_may_close;
};

Drawn Draw(std::uint64_t seed) {
  SplitMix64 random(seed);
  Settings settings;
  settings.threads = 1;
  if (Chance(&random, 0.5)) settings.freezing = Freezing::kOff;
  if (Chance(&random, 0.2)) settings.gravity.setZero();
  Drawn drawn{World(settings), LogUniform(&random, 1e-4, 1.0 / 15), false};
  World& world = drawn.world;
  const double size = LogUniform(&random, 0.01, 1), friction = Chance(&random, 0.2) ? 0 : random.Uniform(0, 1.2),
               restitution = Chance(&random, 0.3) ? 1 : random.Uniform(0, 1);
  const auto add = [&](BodyDefinition d) {
    d.friction = friction;
    d.restitution = restitution;
    world.Add(d);
  };
  add({.shape = Shape::HalfSpace(), .kind = BodyKind::kFixed});
  if (Chance(&random, 0.5))
    add({.shape = Shape::Box({4 * size, 4 * size, size * LogUniform(&random, 0.01, 0.5)}), .kind = BodyKind::kFixed,
         .position_W = {0, 0, 6 * size}});
  if (Chance(&random, 0.4)) {
    BodyDefinition wall{.shape = Shape::Box({size * LogUniform(&random, 0.02, 1), 2 * size, 2 * size}),
                        .kind = BodyKind::kKinematic, .position_W = {-14 * size, 0, 4 * size}};
    wall.linear_velocity_W = {LogUniform(&random, 0.01, 10), 0, 0};
    if (Chance(&random, 0.5)) wall.angular_velocity_W = random.Uniform(0, 3) * random.Direction();
    add(wall);
    drawn.walls_may_close = true;
  }
  const double speed = LogUniform(&random, 0.1, 30), spin = LogUniform(&random, 0.1, Chance(&random, 0.3) ? 300 : 20);
  const double ratio = Chance(&random, 0.3) ? 1e4 : 100;
  const int bodies = 1 + static_cast<int>(random.Uniform(0, Chance(&random, 0.7) ? 5 : 20));
  for (int i = 0; i < bodies; ++i) {
    BodyDefinition d{.shape = AnyShape(&random, size * LogUniform(&random, 0.3, 1))};
    d.mass = LogUniform(&random, 1 / std::sqrt(ratio), std::sqrt(ratio));
    d.position_W = size * Vector3(3.5 * (i % 3 - 1), 3.5 * (i / 3 % 3 - 1), 8.5 + 3.5 * (i / 9));
    d.rotation_WB = random.Rotation(3);
    d.linear_velocity_W = speed * random.Uniform(0, 1) * random.Direction() - 0.3 * speed * Vector3::UnitZ();
    d.angular_velocity_W = spin * random.Direction();
    add(d);
  }
  return drawn;
}

TEST(RandomSteps, NothingPassesAndNoEnergyIsCreated) {
  const char* const asked = std::getenv("ISLET_RANDOM_WORLDS");
  const int worlds = asked ? std::atoi(asked) : 60;
  constexpr int kSteps = 60;
  for (int seed = 0; seed < worlds; ++seed) {
    Drawn drawn = Draw(seed);
    bool closed = false;  // walls have closed on a body: it overlaps
    for (int step = 0; step < kSteps; ++step) {
      const StepReport report = drawn.world.Step(drawn.dt);
      closed = closed || (drawn.walls_may_close && report.collision_qp.failed > 0);
      const Ledger& ledger = report.ledger;
      ASSERT_TRUE(closed || ledger.sides_changed == 0) << seed << " " << step;
      ASSERT_LE(ledger.energy_created.value, 1e-6) << seed << " " << step;
      ASSERT_EQ(report.unstepped, 0) << seed << " " << step;
      ASSERT_LE(ledger.momentum_unexplained.value, 1e-8) << seed << " " << step;
      for (const Body& b : drawn.world.bodies())
        ASSERT_TRUE(b.position_W.allFinite() && b.linear_velocity_W.allFinite() && b.angular_velocity_W.allFinite()) << seed << " " << step;
    }
  }
}

}  // namespace
}  // namespace islet
