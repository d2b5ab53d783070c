// Bodies that spin: a free top (T33), a disk that rolls on its rim (T34), a tippe-top (T35), a rattleback (T36). The last three
// are shapes that the engine does not have: see spin_bodies.h for how its contact suite is used without its geometry.
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <string>

#include "scenes/verify/builders.h"
#include "scenes/verify/check.h"
#include "scenes/verify/spin_bodies.h"

namespace islet {
namespace {

using namespace verify;

constexpr double kPi = std::numbers::pi;

std::string Digits(double seconds) { return std::to_string(static_cast<int>(seconds)) + " s"; }

// ---- T33

// Half the period of the angular velocity about the middle axis, a < b < c the moments of inertia, L^2 = sum I^2 w^2 and
// 2 E = sum I w^2 [LL76 Sec. 37]: 2 K(k) / lambda with, if L^2 > 2 E b (else a and c change places),
// lambda^2 = (c - b) (L^2 - 2 E a) / (a b c), 1 - k^2 = (c - a) (L^2 - 2 E b) / ((c - b) (L^2 - 2 E a)).
// K(k) = pi / (2 agm(1, sqrt(1 - k^2))). The differences are written out: near the middle axis they are small.
double FlipPeriod(const Vector3& moments, const Vector3& w) {
  double a = moments[0], c = moments[2];
  const double b = moments[1];
  const auto above = [&](double from) {  // L^2 - 2 E from
    double sum = 0;
    for (int i = 0; i < 3; ++i) sum += moments[i] * (moments[i] - from) * w[i] * w[i];
    return sum;
  };
  if (above(b) < 0) std::swap(a, c);
  const double lambda = std::sqrt((c - b) * above(a) / (a * b * c));
  double x = 1, y = std::sqrt((c - a) * above(b) / ((c - b) * above(a)));
  for (int i = 0; i < 40; ++i) {
    const double mean = (x + y) / 2;
    y = std::sqrt(x * y);
    x = mean;
  }
  return kPi / (x * lambda);
}

void MeasureFreeTop(const CheckSettings& settings, Measurements* out) {
  const Vector3 moments(1, 2, 2.8), start(1e-3, 2 * kPi, 1e-3);  // one turn a second about the middle axis
  const int turns = settings.quick ? 200 : 1000;
  Settings engine = settings.engine;
  engine.gravity.setZero();
  World world(engine);
  const int top = world.Add({.shape = Shape::Box({0.5, 0.5, 0.5}),
                             .mass = 1,
                             .inertia_B = Matrix3(moments.asDiagonal()),
                             .angular_velocity_W = start});
  const Body& b = world.body(top);
  const Vector3 momentum = b.AngularMomentumW();
  const double energy = b.KineticEnergy(), h = settings.dt;
  const auto middle = [&] { return (b.rotation_WB.conjugate() * b.angular_velocity_W).y(); };
  double worst_size = 0, worst_momentum = 0, worst_energy = 0, first_flip = 0, last_flip = 0;
  int flips = 0;
  for (int i = 0; i < Frames(turns, h); ++i) {
    const double before = middle();
    world.Step(h);
    const double after = middle();
    if ((before > 0) != (after > 0)) {
      last_flip = h * (i + before / (before - after));
      if (flips++ == 0) first_flip = last_flip;
    }
    worst_size = std::max(worst_size, std::abs(b.AngularMomentumW().norm() / momentum.norm() - 1));
    worst_momentum = std::max(worst_momentum, (b.AngularMomentumW() - momentum).norm() / momentum.norm());
    worst_energy = std::max(worst_energy, std::abs(b.KineticEnergy() / energy - 1));
  }
  const std::string over = " over " + std::to_string(turns) + " turns";
  out->AtMost("|L|, relative," + over, "", worst_size, 1e-9);
  out->AtMost("L with its direction, relative," + over, "", worst_momentum, 1e-9);
  out->AtMost("energy, relative," + over, "", worst_energy, 1e-9);
  const double period = flips > 1 ? (last_flip - first_flip) / (flips - 1) : 0;
  out->Relative("time between flips," + over, "s", FlipPeriod(moments, start), period, 1e-5);
}

// ---- T34

// Thin disk, its centre at rest, its lowest point at rest too: it turns about the diameter through both, w = Omega sin a, and
// L = (m R^2 / 4) w along it circles with Omega under the torque m g R cos a of the load at the rim:
// Omega L cos a = m g R cos a, so Omega^2 sin a = 4 g / R.
constexpr double kDiskRadius = 0.1, kDiskTilt = 0.3;  // [m], [rad]
constexpr int kDiskSteps = 16;                        // in a dt

struct DiskRun {
  double rate = 0;    // [rad/s] mean precession of the contact
  double energy = 0;  // largest relative change
  double tilt = 0;    // [rad] largest change
  double gap = 0;     // [m] largest
  bool froze = false;
};

double DiskRate() { return std::sqrt(4 * kGravity / (kDiskRadius * std::sin(kDiskTilt))); }

DiskRun RollDisk(const CheckSettings& settings, double h, double seconds) {
  const Ellipsoid disk{.semi_axes = {kDiskRadius, kDiskRadius, 0},
                       .centre_B = {0, 0, 0},
                       .mass = 1,
                       .inertia_B = Matrix3(Vector3(0.25, 0.25, 0.5).asDiagonal()) * (kDiskRadius * kDiskRadius)};
  const Quaternion tilted = Turn(kDiskTilt, Vector3::UnitY());  // its x axis points down to the contact
  const Vector3 spin = -DiskRate() * std::sin(kDiskTilt) * (tilted * Vector3::UnitX());
  SuiteRoller roller(settings.engine, disk, 1, Rolling(disk, tilted, spin));
  const double energy = TopEnergy(disk, roller.state());
  Vector3 arm = ContactArm(disk, roller.state());
  DiskRun run;
  const int steps = Frames(seconds, h);
  for (int i = 0; i < steps; ++i) {
    roller.Step(h);
    const TopState& s = roller.state();
    const Vector3 now = ContactArm(disk, s);
    run.rate += std::atan2(arm.cross(now).z(), arm.head<2>().dot(now.head<2>())) / (steps * h);
    arm = now;
    run.energy = std::max(run.energy, std::abs(TopEnergy(disk, s) / energy - 1));
    run.tilt = std::max(run.tilt, std::abs(std::asin(-now.z() / kDiskRadius) - kDiskTilt));
    run.gap = std::max(run.gap, std::abs(Gap(disk, s)));
  }
  run.froze = roller.froze();
  return run;
}

void MeasureDisk(const CheckSettings& settings, Measurements* out) {
  const double h = settings.dt / kDiskSteps, seconds = settings.quick ? 2 : 10, rate = DiskRate();
  const DiskRun run = RollDisk(settings, h, seconds), fine = RollDisk(settings, h / 2, seconds);
  const double order = h * h * rate * rate / 12;  // the Cayley map turns by 2 atan(x / 2) = x - x^3 / 12
  const std::string over = " in " + Digits(seconds);
  out->Relative("precession", "rad/s", rate, run.rate, order, "(h Omega)^2 / 12, h = dt / 16: the midpoint rule's");
  out->Absolute("its error, over that with half the step", "", 4, (run.rate - rate) / (fine.rate - rate), 0.3);
  out->AtMost("energy, relative," + over, "", run.energy, 1e-6);
  out->AtMost("tilt," + over, "rad", run.tilt, order);
  out->AtMost("rim off the plane," + over, "m", run.gap, 1e-6 * kDiskRadius);
  out->Verdict("taken for resting while it rolls", false, run.froze);
}

// ---- T35

// Sphere of radius r whose centre lies e above the centre of mass; k: its axis. From the centre of mass to the contact:
// a = e k - r z. A contact force F gives L' = a x F, so (L . a)' = L . a' = e L . (w x k), and this vanishes: L lies in the plane of
// w and k. So Jellett's J = -L . a is kept by any force at the contact.
constexpr double kTopRadius = 0.02, kTopMass = 0.02, kTopTilt = 0.1, kTopFriction = 0.1;
constexpr int kTopSteps =
    32;  // in a 60th of a second, or in a dt that is shorter: how these bodies move is the check's own

Ellipsoid TippeTop() {
  return {.semi_axes = {kTopRadius, kTopRadius, kTopRadius},
          .centre_B = {0, 0, 0.3 * kTopRadius},
          .mass = kTopMass,
          .inertia_B = Matrix3(Vector3(0.375, 0.375, 0.4).asDiagonal()) * (kTopMass * kTopRadius * kTopRadius)};
}

double TiltOf(const TopState& s) { return std::acos(std::clamp((s.rotation_WB * Vector3::UnitZ()).z(), -1.0, 1.0)); }

struct TopRun {
  double crossing = 0;     // [s] when the axis first was level; 0: never
  double highest = 0;      // [rad] largest tilt
  double jellett = 0;      // largest relative change
  double energy_rise = 0;  // largest in a step, relative
};

template <typename Motion>
TopRun WatchTop(const Ellipsoid& top, double h, double seconds, Motion* motion) {
  const auto jellett = [&] { return -TopMomentum(top, motion->state()).dot(ContactArm(top, motion->state())); };
  const double start = jellett(), energy0 = TopEnergy(top, motion->state());
  TopRun run;
  double energy = energy0;
  for (int i = 0; i < Frames(seconds, h); ++i) {
    const double before = TiltOf(motion->state());
    motion->Step(h);
    const double after = TiltOf(motion->state()), energy_after = TopEnergy(top, motion->state());
    if (run.crossing == 0 && after > kPi / 2) run.crossing = h * (i + (kPi / 2 - before) / (after - before));
    run.highest = std::max(run.highest, after);
    run.jellett = std::max(run.jellett, std::abs(jellett() / start - 1));
    run.energy_rise = std::max(run.energy_rise, (energy_after - energy) / energy0);
    energy = energy_after;
  }
  return run;
}

TopState SpunTop(const Ellipsoid& top, double spin) {
  TopState start = Rolling(top, Turn(kTopTilt, Vector3::UnitY()), {0, 0, spin});
  start.velocity_W.setZero();
  return start;
}

// How fast it rises is told by the equations of motion with Coulomb friction, solved on their own. It rises while it slides; once
// it rolls, it stays at the tilt it has.
void MeasureTippeTop(const CheckSettings& settings, Measurements* out) {
  constexpr double kFast = 100, kSlow = 20, kSeconds = 2.5;  // [rad/s], [rad/s], [s]
  const Ellipsoid top = TippeTop();
  const double h = std::min(settings.dt, 1.0 / 60) / kTopSteps;
  ReferenceTop reference(top, kTopFriction, SpunTop(top, kFast));
  const TopRun expected = WatchTop(top, 2e-5, kSeconds, &reference);
  SuiteRoller roller(settings.engine, top, kTopFriction, SpunTop(top, kFast));
  const TopRun run = WatchTop(top, h, kSeconds, &roller);
  out->AtMost("Jellett's integral, relative", "", run.jellett, 2e-5);
  out->Verdict("spun fast: its centre of mass rises above its centre", true, run.highest > kPi / 2);
  out->Relative("time until its axis is level", "s", expected.crossing, run.crossing, 1e-3);
  out->Absolute("largest tilt", "rad", expected.highest, run.highest, 1e-3);
  out->AtMost("energy gained in a step, relative", "", run.energy_rise, 1e-9);
  SuiteRoller slow(settings.engine, top, kTopFriction, SpunTop(top, kSlow));
  out->Verdict("spun slowly: it rises", false, WatchTop(top, h, kSeconds, &slow).highest > kPi / 2);
}

// ---- T36

// Ellipsoid whose axes of inertia are turned against its axes in the plane, after Kane and Levinson. Its rolling keeps the
// energy but has no mirror: spin feeds rocking, and rocking feeds spin back the other way round, along one of two modes according
// to the sense of the spin. Without losses both senses come to reverse; the one that feeds pitching does it four times as soon.
constexpr int kStoneSteps = 96;  // likewise; half as many where it must be quick

Ellipsoid Rattleback() {
  Matrix3 inertia;
  inertia << 2e-4, -2e-5, 0, -2e-5, 1.6e-3, 0, 0, 0, 1.7e-3;
  return {.semi_axes = {0.2, 0.03, 0.02}, .centre_B = {0, 0, 0.01}, .mass = 1, .inertia_B = inertia};
}

struct StoneRun {
  double reversal = 0;  // [s] first time that the spin about the vertical changed its sense; 0: never
  double spin = 0;      // [rad/s] at the end
  double energy = 0;    // largest relative change
};

template <typename Motion>
StoneRun WatchStone(const Ellipsoid& stone, double h, double seconds, Motion* motion) {
  const double energy = TopEnergy(stone, motion->state()), sense = motion->state().angular_velocity_W.z();
  StoneRun run;
  for (int i = 0; i < Frames(seconds, h); ++i) {
    motion->Step(h);
    run.spin = motion->state().angular_velocity_W.z();
    if (run.reversal == 0 && run.spin * sense < 0) run.reversal = h * (i + 1);
    run.energy = std::max(run.energy, std::abs(TopEnergy(stone, motion->state()) / energy - 1));
  }
  return run;
}

void MeasureRattleback(const CheckSettings& settings, Measurements* out) {
  constexpr double kSpin = 5, kTilt = 0.5 * kPi / 180;
  const double seconds = settings.quick ? 3 : 5;
  const Ellipsoid stone = Rattleback();
  const double h = std::min(settings.dt, 1.0 / 60) / (settings.quick ? kStoneSteps / 2 : kStoneSteps);
  for (const double spin : {-kSpin, kSpin}) {
    const std::string name = spin < 0 ? "against its sense: " : "with its sense: ";
    const TopState start = Rolling(stone, Turn(kTilt, Vector3::UnitY()), {0, 0, spin});
    ReferenceTop reference(stone, -1, start);
    const StoneRun expected = WatchStone(stone, 5e-5, seconds, &reference);
    SuiteRoller roller(settings.engine, stone, 1, start);
    const StoneRun run = WatchStone(stone, h, seconds, &roller);
    out->Verdict(name + "reverses within " + Digits(seconds), spin<0, run.reversal> 0);
    if (spin < 0) out->Relative(name + "reverses after", "s", expected.reversal, run.reversal, 1e-2);
    out->Absolute(name + "spin after " + Digits(seconds), "rad/s", expected.spin, run.spin, 1e-2 * kSpin);
    // About its long axis it rocks at w^2 = m g (b^2 / c - height) / (I + m height^2).
    const double rocking = kGravity * (0.03 * 0.03 / 0.02 - 0.01) / (2e-4 + 1e-4);
    out->AtMost(name + "energy, relative", "", run.energy, h * h * rocking / 4, "(h w)^2 / 4, w that of its rocking");
    out->Verdict(name + "taken for resting while it rocks", false, roller.froze());
  }
}

}  // namespace

std::span<const Check> SpinChecks() {
  static constexpr std::array<Check, 4> kChecks{{
      {"T33", "free asymmetric top", Gate::kGate, "L and E are kept; flips 2 K(k) / lambda apart [LL76 Sec. 37]",
       MeasureFreeTop},
      {"T34", "disk rolling on its rim", Gate::kChart, "Omega^2 sin a = 4 g / R with the centre at rest; no loss",
       MeasureDisk},
      {"T35", "tippe-top", Gate::kChart, "Jellett: L . (contact to centre of mass) is kept under any friction",
       MeasureTippeTop},
      {"T36", "rattleback", Gate::kChart, "rolling without loss, by Runge-Kutta: one sense of spin reverses soon",
       MeasureRattleback},
  }};
  return kChecks;
}

}  // namespace islet
