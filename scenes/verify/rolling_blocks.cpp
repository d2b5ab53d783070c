// Blocks on edges and corners: balanced (T20), rocking (T21), spinning (T29).
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <vector>

#include "scenes/verify/builders.h"
#include "scenes/verify/rolling_checks.h"

namespace islet::verify {
namespace {

// Signed turn about y, for bodies that turn about nothing else.
double TiltAboutY(const Body& body) { return 2 * std::atan2(body.rotation_WB.y(), body.rotation_WB.w()); }

// ---- T20

BodyDefinition CubeOnEdge(double tilt) {
  BodyDefinition cube = Cube(Vector3::Zero(), 1);
  const double angle = std::numbers::pi / 4 + tilt;
  cube.rotation_WB = Turn(angle, Vector3::UnitY());
  cube.position_W.z() = std::sqrt(0.5) * std::cos(tilt);
  return cube;
}

struct Fall {
  double rate = 0;     // [1/s] of exponential growth, between 1/5 and 1 of the time to 0.02 rad
  bool froze = false;  // before it lay
  bool lies = false;   // on a face, in the end
};

Fall WatchFall(const CheckSettings& settings, double tilt, double k) {
  World world(settings.engine);
  world.Add(Floor(1));
  const int cube = world.Add(CubeOnEdge(tilt));
  const double h = settings.dt, seconds = std::log(1 / tilt) / k + 3;
  const int frames = Frames(seconds, h);
  // cosh(k t) has become exp(k t) / 2 to 1e-4 at k t = 4.6, and th is small enough for sin th up to 0.02.
  const int first = Frames(4.6 / k, h), last = Frames(std::acosh(0.02 / tilt) / k, h);
  Fall fall;
  double start = 0;
  for (int i = 1; i <= frames; ++i) {
    world.Step(h);
    const Body& b = world.body(cube);
    const double off = std::abs(TiltAboutY(b) - std::numbers::pi / 4);
    if (b.frozen && off < 0.7) fall.froze = true;
    if (i == first) start = off;
    if (i == last && last > first) fall.rate = std::log(off / start) / ((last - first) * h);
  }
  fall.lies = std::abs(world.body(cube).position_W.z() - 0.5) < 1e-3;
  return fall;
}

}  // namespace

// I about the edge = 2/3 m a^2, centre a / sqrt 2 above it: th'' = k^2 sin th with k^2 = m g (a / sqrt 2) / I.
void MeasureBalancedCube(const CheckSettings& settings, Measurements* out) {
  const double k = std::sqrt(3 * kGravity / (2 * std::numbers::sqrt2));
  const Fall fall = WatchFall(settings, 1e-6, k);
  // x += h (w0 + w1) / 2 with w1 - w0 = h k^2 x grows by d in a step, d^2 = (h k)^2 (1 + d / 2): at k (1 - h k / 4 + ..).
  out->Relative("growth rate", "1/s", k, fall.rate, settings.dt * k / 4, "h k / 4: the first order of the scheme");
  CheckSettings half = settings;
  half.dt /= 2;
  const double extrapolated = 2 * WatchFall(half, 1e-6, k).rate - fall.rate;
  const double second_order = settings.dt * settings.dt * k * k / 4;
  out->Relative("growth rate, extrapolated from dt and dt / 2", "1/s", k, extrapolated, second_order, "(h k)^2 / 4");
  for (const auto& [tilt, name] :
       {std::pair{1e-1, "1e-1"}, {1e-2, "1e-2"}, {1e-3, "1e-3"}, {1e-4, "1e-4"}, {1e-5, "1e-5"}, {1e-6, "1e-6"}}) {
    const Fall from = WatchFall(settings, tilt, k);
    out->Verdict(std::string("frozen on its edge, ") + name + " rad off balance", false, from.froze);
    out->Verdict(std::string("falls on a face from ") + name + " rad", true, from.lies);
  }
}

// ---- T21

namespace {

// Tilt th from flat, alpha = atan(b / height): th'' = -p^2 sin(alpha - th), p^2 = m g R / (4/3 m R^2). For small angles the
// quarter period is acosh(1 / (1 - th0 / alpha)) / p [Hou63].
struct Rocker {
  double half_width = 0.1, half_height = 0.4;
  double alpha = std::atan2(half_width, half_height);
  double radius = std::hypot(half_width, half_height);
  double p = std::sqrt(3 * kGravity / (4 * radius));
  // Angular momentum about the new corner: I w- - 2 m R b sin(alpha).. = I w+ with I = 4/3 m R^2.
  double ImpactRatio() const { return 1 - 1.5 * std::sin(alpha) * std::sin(alpha); }
  // [(rad/s)^2] w^2 at th = 0 after rest at th0.
  double SpeedSquared(double tilt) const { return 2 * p * p * (std::cos(alpha - tilt) - std::cos(alpha)); }
  double QuarterPeriod(double tilt) const;
};

// Runge-Kutta with steps of 10 us, the last one by its own speed.
double Rocker::QuarterPeriod(double tilt) const {
  constexpr double h = 1e-5;
  double t = 0, angle = tilt, w = 0;
  const auto acceleration = [&](double th) { return -p * p * std::sin(alpha - th); };
  while (angle > 0) {
    const double w2 = w + h / 2 * acceleration(angle), w3 = w + h / 2 * acceleration(angle + h / 2 * w);
    const double w4 = w + h * acceleration(angle + h / 2 * w2);
    const double a1 = acceleration(angle), a2 = acceleration(angle + h / 2 * w), a3 = acceleration(angle + h / 2 * w2),
                 a4 = acceleration(angle + h * w3);
    angle += h / 6 * (w + 2 * w2 + 2 * w3 + w4);
    w += h / 6 * (a1 + 2 * a2 + 2 * a3 + a4);
    t += h;
  }
  return t - angle / w;
}

}  // namespace

namespace {

struct FirstRock {
  double quarter = 0;    // [s] until it is flat
  double ratio = 0;      // of the angular velocities after and before the impact, from the energies next to it
  double amplitude = 0;  // [rad] of the tilt to the other side
  double lift = 0;       // [m] farthest that the lower corner was from the floor
};

FirstRock WatchRock(const CheckSettings& settings, const Rocker& rocker, double tilt) {
  const double h = settings.dt;
  World world(settings.engine);
  world.Add(Floor(1));
  const int block = world.Add({.shape = Shape::Box({rocker.half_width, rocker.half_width, rocker.half_height}),
                               .mass = 1,
                               .position_W = {0, 0, rocker.radius * std::cos(rocker.alpha - tilt)},
                               .rotation_WB = Turn(tilt, Vector3::UnitY()),
                               .friction = 1,
                               .restitution = 0});
  const auto energy = [&] { return Energy(world) - world.body(block).mass * kGravity * rocker.half_height; };
  FirstRock rock;
  double before = 0, after = 0;
  for (int i = 0; i < Frames(3 * rocker.QuarterPeriod(tilt), h); ++i) {
    const double angle = TiltAboutY(world.body(block)), w = world.body(block).angular_velocity_W.y();
    world.Step(h);
    const double now = TiltAboutY(world.body(block));
    if (rock.quarter == 0 && now <= 0) {
      const double end = -std::sqrt(w * w + 2 * rocker.p * rocker.p * std::sin(rocker.alpha) * angle);  // w at th = 0
      rock.quarter = i * h - 2 * angle / (w + end);
    }
    // The impact may come early or late by a step and the touch gap.
    const double near = 2 * h * std::abs(w) + 2 * settings.engine.touch_gap;
    if (after == 0 && now > near) before = energy();
    if (after == 0 && now < -near) after = energy();
    rock.amplitude = std::max(rock.amplitude, -now);
    const double corner = rocker.radius * std::cos(rocker.alpha - std::abs(now));
    rock.lift = std::max(rock.lift, std::abs(world.body(block).position_W.z() - corner));
  }
  rock.ratio = std::sqrt(after / before);
  return rock;
}

}  // namespace

void MeasureRockingBlock(const CheckSettings& settings, Measurements* out) {
  const Rocker rocker;
  const double h = settings.dt, tilt = 0.5 * rocker.alpha;
  const FirstRock rock = WatchRock(settings, rocker, tilt);
  out->Absolute("quarter period", "s", rocker.QuarterPeriod(tilt), rock.quarter, h / 2,
                "half a step: positions are ahead of velocities by that");
  const double ratio = rocker.ImpactRatio(), speed = std::sqrt(rocker.SpeedSquared(tilt));
  const double kick = 2 * h * rocker.p * rocker.p * std::sin(rocker.alpha);
  const char* const why = "2 h p^2 sin(alpha) of w: an impact a step early or late lets gravity pull the wrong way";
  out->Absolute("impact ratio w+ / w-", "", ratio, rock.ratio, kick / speed, why);
  // w^2 / 2 - p^2 (cos(alpha - th) - cos(alpha)) is kept from the impact to the turning point.
  const double rise = ratio * speed;
  const double reach = rocker.alpha - std::acos(std::cos(rocker.alpha) + std::pow(rise / rocker.p, 2) / 2);
  const double slope = rise / (rocker.p * rocker.p * std::sin(rocker.alpha - reach));  // d reach / d w
  out->Absolute("tilt to the other side", "rad", reach, rock.amplitude, kick * slope, why);
  const double resolution = (settings.engine.touch_gap + settings.engine.overlap_tolerance) * 2 * rocker.half_width;
  out->AtMost("lower corner off the floor", "m", rock.lift, resolution,
              "the touch gap and the overlap that may be left");
}

// ---- T29

namespace {

constexpr double kSide = 1, kThickness = 0.01, kSlabFriction = 0.3;

int AddSlab(World* world, double turn, const Vector3& velocity, double spin) {
  world->Add(Floor(kSlabFriction));
  const int slab = world->Add({.shape = Shape::Box({kSide / 2, kSide / 2, kThickness / 2}),
                               .mass = 1,
                               .inertia_B = Vector3(1, 1, 2).asDiagonal().toDenseMatrix() * (kSide * kSide / 12),
                               .position_W = {0, 0, kThickness / 2},
                               .rotation_WB = Turn(turn, Vector3::UnitZ()),
                               .friction = kSlabFriction,
                               .restitution = 0});
  world->SetVelocity(slab, velocity, {0, 0, spin});
  return slab;
}

struct Stop {
  double time = 0;             // [s]
  Vector3 place{0, 0, 0};      // [m]
  double translation_end = 0;  // [s] when the centre stopped
  double spin_end = 0;
};

// The four corners bear `even` and `odd` of the weight in turn; the balance of moments of a thin slab leaves that open.
Stop IntegrateSlab(double turn, double speed, double spin, double even) {
  constexpr double h = 2e-5;
  const double reach = kSide / std::sqrt(2.0);
  Vector3 v(speed, 0, 0);
  double angle = turn, w = spin;
  Stop stop;
  while (v.norm() > 2 * h * kGravity * kSlabFriction || std::abs(w) * reach > 20 * h * kGravity * kSlabFriction) {
    Vector3 force = Vector3::Zero();
    double torque = 0;
    for (int corner = 0; corner < 4; ++corner) {
      const double at = angle + std::numbers::pi / 4 + corner * std::numbers::pi / 2;
      const Vector3 r(reach * std::cos(at), reach * std::sin(at), 0);
      const Vector3 slip = v + w * Vector3::UnitZ().cross(r);
      const double load = (corner % 2 == 0 ? even : 1 - even) / 2 * kGravity;
      const Vector3 f = -kSlabFriction * load / std::max(slip.norm(), 1e-12) * slip;
      force += f;
      torque += r.x() * f.y() - r.y() * f.x();
    }
    stop.place += h * (v + 0.5 * h * force);
    v += h * force;
    w += h * torque * 6 / (kSide * kSide);
    angle += h * w;
    stop.time += h;
  }
  return stop;
}

Stop WatchSlab(const CheckSettings& settings, double heading, double turn, double speed, double spin) {
  const double h = settings.dt;
  World world(settings.engine);
  const Quaternion aim = Turn(heading, Vector3::UnitZ());
  const int slab = AddSlab(&world, turn + heading, aim * Vector3(speed, 0, 0), spin);
  const Body& b = world.body(slab);
  const double reach = kSide / std::sqrt(2.0), still = 1e-5 * kGravity * h;
  Stop stop;
  for (int i = 1; i <= Frames(2, h) && (stop.spin_end == 0 || stop.translation_end == 0); ++i) {
    world.Step(h);
    if (b.linear_velocity_W.norm() > still) stop.translation_end = 0;
    if (std::abs(b.angular_velocity_W.z()) * reach > still) stop.spin_end = 0;
    if (stop.translation_end == 0 && b.linear_velocity_W.norm() <= still) stop.translation_end = i * h;
    if (stop.spin_end == 0 && std::abs(b.angular_velocity_W.z()) * reach <= still) stop.spin_end = i * h;
  }
  stop.time = std::max(stop.translation_end, stop.spin_end);
  stop.place = aim.conjugate() * (b.position_W - Vector3(0, 0, kThickness / 2));
  return stop;
}

}  // namespace

// Spin alone: the corners are a / sqrt 2 from the axis and together bear m g, however it is shared out, so
// w' = mu m g (a / sqrt 2) / (m a^2 / 6). With translation u = v + w x r: while v is the faster one, v' = -mu g and
// w' = -(mu g / 4) (6 / a^2) (sum of r_x^2 = a^2) w / v, so w ~ v^(3/2): it falls behind, and both end at the same time.
void MeasureSpinningBlock(const CheckSettings& settings, Measurements* out) {
  const double h = settings.dt, spin = 6;
  const double brake = 6 * kSlabFriction * kGravity / (std::numbers::sqrt2 * kSide);
  for (const auto& [turn, name] : {std::pair{0.0, "0 deg"}, {0.3, "17 deg"}, {std::numbers::pi / 4, "45 deg"}}) {
    World world(settings.engine);
    const int slab = AddSlab(&world, turn, Vector3::Zero(), spin);
    const int frames = Frames(0.8 * spin / brake, h);
    StepTimes(&world, frames, h);
    const Body& b = world.body(slab);
    const std::string from = std::string("turned by ") + name;
    out->Relative("spin decay, " + from, "rad/s^2", brake, (spin - b.angular_velocity_W.z()) / (frames * h), 1e-6);
    out->AtMost("drift of the centre, " + from, "m", (b.position_W - Vector3(0, 0, kThickness / 2)).norm(), 1e-6);
  }
  for (const auto& [speed, spin0, name] : {std::tuple{1.0, 2.0, "1 m/s, 2 rad/s"}, {1.0, 6.0, "1 m/s, 6 rad/s"}}) {
    const Stop expected = IntegrateSlab(0.3, speed, spin0, 0.5);
    const Stop a = IntegrateSlab(0.3, speed, spin0, 0), b = IntegrateSlab(0.3, speed, spin0, 1);
    const double open_time = std::max(std::abs(a.time - expected.time), std::abs(b.time - expected.time));
    const double open_place = std::max((a.place - expected.place).norm(), (b.place - expected.place).norm());
    const Stop stop = WatchSlab(settings, 0, 0.3, speed, spin0);
    const std::string of = std::string(", ") + name;
    out->AtMost("between the ends of translation and spin" + of, "s", std::abs(stop.spin_end - stop.translation_end),
                h);
    out->Absolute("stops after" + of, "s", expected.time, stop.time, h + open_time,
                  "a step, and what the shares of the corners leave open");
    out->AtMost("place where it stops, off that of equal shares" + of, "m", (stop.place - expected.place).norm(),
                open_place + speed * h, "what the shares of the corners leave open, and a step");
    double spread = 0;
    for (const double heading : {0.5, 1.0, 2.3, 4.0})
      spread = std::max(spread, (WatchSlab(settings, heading, 0.3, speed, spin0).place - stop.place).norm());
    out->AtMost("spread of the place it stops at over headings" + of, "m", spread, 1e-6);
  }
}

}  // namespace islet::verify
