// Freezing that never lies: what is frozen would not move if it were not, whatever is done to it or to what holds it.
// Under freezing off the same rows say what freezing is compared with.
#include "scenes/verify/freezing_checks.h"

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "scenes/verify/builders.h"
#include "scenes/verify/check.h"

namespace islet {
namespace verify {

bool AllFrozen(const World& world) {
  return std::all_of(world.bodies().begin(), world.bodies().end(),
                     [](const Body& b) { return b.kind != BodyKind::kDynamic || b.removed || b.frozen; });
}

void Settle(World* world, double seconds, double dt) {
  for (int frame = Frames(seconds, dt); frame > 0 && !AllFrozen(*world); --frame) world->Step(dt);
}

double FastestPointOf(const Body& b) { return b.linear_velocity_W.norm() + b.radius * b.angular_velocity_W.norm(); }

}  // namespace verify

namespace {

using namespace verify;

// ---- T25: a ball on a fixed ball

constexpr double kBelow = 1.0, kAbove = 0.5;  // [m] radii
constexpr double kCentres = kBelow + kAbove;  // [m]
constexpr double kGrips = 1e3;             // friction that lets the ball slip only in the last moment before it leaves
constexpr double kRollingShare = 5.0 / 7;  // of the acceleration of a frictionless ball: 1 / (1 + 2/5)

World BallOnBall(double angle, double friction, const Settings& settings) {
  World world(settings);
  BodyDefinition below = Ball(Vector3::Zero(), kBelow, friction);
  below.kind = BodyKind::kFixed;
  below.mass.reset();
  world.Add(below);
  world.Add(Ball({kCentres * std::sin(angle), 0, kCentres * std::cos(angle)}, kAbove, friction));
  return world;
}

double AngleOf(const World& world) {
  const Vector3& p = world.body(1).position_W;
  return std::atan2(std::hypot(p.x(), p.y()), p.z());
}

double Rate(double share) { return std::sqrt(share * kGravity / kCentres); }  // [1/s]

// [s] from rest at `start` to `end`: theta'' = k^2 sin(theta), by the classical fourth-order Runge-Kutta method.
double TimeToFall(double start, double end, double rate) {
  const double h = 1e-3 / rate;
  double x = start, v = 0, t = 0;
  const auto pull = [&](double angle) { return rate * rate * std::sin(angle); };
  while (true) {
    const double k1x = v, k1v = pull(x), k2x = v + h / 2 * k1v, k2v = pull(x + h / 2 * k1x);
    const double k3x = v + h / 2 * k2v, k3v = pull(x + h / 2 * k2x), k4x = v + h * k3v, k4v = pull(x + h * k3x);
    const double next = x + h / 6 * (k1x + 2 * k2x + 2 * k3x + k4x);
    if (next >= end) return t + h * (end - x) / (next - x);
    x = next;
    v += h / 6 * (k1v + 2 * k2v + 2 * k3v + k4v);
    t += h;
  }
}

struct Fall {
  double seconds = 0;  // until it had passed `end`, interpolated; infinite if it never did
  int frozen_frames = 0;
};

Fall FallTo(double start, double end, double friction, double most, const CheckSettings& s) {
  World world = BallOnBall(start, friction, s.engine);
  Fall fall;
  double before = start;
  while (world.time() < most) {
    world.Step(s.dt);
    fall.frozen_frames += world.body(1).frozen;
    const double now = AngleOf(world);
    if (now >= end) {
      fall.seconds = world.time() - s.dt * (now - end) / (now - before);
      return fall;
    }
    before = now;
  }
  fall.seconds = std::numeric_limits<double>::infinity();
  return fall;
}

// One step takes (x, v) to (x + h v + h^2 k^2 x / 2, v + h k^2 x): growth by 1 + z^2/4 + z sqrt(1 + z^2/16), z = h k, which is
// exp(z - z^2/4 ...): a rate too small by z/4. Bound: twice that.
double RateBound(double rate, double dt) { return rate * dt / 2; }

// Where the last step began that carried it.
double LeavingAngle(double start, double friction, const CheckSettings& s) {
  World world = BallOnBall(start, friction, s.engine);
  double last = std::numeric_limits<double>::quiet_NaN();
  while (world.time() < 20 && AngleOf(world) < 1.2) {
    const double angle = AngleOf(world);
    world.Step(s.dt);
    if (ImpulseOn(world, 1).norm() > 0) last = angle;
  }
  return last;
}

void MeasureBallOnBall(const CheckSettings& s, Measurements* out) {
  const double rolls = Rate(kRollingShare), slides = Rate(1);
  {
    // From rest theta = theta_0 cosh(k t); up to 0.02 rad the sine is straight to 1e-4.
    const double start = 1e-4, end = 0.02;
    const Fall rolling = FallTo(start, end, kGrips, 20, s), sliding = FallTo(start, end, 0, 20, s);
    out->Relative("rate of growth, rolling", "1/s", rolls, std::acosh(end / start) / rolling.seconds,
                  RateBound(rolls, s.dt));
    out->Relative("rate of growth, frictionless", "1/s", slides, std::acosh(end / start) / sliding.seconds,
                  RateBound(slides, s.dt));
  }
  // Energy: v^2 = 2 share g D (1 - cos), and the pull of gravity m g cos = m v^2 / D where it leaves. That is
  // cos = 2 share / (1 + 2 share): 10/17 and 2/3, times the cosine that it starts at. Known to two steps: a step along
  // the tangent opens the gap by (v h)^2 / (2 D), and beyond the touch gap the ball flies for a step.
  for (const bool grips : {true, false}) {
    const double share = grips ? kRollingShare : 1, start = 0.05;
    const double angle = std::acos(2 * share / (1 + 2 * share) * std::cos(start));
    const double speed = std::sqrt(2 * share * kGravity / kCentres * (std::cos(start) - std::cos(angle)));  // [rad/s]
    out->Absolute(grips ? "angle at which it leaves, rolling" : "angle at which it leaves, frictionless", "rad", angle,
                  LeavingAngle(start, grips ? kGrips : 0, s), 2 * speed * s.dt);
  }
  for (const char* const text : {"1e-1", "1e-2", "1e-3", "1e-4", "1e-5", "1e-6", "1e-7"}) {
    const double start = std::stod(text), end = 0.5, time = TimeToFall(start, end, rolls);
    const Fall fall = FallTo(start, end, 0.5, 2 * time + 1, s);
    out->Absolute(std::string("frames in which it was frozen, from ") + text + " rad", "", 0, fall.frozen_frames, 0);
    out->Relative(std::string("time to 0.5 rad, from ") + text + " rad", "s", time, fall.seconds,
                  RateBound(rolls, s.dt) + s.dt / time);
  }
}

// ---- T26: a row of frozen bodies is hit

struct Row {
  int length = 3;
  bool cubes = true;
  double friction = 0.5, restitution = 0;
  double gap = 0;  // [m] that the ball has to cross
};

// The row rests for a second, then a ball of 1 kg comes along at 3 m/s. Velocities of the row and the ball `frames` after the
// one in which it hits.
std::vector<Body> HitRow(const Row& row, Freezing freezing, int frames, const CheckSettings& s, int* delay) {
  Settings settings = s.engine;
  settings.freezing = freezing;
  World world(settings);
  world.Add(Floor(row.friction, 0));
  for (int i = 0; i < row.length; ++i) {
    const Vector3 place(i, 0, 0.5);
    world.Add(row.cubes ? Cube(place, row.friction, row.restitution) : Ball(place, 0.5, row.friction, row.restitution));
  }
  StepTimes(&world, Frames(1, s.dt), s.dt);
  BodyDefinition ball = Ball({-1 - row.gap, 0, 0.5}, 0.5, row.friction, row.restitution);
  ball.linear_velocity_W = {3, 0, 0};
  const int hit = world.Add(ball);
  *delay = 0;
  bool touched = false;
  for (int left = Frames(3, s.dt); frames > 0 && left > 0; --left) {  // some models launch the ball over the row
    touched = touched ||
              std::any_of(world.contacts().begin(), world.contacts().end(),
                          [&](const Contact& c) { return c.body_a == 1 && c.body_b == hit; }) ||
              row.gap == 0;
    world.Step(s.dt);
    if (!touched) continue;
    --frames;
    const bool moves = FastestPointOf(world.body(row.length)) > 1e-3;
    *delay += !moves;
  }
  return {world.bodies().begin(), world.bodies().end()};
}

void MeasureRevival(const CheckSettings& s, Measurements* out) {
  const std::vector<std::pair<const char*, Row>> rows{
      {"1 cube", {.length = 1}},
      {"3 cubes", {.length = 3}},
      {"10 cubes", {.length = 10}},
      {"5 balls, e = 1, no friction", {.length = 5, .cubes = false, .friction = 0, .restitution = 1}},
      {"3 cubes, e = 0.5", {.length = 3, .restitution = 0.5}},
      {"3 cubes across 0.3 m", {.length = 3, .gap = 0.3}},
      {"5 balls across 0.3 m, e = 1, no friction",
       {.length = 5, .cubes = false, .friction = 0, .restitution = 1, .gap = 0.3}}};
  for (const auto& [name, row] : rows) {
    int delay = 0, awake_delay = 0;
    const std::vector<Body> frozen = HitRow(row, s.engine.freezing, 1, s, &delay);
    const std::vector<Body> awake = HitRow(row, Freezing::kOff, 1, s, &awake_delay);
    double momentum = 0, never = 0, change = 0;
    for (size_t i = 1; i < frozen.size(); ++i) {
      momentum += frozen[i].linear_velocity_W.x();
      never += awake[i].linear_velocity_W.x();
      change = std::max(change, (frozen[i].linear_velocity_W - awake[i].linear_velocity_W).norm());
    }
    out->Relative(std::string(name) + ": momentum after the hit against never frozen", "N s", never, momentum, 1e-6);
    out->AtMost(std::string(name) + ": change of a velocity, of 3 m/s", "", change / 3, 1e-6);
    out->Absolute(std::string(name) + ": frames until the last one moves", "", awake_delay, delay, 0);
  }
}

constexpr Check kChecks[] = {
    {"T25", "ball on a fixed ball", Gate::kGate,
     "k = sqrt(5 g / (7 (R + r))); leaves at cos = 10/17 rolling, 2/3 frictionless; never frozen, however near the top",
     MeasureBallOnBall},
    {"T26", "a frozen row is hit", Gate::kGate, "the run in which nothing was ever frozen", MeasureRevival},
    {"T27", "what holds a frozen body is taken away", Gate::kGate,
     "moves in the step in which equilibrium ends: tan = mu, F = mu m g; free fall without support", MeasureSupport},
    {"T44", "a long rest", Gate::kChart, "nothing moves, nothing wakes, the floor carries the weight", MeasureRest},
};

}  // namespace

std::span<const Check> FreezingChecks() { return kChecks; }

}  // namespace islet
