#include "bench/charts/chart_plans.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <stdexcept>

#include "bench/charts/polytope.h"
#include "scenes/random.h"
#include "scenes/scene.h"

namespace islet::charts {
namespace {

using peers::BodyPlan;
using peers::WorldPlan;

BodyPlan Box(const Vector3& half_extents, const Vector3& position, double mass = 0) {
  BodyPlan body{.half_extents = half_extents, .mass = mass};
  body.start.position_W = position;
  return body;
}
BodyPlan Cube(const Vector3& position, double mass = 1) { return Box({0.5, 0.5, 0.5}, position, mass); }
BodyPlan Ball(const Vector3& position, const Vector3& velocity = Vector3::Zero()) {
  BodyPlan body{.form = BodyPlan::Form::kSphere};
  body.start.position_W = position;
  body.start.linear_velocity_W = velocity;
  return body;
}
BodyPlan Floor() { return Box({100, 100, 1}, {0, 0, -1}); }

// A hull of mass 1 from corners anywhere and faces in any sense.
BodyPlan Hull(std::vector<Vector3> corners, std::vector<std::vector<int>> faces) {
  Vector3 middle = Vector3::Zero();
  for (const Vector3& corner : corners) middle += corner / static_cast<double>(corners.size());
  for (std::vector<int>& face : faces) {
    const Vector3 &p = corners[face[0]], &q = corners[face[1]], &r = corners[face[2]];
    if ((q - p).cross(r - p).dot(p - middle) < 0) std::ranges::reverse(face);
  }
  const Filling filling = FillingOf(corners, faces);
  const Matrix3 off = filling.inertia - Matrix3(filling.inertia.diagonal().asDiagonal());
  if (off.norm() > 1e-9 * filling.inertia.norm()) throw std::logic_error("a hull that is not in its principal axes");
  for (Vector3& corner : corners) corner -= filling.centre;
  BodyPlan body{.form = BodyPlan::Form::kHull,
                .corners = corners,
                .faces = faces,
                .moments_per_mass = filling.inertia.diagonal(),
                .mass = 1};
  body.start.position_W = filling.centre;
  return body;
}

}  // namespace

// A scene of the program, as a plan.
WorldPlan FromScene(std::string_view name, std::optional<int> count) {
  Settings settings;
  settings.threads = 1;
  const BuiltScene built = BuildScene(*FindScene(name), {.count = count}, settings);
  WorldPlan plan{.gravity = built.world.settings().gravity, .bodies = {}, .bounds = built.info.bounds};
  for (int i = 0; i < static_cast<int>(built.world.bodies().size()); ++i) {
    const Body& body = built.world.body(i);
    const Shape& shape = built.world.shape(i);
    BodyPlan one{.mass = body.kind == BodyKind::kDynamic ? body.mass : 0,
                 .start = {body.position_W, body.rotation_WB, body.linear_velocity_W, body.angular_velocity_W}};
    if (shape.kind() == ShapeKind::kSphere) {
      one.form = BodyPlan::Form::kSphere;
      one.radius = shape.radius();
    } else if (shape.kind() == ShapeKind::kBox) {
      one.half_extents = shape.half_extents();
    } else {
      throw std::logic_error("a shape that not every engine has");
    }
    plan.bodies.push_back(one);
    plan.friction = body.friction;
    plan.restitution = body.restitution;
  }
  return plan;
}

// One cube on a slab, at rest, at 0.99 of the angle of friction (in its tangent).
WorldPlan Incline() {
  const double angle = std::atan(0.99 * kFriction);
  const Quaternion tilt(Eigen::AngleAxisd(angle, Vector3::UnitY()));
  WorldPlan plan{.bodies = {Box({60, 5, 1}, tilt * Vector3(0, 0, -1)), Cube(tilt * Vector3(0, 0, 0.5))}};
  for (BodyPlan& body : plan.bodies) body.start.rotation_WB = tilt;
  return plan;
}

WorldPlan Slide(double angle) {
  WorldPlan plan{.bodies = {Floor(), Cube({0, 0, 0.5})}};
  plan.bodies[1].start.linear_velocity_W = kThrownSpeed * Vector3(std::cos(angle), std::sin(angle), 0);
  return plan;
}

WorldPlan Rolling() {
  const Vector3 along(std::cos(kThrownAngle), std::sin(kThrownAngle), 0);
  return {.bodies = {Floor(), Ball({0, 0, 0.5}, kThrownSpeed * along)}};
}

WorldPlan Heavy() {
  WorldPlan plan{.bodies = {Floor()}};
  double mass = 1;
  for (int level = 0; level < 4; ++level, mass *= 10) plan.bodies.push_back(Cube({0, 0, 0.5 + level}, mass));
  return plan;
}

// Five spheres, 5 cm between each two of the row: one collision at a time, so there is one right answer.
WorldPlan CradleApart() {
  WorldPlan plan{.gravity = Vector3::Zero(), .friction = 0, .restitution = 1, .bodies = {Ball({0, 0, 0}, {1, 0, 0})}};
  for (int i = 1; i < 5; ++i) plan.bodies.push_back(Ball({0.05 + 1.05 * i, 0, 0}));
  return plan;
}

// Cards 1 m high and 4 cm thick lean against each other, 20 degrees off the vertical: two pairs side by side, a long flat
// card across their tops, and a third pair in the middle of it. Everything is symmetric, so that no pair is loaded on one
// side alone.
WorldPlan CardHouse() {
  constexpr double kHalfThick = 0.02, kHalfHigh = 0.5, kHalfDeep = 0.35, kLean = std::numbers::pi / 9;
  constexpr double kMass = 0.1, kPairDistance = 0.9;
  const double sine = std::sin(kLean), cosine = std::cos(kLean);
  const double low = kHalfHigh * cosine + kHalfThick * sine;    // [m] from the foot up to the centre, and on to the top
  const double inner = kHalfHigh * sine + kHalfThick * cosine;  // [m] from the centre across to the partner's edge
  WorldPlan plan{.bodies = {Floor()}};
  const auto add_pair = [&](double x, double foot) {
    for (const double side : {-1.0, 1.0}) {
      BodyPlan card = Box({kHalfThick, kHalfDeep, kHalfHigh}, {x + side * inner, 0, foot + low}, kMass);
      card.start.rotation_WB = Quaternion(Eigen::AngleAxisd(-side * kLean, Vector3::UnitY()));
      plan.bodies.push_back(card);
    }
  };
  add_pair(-0.5 * kPairDistance, 0);
  add_pair(0.5 * kPairDistance, 0);
  plan.bodies.push_back(Box({kPairDistance, kHalfDeep, kHalfThick}, {0, 0, 2 * low + kHalfThick}, 2 * kMass));
  add_pair(0, 2 * low + 2 * kHalfThick);
  return plan;
}

// SimBenchmark's rolling: 25 spheres of 1 kg at rest on a plate of 10 kg, which is pushed along its diagonal and slides. (Its
// friction of spheres is twice as large; no sphere slips with either.)
WorldPlan Carrier() {
  WorldPlan plan{.friction = kCarrierFriction, .bodies = {Floor(), Box({10, 10, 0.5}, {0, 0, 0.5}, kCarrierMass)}};
  plan.bodies[1].push_W = kCarrierPush * Vector3(1, 1, 0).normalized();
  for (int i = 0; i < kCarriedBalls; ++i) plan.bodies.push_back(Ball({2.0 * (i % 5) - 4, 2.0 * (i / 5) - 4, 1.5}));
  return plan;
}

// SimBenchmark's 666: six layers of six by six spheres of 10 kg, no friction, a little out of line, fall on a floor.
WorldPlan Cloud(double restitution) {
  WorldPlan plan{.friction = 0, .restitution = restitution, .bodies = {Floor()}};
  SplitMix64 random(666);
  for (int i = 0; i < 216; ++i) {
    const Vector3 place(i % 6, i / 6 % 6, i / 36);
    const auto shift = [&random] { return random.Uniform(-0.02, 0.02); };
    const double x = shift(), y = shift(), z = shift();
    plan.bodies.push_back(Ball(1.1 * place + Vector3(x - 2.75, y - 2.75, z + 1)));
    plan.bodies.back().mass = 10;
  }
  return plan;
}

// Boxes of several sizes, turned anyhow, in layers of side x side, fall into a square box of a floor and four walls.
WorldPlan Bin(int boxes, int side) {
  constexpr double kPlace = 1.4, kDensity = 1;  // [m], [kg/m^3]
  const double half = 0.5 * kPlace * side, high = kPlace * (boxes / (side * side) + 1), thick = 0.5;
  WorldPlan plan{.bodies = {Floor()},
                 .bounds = Region{{-half - thick, -half - thick, 0}, {half + thick, half + thick, 2 * high}}};
  for (const double sign : {-1.0, 1.0}) {
    plan.bodies.push_back(Box({thick, half + 2 * thick, high}, {sign * (half + thick), 0, high}));
    plan.bodies.push_back(Box({half, thick, high}, {0, sign * (half + thick), high}));
  }
  SplitMix64 random(200);
  for (int i = 0; i < boxes; ++i) {
    const Vector3 place(i % side + 0.5, i / side % side + 0.5, i / (side * side) + 0.5);
    const double x = random.Uniform(0.25, 0.4), y = random.Uniform(0.25, 0.4), z = random.Uniform(0.25, 0.4);
    plan.bodies.push_back(Box({x, y, z}, kPlace * place - Vector3(half, half, 0), 8 * kDensity * x * y * z));
    plan.bodies.back().start.rotation_WB = random.Rotation(std::numbers::pi);
  }
  return plan;
}

// A semicircle of 13 wedges, 0.15 of its radius thick.
WorldPlan ArchOfWedges() {
  constexpr int kWedges = 13;
  constexpr double kRadius = 5, kHalfThick = 0.375, kHalfDeep = 0.5;  // [m]
  WorldPlan plan{.friction = kArchFriction, .bodies = {Floor()}};
  for (int i = 0; i < kWedges; ++i) {
    // In a frame whose x axis points from the centre of the arch to the middle of the wedge.
    std::vector<Vector3> corners;
    for (const double side : {-1.0, 1.0})
      for (const double radius : {kRadius - kHalfThick, kRadius + kHalfThick})
        for (const double y : {-kHalfDeep, kHalfDeep}) {
          const double angle = 0.5 * side * std::numbers::pi / kWedges;
          corners.emplace_back(radius * std::cos(angle), y, radius * std::sin(angle));
        }
    BodyPlan wedge =
        Hull(corners, {{0, 1, 3, 2}, {4, 5, 7, 6}, {0, 1, 5, 4}, {2, 3, 7, 6}, {0, 2, 6, 4}, {1, 3, 7, 5}});
    const Quaternion turn(Eigen::AngleAxisd(-std::numbers::pi * (i + 0.5) / kWedges, Vector3::UnitY()));
    wedge.start.position_W = turn * wedge.start.position_W;
    wedge.start.rotation_WB = turn;
    plan.bodies.push_back(wedge);
  }
  return plan;
}

void Shift(int start, double most, WorldPlan* plan) {
  SplitMix64 random(static_cast<std::uint64_t>(start));
  for (BodyPlan& body : plan->bodies) {
    if (!body.Moves()) continue;
    for (int k = 0; k < 3; ++k) body.start.position_W[k] += random.Uniform(-most, most);
  }
}

}  // namespace islet::charts
