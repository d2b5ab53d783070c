// Balls that slide until they roll: T7, T8, T9. Straight paths over seams are in rolling_seams.cpp, blocks that tip, rock and
// spin in rolling_blocks.cpp.
#include "scenes/verify/rolling_checks.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "scenes/verify/builders.h"

namespace islet {
namespace {

using namespace verify;

Vector3 SlipOnFloor(const Body& ball, double radius, const Vector3& normal = Vector3::UnitZ()) {
  return ball.VelocityAt(ball.position_W - radius * normal);
}

// Friction mu m g against the slip s brakes the ball by mu g and turns it by 5/2 mu g / r: s keeps its direction and shrinks
// by 7/2 mu g, so it rolls after t = |s| 2 / (7 mu g) with v = v0 - 2/7 s. Without spin: v = 5/7 v0 at 2 v0 / (7 mu g) after
// 12 v0^2 / (49 mu g); with spin w0 about the axis of rolling: (5 v0 + 2 r w0) / 7.
struct Shot {
  const char* name;
  Vector3 velocity;  // [m/s]
  Vector3 spin;      // [rad/s]
};

constexpr double kBallRadius = 0.0286, kBallMass = 0.17, kBallFriction = 0.2;  // billiards

void MeasureShot(const CheckSettings& settings, const Shot& shot, Measurements* out) {
  const double h = settings.dt, r = kBallRadius, brake = kBallFriction * kGravity;
  World world(settings.engine);
  world.Add(Floor(kBallFriction));
  const int ball = world.Add(Ball({0, 0, r}, r, kBallFriction, 0, kBallMass));
  world.SetVelocity(ball, shot.velocity, shot.spin);
  const Vector3 slip0 = SlipOnFloor(world.body(ball), r);
  const double onset = slip0.norm() / (3.5 * brake), speed = shot.velocity.norm();
  const Vector3 end = shot.velocity - 2.0 / 7 * slip0;
  const Vector3 turn =
      onset * shot.velocity - 0.5 * onset * onset * brake * slip0.normalized();  // where it starts to roll

  const int frames = Frames(onset + 0.5, h) + 1;
  double measured_onset = -1, slip_after = 0, lift = 0;
  for (int i = 0; i < frames; ++i) {
    const double slip_before = SlipOnFloor(world.body(ball), r).norm();
    world.Step(h);
    const double slip = SlipOnFloor(world.body(ball), r).norm();
    lift = std::max(lift, std::abs(world.body(ball).position_W.z() - r));
    if (measured_onset >= 0) {
      slip_after = std::max(slip_after, slip);
    } else if (slip < 1e-3 * slip0.norm() && (i + 1) * h >= onset) {
      measured_onset = i * h + slip_before / (3.5 * brake);
    }
  }
  const Body& b = world.body(ball);
  const std::string name = shot.name;
  out->Absolute(name + ": end speed", "m/s", end.norm(), b.linear_velocity_W.norm(), 1e-6 * speed);
  out->AtMost(name + ": off the end velocity, any direction", "m/s", (b.linear_velocity_W - end).norm(), 1e-6 * speed);
  out->Absolute(name + ": rolls from", "s", onset, measured_onset, 1e-5 * onset);
  // The step in which sliding ends moves by the mean of its two speeds: off by at most mu g h^2 / 8 for ever.
  const Vector3 place = turn + (frames * h - onset) * end;
  out->AtMost(name + ": off the path at the end", "m", (b.position_W - Vector3(0, 0, r) - place).norm(),
              brake * h * h / 8 + 1e-6 * place.norm(), "mu g h^2 / 8: the step in which rolling starts");
  out->AtMost(name + ": slip once it rolls", "m/s", slip_after, 1e-6 * speed);
  out->AtMost(name + ": height off the floor", "m", lift, 1e-9);
}

void MeasureSlideToRoll(const CheckSettings& settings, Measurements* out) {
  const Vector3 along = Turn(0.4, Vector3::UnitZ()) * Vector3::UnitX();  // no axis of the contact frame
  const Vector3 rolling = Vector3::UnitZ().cross(along) / kBallRadius;   // spin of rolling at 1 m/s
  MeasureShot(settings, {"no spin", 2 * along, Vector3::Zero()}, out);
  MeasureShot(settings, {"back spin", 2 * along, -1.5 * rolling}, out);
  MeasureShot(settings, {"over spin", 1 * along, 3 * rolling}, out);
  // Spin about the line of travel: the path is a parabola until the ball rolls, aside of where it was aimed.
  MeasureShot(settings, {"side spin", 2 * along, 2 / kBallRadius * along}, out);
}

// ---- T8

struct Slope {
  double angle, friction;
};

// Rolling: a = 5/7 g sin th needs a friction of 2/7 m g sin th, which is there if tan th <= 3.5 mu. Else it slides with
// g (sin th - mu cos th) and is turned by 5/2 mu g cos th / r. Constant forces: the scheme is exact.
void MeasureSlope(const CheckSettings& settings, const std::string& name, const Slope& slope, Measurements* out) {
  constexpr double kSeconds = 2, r = 0.5;
  const double h = settings.dt, sine = std::sin(slope.angle), cosine = std::cos(slope.angle);
  const bool rolls = std::tan(slope.angle) <= 3.5 * slope.friction;
  const double acceleration = kGravity * (rolls ? 5.0 / 7 * sine : sine - slope.friction * cosine);
  const double spin = rolls ? acceleration / r : 2.5 * slope.friction * kGravity * cosine / r;  // [rad/s^2]

  World world(settings.engine);
  world.Add(Floor(slope.friction, 0, slope.angle));
  const Quaternion tilt = Turn(slope.angle, Vector3::UnitY());
  const Vector3 normal = tilt * Vector3::UnitZ(), down = tilt * Vector3::UnitX();
  const int ball = world.Add(Ball(r * normal, r, slope.friction));
  const int frames = Frames(kSeconds, h);
  StepTimes(&world, frames, h);
  const Body& b = world.body(ball);
  const double t = frames * h;
  out->Relative(name + ": acceleration", "m/s^2", acceleration, b.linear_velocity_W.dot(down) / t, 1e-6);
  out->Relative(name + ": spin-up", "rad/s^2", spin, b.angular_velocity_W.y() / t, 1e-6);
  out->Relative(name + ": distance", "m", 0.5 * acceleration * t * t, b.position_W.dot(down), 1e-6);
  const double slip = SlipOnFloor(b, r, normal).norm();
  out->Absolute(name + ": slip at the end", "m/s", (acceleration - spin * r) * t, slip, 1e-6 * acceleration * t);
  out->AtMost(name + ": height off the slope", "m", std::abs(b.position_W.dot(normal) - r), 1e-9);
}

void MeasureRollDown(const CheckSettings& settings, Measurements* out) {
  const double threshold = std::tan(0.5) / 3.5;
  MeasureSlope(settings, "20 deg, mu 0.5", {0.349, 0.5}, out);
  MeasureSlope(settings, "50 deg, mu 0.2", {0.873, 0.2}, out);
  MeasureSlope(settings, "mu 0.01 % above tan th / 3.5", {0.5, 1.0001 * threshold}, out);
  MeasureSlope(settings, "mu 0.01 % below tan th / 3.5", {0.5, 0.9999 * threshold}, out);
}

// ---- T9

constexpr int kRow = 5;  // 5 x 5 balls
constexpr double kPush = 150, kPlateMass = 10, kPlateHeight = 1, kPlateFriction = 0.4, kRollFriction = 0.8;

// Box: M a = F - mu (M + n m) g - n f; ball: m a_b = f and (rolling on the box) a_b = 2/7 a, since f r = 2/5 m r^2 w' and
// a = a_b + r w'. So a = (F - mu (M + n m) g) / (M + 2/7 n m). The box slides: 150 N is more than 0.4 of its load, while the
// component along either axis, 106 N, is less: friction that is bounded per axis holds the box.
double PlateAcceleration() {
  constexpr double balls = kRow * kRow;
  return (kPush - kPlateFriction * (kPlateMass + balls) * kGravity) / (kPlateMass + 2.0 / 7 * balls);
}

void MeasurePlateOfBalls(const CheckSettings& settings, Measurements* out) {
  constexpr double kSeconds = 4;
  World world(settings.engine);
  world.SetMaterialCallback([](const Contact& c, const Body&, const Body&) {
    return Material{c.body_a == 0 ? kPlateFriction : kRollFriction, 0};
  });
  world.Add(Floor());
  const int plate = world.Add(
      {.shape = Shape::Box({10, 10, kPlateHeight / 2}), .mass = kPlateMass, .position_W = {0, 0, kPlateHeight / 2}});
  for (int i = 0; i < kRow * kRow; ++i)
    world.Add(Ball({2.0 * (i % kRow - 2), 2.0 * (i / kRow - 2), kPlateHeight + 0.5}));
  const Vector3 push = Vector3(1, 1, 0).normalized();
  world.SetForce(plate, kPush * push, Vector3::Zero());

  const double acceleration = PlateAcceleration();
  const int frames = Frames(kSeconds, settings.dt);
  double squares = 0, lift = 0, worst_ball = 0;
  for (int i = 1; i <= frames; ++i) {
    world.Step(settings.dt);
    const Vector3 due = i * settings.dt * acceleration * push;
    const auto off = [&](int body, double share) { return (world.body(body).linear_velocity_W - share * due).norm(); };
    squares += std::pow(off(plate, 1), 2) + std::pow(off(plate + 1, 2.0 / 7), 2);
    lift = std::max(lift, std::abs(world.body(plate).position_W.z() - kPlateHeight / 2));
  }
  const double t = frames * settings.dt;
  for (int ball = plate + 1; ball < static_cast<int>(world.bodies().size()); ++ball)
    worst_ball =
        std::max(worst_ball, std::abs(world.body(ball).linear_velocity_W.dot(push) / t - acceleration * 2 / 7));
  out->Relative("box", "m/s^2", acceleration, world.body(plate).linear_velocity_W.dot(push) / t, 1e-5);
  out->AtMost("worst of 25 balls off 2/7 of the box", "m/s^2", worst_ball, 1e-5 * acceleration);
  out->AtMost("mean squared velocity error of box and one ball", "m^2/s^2", squares / frames, 2e-10,
              "as SimBenchmark has it; the best it shows is 1e-12 at 1 ms");
  out->AtMost("height of the box off the floor", "m", lift, 1e-7);
  out->AtMost("turn of the box", "rad", 2 * world.body(plate).rotation_WB.vec().norm(), 1e-6);
}

}  // namespace

std::span<const Check> RollingChecks() {
  static constexpr std::array<Check, 7> kChecks{{
      {"T7", "billiard ball, slide to roll", Gate::kGate,
       "v = v0 - 2/7 slip0 after slip0 2 / (7 mu g): momentum about the contact point is kept", MeasureSlideToRoll},
      {"T8", "ball down an incline", Gate::kGate, "5/7 g sin th if tan th <= 3.5 mu, else g (sin th - mu cos th)",
       MeasureRollDown},
      {"T9", "box with 25 balls on it, pushed along a diagonal", Gate::kChart,
       "a = (F - mu (M + n m) g) / (M + 2/7 n m), balls 2/7 of that", MeasurePlateOfBalls},
      {"T20", "cube balanced on an edge", Gate::kChart, "leaves as cosh(k t), k^2 = 3 g / (2 sqrt 2 a)",
       verify::MeasureBalancedCube},
      {"T21", "rocking block", Gate::kChart,
       "w'' = p^2 sin(alpha - th), p^2 = 3 g / (4 R); impact w+ / w- = 1 - 1.5 sin^2 alpha [Hou63]",
       verify::MeasureRockingBlock},
      {"T29", "spinning square block on four corners", Gate::kChart,
       "6 mu g / (sqrt 2 a); with translation: both stop together", verify::MeasureSpinningBlock},
      {"T30", "grazing over the seams of coplanar tiles", Gate::kChart, "no impulse: a straight path at constant speed",
       verify::MeasureSeams},
  }};
  return kChecks;
}

}  // namespace islet
