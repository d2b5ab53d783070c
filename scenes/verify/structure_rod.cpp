// T22: Painleve's rod. A rod slides on its tip; with enough friction no finite force satisfies Coulomb's law, only an
// impulse that stops the tip at once.
//
// Mass m, half length l, inertia m l^2 / 3, at angle th to the ground, leaning over +x from its tip, which slides along -x.
// An impulse (p_t, p_n) at the tip changes its velocity by W p with, from r = -l (cos th, sin th) and Newton's law,
//   W_tt = (1 + 3 sin^2) / m,  W_tn = -3 sin cos / m,  W_nn = (1 + 3 cos^2) / m
// Sliding on (p_t = mu p_n) gives the normal direction (W_nn + mu W_tn) p_n: negative if mu > (1 + 3 cos^2)/(3 sin cos), at
// least 4/3 (tan th = 2). Then neither sliding on nor lifting off is possible, and the step's one answer is p = -W^-1 q, q
// the tip's velocity with gravity's g dt: the tip stops.
#include <algorithm>
#include <array>
#include <cmath>
#include <string>

#include "scenes/verify/builders.h"
#include "scenes/verify/structure_measures.h"

namespace islet::verify {
namespace {

using Matrix2 = Eigen::Matrix2d;
using Vector2 = Eigen::Vector2d;  // (t, n)

constexpr double kHalfLength = 1;         // [m]
constexpr double kMass = 1;               // [kg]
const double kSine = 2 / std::sqrt(5.0);  // of the angle with tan = 2
const double kCosine = 1 / std::sqrt(5.0);

Matrix2 TipMobility() {
  Matrix2 w;
  w << 1 + 3 * kSine * kSine, -3 * kSine * kCosine, -3 * kSine * kCosine, 1 + 3 * kCosine * kCosine;
  return w / kMass;
}

World BuildRod(const CheckSettings& settings, double friction, double speed) {
  World world(settings.engine);
  world.Add(Floor(friction));
  // A spindle, thin so that only its tip touches; its mass is that of a thin rod.
  constexpr double kThin = 0.01;  // [m]
  const std::array<Vector3, 6> corners = {Vector3(-kHalfLength, 0, 0), Vector3(kHalfLength, 0, 0),
                                          Vector3(0, kThin, 0),        Vector3(0, -kThin, 0),
                                          Vector3(0, 0, kThin),        Vector3(0, 0, -kThin)};
  const double across = kMass * kHalfLength * kHalfLength / 3;
  world.Add({.shape = Shape::ConvexHull(corners),
             .mass = kMass,
             .inertia_B = Vector3(1e-3 * across, across, across).asDiagonal().toDenseMatrix(),
             .position_W = {kHalfLength * kCosine, 0, kHalfLength * kSine},
             .rotation_WB = Turn(-std::atan2(kSine, kCosine), Vector3::UnitY()),
             .linear_velocity_W = {-speed, 0, 0},
             .friction = friction,
             .restitution = 0});
  return world;
}

// So short that the rod stands still: what the impulses are does not depend on how a step moves it.
constexpr double kInstant = 1e-8;  // [s]

struct RodStep {
  Vector2 impulse;    // [N s] on the tip
  double tip = 0;     // [m/s] of the tip after the step
  double energy = 0;  // [J] kinetic, gained by the impulse
};

RodStep StepRod(const CheckSettings& settings, double friction, double speed, double dt) {
  World world = BuildRod(settings, friction, speed);
  world.Step(dt);
  const Vector3 impulse = ImpulseOn(world, 1);
  RodStep step{.impulse = {impulse.x(), impulse.z()}};
  const Body& rod = world.body(1);
  step.tip = rod.VelocityAt(rod.position_W - kHalfLength * (rod.rotation_WB * Vector3::UnitX())).norm();
  const Vector2 q(-speed, -kGravity * dt);
  step.energy = q.dot(step.impulse) + 0.5 * step.impulse.dot(TipMobility() * step.impulse);
  return step;
}

void MeasureParadox(const CheckSettings& settings, Measurements* out) {
  constexpr double kFriction = 2, kSpeed = 3;
  const Vector2 exact = -(TipMobility().inverse() * Vector2(-kSpeed, -kGravity * kInstant));
  const RodStep step = StepRod(settings, kFriction, kSpeed, kInstant);
  out->Relative("normal impulse that stops the tip, mu = 2", "N s", exact.y(), step.impulse.y(), 1e-6);
  out->Relative("friction impulse, mu = 2", "N s", exact.x(), step.impulse.x(), 1e-6);
  out->AtMost("kinetic energy that the impulse adds, mu = 2", "J", step.energy, 0);
  for (const double dt : {kInstant, 1e-6, settings.dt}) {
    out->AtMost("tip speed after a step of " + (dt == settings.dt ? "dt"
                                                : dt == kInstant  ? "1e-8 s"
                                                                  : std::string("1e-6 s")),
                "m/s", StepRod(settings, kFriction, kSpeed, dt).tip, 1e-6 * kSpeed,
                "a crowd's velocities are those of the start pose");
    if (dt == settings.dt && settings.engine.group_bodies == 0) out->Open();
  }
}

// Below the paradox the tip slides on, with p_n (W_nn + mu W_tn) = g dt.
void MeasureSliding(const CheckSettings& settings, Measurements* out) {
  constexpr double kFriction = 1.2, kSpeed = 10;
  const Matrix2 w = TipMobility();
  const double exact = kGravity * kInstant / (w(1, 1) + kFriction * w(0, 1));
  const RodStep step = StepRod(settings, kFriction, kSpeed, kInstant);
  out->Relative("normal impulse, the tip slides on, mu = 1.2", "N s", exact, step.impulse.y(), 1e-6);
  out->Relative("friction over normal impulse, mu = 1.2", "", kFriction, step.impulse.x() / step.impulse.y(), 1e-6);
}

// The whole fall, until it lies: finite, and its energy never grows.
void MeasureFall(const CheckSettings& settings, double friction, Measurements* out) {
  World world = BuildRod(settings, friction, 3);
  double energy = Energy(world), gain = 0;
  int troubled = 0;
  const double scale = energy;
  for (int frame = 0; frame < Frames(3, settings.dt); ++frame) {
    const StepReport report = world.Step(settings.dt);
    troubled += report.collision_qp.failed + report.static_qp.failed;
    gain = std::max(gain, Energy(world) - energy);
    energy = Energy(world);
  }
  const std::string name = ", mu = " + std::to_string(friction).substr(0, 3);
  out->Verdict("all finite after 3 s" + name, true, AllFinite(world));
  out->AtMost("energy gained in the worst step" + name, "of the start's", gain / scale, 1e-6,
              "what pushes an overlap of a crowd out gives height as far as there is energy");
  if (friction == 2 && settings.engine.group_bodies == 0) out->Open();
  out->AtMost("problems without a solution" + name, "", troubled, 0);
}

}  // namespace

void MeasureRod(const CheckSettings& settings, Measurements* out) {
  MeasureParadox(settings, out);
  MeasureSliding(settings, out);
  for (const double friction : {1.2, 2.0, 5.0}) MeasureFall(settings, friction, out);
}

}  // namespace islet::verify
