// T27: what holds a frozen body goes away, gives way, or no longer suffices.
#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "scenes/verify/builders.h"
#include "scenes/verify/freezing_checks.h"

namespace islet::verify {
namespace {

constexpr double kMu = 0.5;
constexpr double kRollingShareOfG = 5.0 / 7 * kGravity;  // [m/s^2] of a ball on a slope, per rad
// Imbalance below this share of a body's loads counts as none (engine/freezing/certified_freezing.cpp).
constexpr double kBalanceTolerance = 1e-5;

enum class Loss { kRemoved, kTeleported, kSinks };

// Stack of 5 on a box that goes: all fall freely, in the same step. Returns the worst relative error of v_z = -g h.
double FallWithoutSupport(Loss loss, const CheckSettings& s) {
  World world(s.engine);
  BodyDefinition box = Cube({0, 0, -0.5});
  box.kind = loss == Loss::kSinks ? BodyKind::kKinematic : BodyKind::kFixed;
  const int support = world.Add(box);
  for (int i = 0; i < 5; ++i) world.Add(Cube({0, 0, i + 0.5}));
  Settle(&world, 1, s.dt);
  if (loss == Loss::kRemoved) world.Remove(support);
  if (loss == Loss::kTeleported) world.Teleport(support, {20, 0, 0}, Quaternion::Identity());
  if (loss == Loss::kSinks) world.SetVelocity(support, {0, 0, -10}, Vector3::Zero());
  world.Step(s.dt);
  double worst = 0;
  for (int i = 1; i <= 5; ++i)
    worst = std::max(worst, std::abs(world.body(i).linear_velocity_W.z() / (-kGravity * s.dt) - 1));
  return worst;
}

// The third of five goes: the upper two fall, the lower two must not notice.
void MeasureMiddle(const CheckSettings& s, Measurements* out) {
  World world(s.engine);
  world.Add(Floor());
  for (int i = 0; i < 5; ++i) world.Add(Cube({0, 0, i + 0.5}));
  Settle(&world, 1, s.dt);
  world.Remove(3);
  const int woken = world.Step(s.dt).woken;
  double worst = 0;
  for (const int i : {4, 5})
    worst = std::max(worst, std::abs(world.body(i).linear_velocity_W.z() / (-kGravity * s.dt) - 1));
  out->AtMost("middle of a stack removed, those above: error of g", "", worst, 1e-6);
  out->AtMost("those below: speed / (g h)", "",
              std::max(FastestPointOf(world.body(1)), FastestPointOf(world.body(2))) / (kGravity * s.dt), 1e-6);
  out->Absolute("of five, those that wake", "", s.engine.freezing == Freezing::kOff ? 0 : 2, woken, 0);
  out->Relative("load on the floor", "N", 2 * kGravity, -ImpulseOn(world, 0).z() / s.dt, 1e-5);
}

Vector3 Gravity(double angle) { return kGravity * Vector3(std::sin(angle), 0, -std::cos(angle)); }

// A block on a plane, gravity turned at `rate` [rad/s] from below the friction angle, as far as what would not pass. Returns the tangent at
// which it is seen to move, that is, to be faster than 1e-4 g h; NaN if it never does.
double TangentOfSliding(double rate, double bound, const CheckSettings& s) {
  const double start = std::atan(kMu) - std::max(60 * rate * s.dt, 3 * bound), end = std::atan(kMu) + 3 * bound;
  Settings settings = s.engine;
  settings.gravity = Gravity(start);
  World world(settings);
  world.Add(Floor(kMu));
  world.Add(Cube({0, 0, 0.5}, kMu));
  Settle(&world, 1, s.dt);
  double angle = start;
  for (int frame = 1; angle < end; ++frame) {
    angle = start + rate * frame * s.dt;
    world.SetGravity(Gravity(angle));
    world.Step(s.dt);
    if (FastestPointOf(world.body(1)) > 1e-4 * kGravity * s.dt) return std::tan(angle);
  }
  return NAN;
}

// Speed after a second of a ball that rolls from the moment in which its floor is turned: 5/7 g rate t^2 / 2.
double SpeedOfRolling(double rate, const CheckSettings& s) {
  World world(s.engine);
  world.Add(Floor());
  world.Add(Ball({0, 0, 0.5}));
  Settle(&world, 1, s.dt);
  const int frames = Frames(1, s.dt);
  for (int frame = 1; frame <= frames; ++frame) {
    world.SetGravity(Gravity(rate * frame * s.dt));
    world.Step(s.dt);
  }
  return world.body(1).linear_velocity_W.x();
}

void MeasureGravity(const CheckSettings& s, Measurements* out) {
  for (const double rate : {0.02, 1e-3, 1e-5}) {
    // Two steps of turning (tan' = 1 + mu^2), or what the balance does not see, if that is more.
    const double bound = (1 + kMu * kMu) * (2 * rate * s.dt + 4 * kBalanceTolerance);
    const std::string name = rate == 0.02 ? "0.02" : rate == 1e-3 ? "1e-3" : "1e-5";
    out->Absolute("gravity turned at " + name + " rad/s: tangent at which a block slides", "", kMu,
                  TangentOfSliding(rate, bound, s), bound);
    // Lost at the start: the turn that the balance does not see, and a step.
    const double lost = 4 * kBalanceTolerance / rate + 2 * s.dt;  // [s] of 1 s
    if (rate > 1e-4)
      out->Relative("speed of a ball after 1 s of that", "m/s", kRollingShareOfG * rate / 2, SpeedOfRolling(rate, s),
                    2 * lost);
  }
}

// A force that grows by `rate` [1/s] times mu m g, from below to above what would not pass: the share of mu m g at which the cube is seen to
// move; NaN if it never does.
double ShareOfPush(double rate, double bound, const CheckSettings& s) {
  World world(s.engine);
  world.Add(Floor(kMu));
  world.Add(Cube({0, 0, 0.5}, kMu));
  Settle(&world, 1, s.dt);
  const double start = 1 - std::max(60 * rate * s.dt, 3 * bound);
  double share = start;
  for (int frame = 1; share < 1 + 3 * bound; ++frame) {
    share = start + rate * frame * s.dt;
    world.SetForce(1, {share * kMu * kGravity, 0, 0}, Vector3::Zero());
    world.Step(s.dt);
    if (FastestPointOf(world.body(1)) > 1e-4 * kGravity * s.dt) return share;
  }
  return NAN;
}

// Whether an impulse acted between the two in the last step.
bool Pushes(const World& world, int a, int b) {
  const std::span<const Contact> contacts = world.resolved_contacts();
  for (size_t c = 0; c < contacts.size(); ++c)
    if (contacts[c].body_a == a && contacts[c].body_b == b && !world.impulses()[c].isZero(0)) return true;
  return false;
}

// A wall comes at 1 mm/s to a row of three frozen cubes: from the step after its first push they go with it.
double RowBehindWall(const CheckSettings& s) {
  constexpr double kSpeed = 1e-3;
  World world(s.engine);
  world.Add(Floor(kMu));
  for (int i = 0; i < 3; ++i) world.Add(Cube({static_cast<double>(i), 0, 0.5}, kMu));
  BodyDefinition wall = Cube({-1.002, 0, 0.6}, 0);
  wall.kind = BodyKind::kKinematic;
  const int pusher = world.Add(wall);
  Settle(&world, 1, s.dt);
  world.SetVelocity(pusher, {kSpeed, 0, 0}, Vector3::Zero());
  double worst = 0;
  bool pushed = false;
  const int frames = Frames(3, s.dt);
  for (int frame = 0; frame < frames; ++frame) {
    const bool touches = Pushes(world, 1, pusher);
    pushed = pushed || touches;
    world.Step(s.dt);
    if (!touches) continue;
    for (int i = 1; i <= 3; ++i) worst = std::max(worst, std::abs(world.body(i).linear_velocity_W.x() - kSpeed));
  }
  return pushed ? worst / (kGravity * s.dt) : INFINITY;
}

// A plate that starts to slide at 0.1 m/s^2 with a stack of three on it, which friction takes along.
double StackOnSlidingPlate(const CheckSettings& s) {
  World world(s.engine);
  BodyDefinition plate{.shape = Shape::Box({5, 5, 0.5}), .kind = BodyKind::kKinematic, .position_W = {0, 0, -0.5}};
  plate.friction = kMu;
  world.Add(plate);
  for (int i = 0; i < 3; ++i) world.Add(Cube({0, 0, i + 0.5}, kMu));
  Settle(&world, 1, s.dt);
  double worst = 0;
  const int frames = Frames(2, s.dt);
  for (int frame = 1; frame <= frames; ++frame) {
    const double speed = 0.1 * frame * s.dt;
    world.SetVelocity(0, {speed, 0, 0}, Vector3::Zero());
    world.Step(s.dt);
    for (int i = 1; i <= 3; ++i) worst = std::max(worst, std::abs(world.body(i).linear_velocity_W.x() - speed));
  }
  return worst / (kGravity * s.dt);
}

// The lower half of a frozen pyramid goes; when all has come to rest again, what does each body rest on?
void MeasureFloaters(const CheckSettings& s, Measurements* out) {
  constexpr int kRows = 6;
  World world(s.engine);
  world.Add(Floor());
  std::vector<int> lower, upper;
  for (int row = 0; row < kRows; ++row)
    for (int i = 0; i < kRows - row; ++i)
      (row < kRows / 2 ? lower : upper).push_back(world.Add(Cube({1.05 * i + 0.525 * row, 0, row + 0.5})));
  Settle(&world, 2, s.dt);
  for (const int i : lower) world.Remove(i);
  world.Step(s.dt);
  double worst = 0;
  for (const int i : upper)
    worst = std::max(worst, std::abs(world.body(i).linear_velocity_W.z() / (-kGravity * s.dt) - 1));
  out->AtMost("lower half of a pyramid removed: error of g above", "", worst, 1e-6);
  Settle(&world, 10, s.dt);
  double floats = 0;
  for (const int i : upper)
    floats = std::max(floats, (ImpulseOn(world, i) / (kGravity * s.dt) - Vector3::UnitZ()).norm());
  out->AtMost("10 s later: weight that nothing carries, of a cube", "", floats, 1e-4);
  out->Relative("and the load on the floor", "N", Weight(world), -ImpulseOn(world, 0).z() / s.dt, 1e-5);
}

}  // namespace

void MeasureSupport(const CheckSettings& s, Measurements* out) {
  const double exact = 1e-6;
  out->AtMost("support removed: error of g in the first step", "", FallWithoutSupport(Loss::kRemoved, s), exact);
  out->AtMost("support teleported: error of g", "", FallWithoutSupport(Loss::kTeleported, s), exact);
  out->AtMost("support sinks at 10 m/s: error of g", "", FallWithoutSupport(Loss::kSinks, s), exact);
  MeasureMiddle(s, out);
  MeasureGravity(s, out);
  for (const double rate : {0.05, 1e-4}) {
    const double bound = 2 * rate * s.dt + 1e-4 / kMu + 4 * kBalanceTolerance / kMu;
    out->Absolute(rate > 1e-3 ? "push growing by 5 % a second: share of mu m g at which it moves"
                              : "push growing by 1e-4 a second",
                  "", 1, ShareOfPush(rate, bound, s), bound);
  }
  out->AtMost("row before a wall at 1 mm/s: error of speed / (g h)", "", RowBehindWall(s), 1e-5);
  out->AtMost("stack on a plate that starts to slide: error of speed / (g h)", "", StackOnSlidingPlate(s), 1e-5);
  MeasureFloaters(s, out);
  MeasurePileImpact(s, out);
}

}  // namespace islet::verify
