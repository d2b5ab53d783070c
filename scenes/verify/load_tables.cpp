// T28: a slab on n posts. Its loads must balance its weight about every axis; only three posts have one answer.
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <string>
#include <vector>

#include "engine/contact_suite.h"
#include "parallel/worker_pool.h"
#include "scenes/verify/builders.h"
#include "scenes/verify/load_measures.h"

namespace islet::verify {
namespace {

constexpr double kSlabMass = 7;  // [kg]
constexpr double kPostRadius = 0.05;

// Posts are fixed spheres on a ring of 1 m under a slab of 3 m x 3 m x 0.2 m; one contact each, right above its centre.
struct Table {
  World world;
  int slab;
  std::vector<int> posts;  // in the order of their angles, whatever the order of their numbers
};

Vector3 PostAt(int k, int legs) {
  const double angle = 2 * std::numbers::pi * k / legs;
  return {std::cos(angle), std::sin(angle), -kPostRadius};
}

// `stride` has no factor in common with `legs`: posts get their numbers, and contacts their order, in steps of it.
Table BuildTable(const Settings& settings, int legs, int stride, const Vector3& force, const Vector3& torque) {
  Table table{World(settings), 0, std::vector<int>(legs)};
  for (int i = 0; i < legs; ++i) {
    const int k = i * stride % legs;
    BodyDefinition post = Ball(PostAt(k, legs), kPostRadius);
    post.kind = BodyKind::kFixed;
    table.posts[k] = table.world.Add(post);
  }
  table.slab = table.world.Add({.shape = Shape::Box({1.5, 1.5, 0.1}),
                                .mass = kSlabMass,
                                .position_W = {0, 0, 0.1},
                                .friction = 0.5,
                                .restitution = 0});
  table.world.SetForce(table.slab, force, torque);
  return table;
}

// [N] on the slab, post by post; and what they sum to about the slab's centre.
struct Loads {
  std::vector<Vector3> posts;
  Vector3 force = Vector3::Zero(), torque = Vector3::Zero();
};

Loads LoadsOf(const Table& table, double dt) {
  Loads loads;
  loads.posts.assign(table.posts.size(), Vector3::Zero());
  const World& world = table.world;
  for (size_t c = 0; c < world.resolved_contacts().size(); ++c) {
    const Contact& contact = world.resolved_contacts()[c];  // the slab has the highest number: body_b
    const size_t k = std::find(table.posts.begin(), table.posts.end(), contact.body_a) - table.posts.begin();
    const Vector3 force = world.impulses()[c] / dt;
    loads.posts[k] += force;
    loads.force += force;
    loads.torque += (contact.point_W - world.body(table.slab).position_W).cross(force);
  }
  return loads;
}

// Vertical loads of three posts from the balance of the vertical force and the moments about x and y: the contact points
// are at z = 0, 0.1 m below the slab's centre.
Vector3 ThreePostLoads(double vertical, const Vector3& torque) {
  Matrix3 balance;
  for (int k = 0; k < 3; ++k) balance.col(k) = Vector3(1, PostAt(k, 3).y(), -PostAt(k, 3).x());
  return balance.inverse() * Vector3(vertical, -torque.x(), -torque.y());
}

// The worst of a run, and of several.
struct TableWorst {
  double force = 0, torque = 0;  // off balance, over the weight (and 1 m)
  double speed = 0;              // [m/s] of the fastest point
  double statics = 0;            // three legs: farthest load from its one answer, over the weight
};

void RunTable(const CheckSettings& settings, const Vector3& force, const Vector3& torque, Table* table,
              TableWorst* worst) {
  const Vector3 load = force + Vector3(0, 0, -kSlabMass * kGravity);
  const Vector3 exact = ThreePostLoads(-load.z(), torque);
  for (int frame = 0; frame < Frames(1, settings.dt); ++frame) {
    table->world.Step(settings.dt);
    const Loads loads = LoadsOf(*table, settings.dt);
    const Body& slab = table->world.body(table->slab);
    worst->force = std::max(worst->force, (loads.force + load).norm() / load.norm());
    worst->torque = std::max(worst->torque, (loads.torque + torque).norm() / load.norm());
    worst->speed = std::max(worst->speed, slab.linear_velocity_W.norm() + slab.radius * slab.angular_velocity_W.norm());
    for (int k = 0; k < 3 && table->posts.size() == 3; ++k)
      worst->statics = std::max(worst->statics, std::abs(loads.posts[k].z() - exact[k]) / load.norm());
  }
}

int Stride(int legs) { return legs == 3 ? 2 : legs == 100 ? 37 : 3; }

void MeasureTable(const CheckSettings& settings, int legs, Measurements* out) {
  const std::string name = ", " + std::to_string(legs) + " legs";
  // A weight of 20 N at (0.3, -0.2), besides the slab's own.
  const Vector3 weight(0, 0, -20), moment = Vector3(0.3, -0.2, 0).cross(weight);
  TableWorst worst;
  std::array<std::vector<double>, 2> split;  // for both orders of the contacts: slab alone, then with the weight
  for (const bool shuffled : {false, true}) {
    for (const double share : {0.0, 1.0}) {
      Table table = BuildTable(settings.engine, legs, shuffled ? Stride(legs) : 1, share * weight, share * moment);
      RunTable(settings, share * weight, share * moment, &table, &worst);
      for (const Vector3& load : LoadsOf(table, settings.dt).posts) split[shuffled].push_back(load.z());
    }
  }
  const double even = kSlabMass * kGravity / legs;
  double uneven = 0, moved = 0;
  for (int k = 0; k < legs; ++k) uneven = std::max(uneven, std::abs(split[0][k] / even - 1));
  for (size_t i = 0; i < split[0].size(); ++i) moved = std::max(moved, std::abs(split[0][i] - split[1][i]) / even);
  out->AtMost("sum of loads" + name, "of the weight", worst.force, 1e-9);
  out->AtMost("moment of loads" + name, "weight x m", worst.torque, 1e-9);
  out->AtMost("fastest point" + name, "m/s", worst.speed, 1e-6 * kGravity * settings.dt);
  if (legs == 3) out->AtMost("each load against statics" + name, "of the weight", worst.statics, 1e-6);
  out->AtMost("each load against m g / n" + name, "of m g / n", uneven, 1e-6,
              legs == 3 ? "" : "other splits balance too; this is the symmetric one, of least norm");
  out->AtMost("loads after contacts change their order" + name, "of m g / n", moved, 1e-6);
}

// A unit cube of 1 kg at rest on n x n contact points with the ground, for one step under gravity and a push along x through
// its centre. Velocity after it; impulses in W.
struct GridStep {
  Body cube;
  Vector3 force = Vector3::Zero(), torque = Vector3::Zero();  // [N], [N m] of the contacts, about the centre
};

GridStep PushOnGrid(const CheckSettings& settings, int points_per_side, double push, double friction) {
  std::vector<Body> bodies(2);
  bodies[0].kind = BodyKind::kFixed;
  bodies[1].inertia_B = Matrix3::Identity() / 6;
  bodies[1].radius = std::sqrt(0.75);
  bodies[1].position_W = {0, 0, 0.5};
  bodies[1].force_W = {push, 0, 0};
  std::vector<Contact> contacts;
  for (int i = 0; i < points_per_side * points_per_side; ++i) {
    const double x = static_cast<double>(i % points_per_side) / (points_per_side - 1) - 0.5;
    const double y = static_cast<double>(i / points_per_side) / (points_per_side - 1) - 0.5;
    contacts.push_back({.body_a = 0,
                        .body_b = 1,
                        .point_W = {x, y, 0},
                        .friction = friction,
                        .feature = static_cast<std::uint32_t>(i)});
  }
  parallel::WorkerPool pool(1);
  ContactSuite suite(settings.engine, &pool);
  suite.SetGravity({0, 0, -kGravity});
  StepReport report;
  suite.Resolve(settings.dt, bodies, contacts, &report);
  GridStep step{.cube = bodies[1]};
  for (size_t c = 0; c < contacts.size(); ++c) {
    step.force += suite.impulses()[c] / settings.dt;
    step.torque += (contacts[c].point_W - bodies[1].position_W).cross(Vector3(suite.impulses()[c] / settings.dt));
  }
  return step;
}

// Held below mu m g; above it the cube gains (F - mu m g) dt / m, however the load is split: all points slide the same way.
void MeasureGrid(const CheckSettings& settings, int points_per_side, Measurements* out) {
  constexpr double kFriction = 0.5;
  const std::string name = ", cube on " + std::to_string(points_per_side * points_per_side) + " points";
  const GridStep held = PushOnGrid(settings, points_per_side, 0.9 * kFriction * kGravity, kFriction);
  const Vector3 load(0.9 * kFriction * kGravity, 0, -kGravity);
  out->AtMost("speed under 0.9 mu m g" + name, "g dt",
              (held.cube.linear_velocity_W.norm() + held.cube.radius * held.cube.angular_velocity_W.norm()) /
                  (kGravity * settings.dt),
              1e-6);
  out->AtMost("sum of loads under 0.9 mu m g" + name, "of the weight", (held.force + load).norm() / kGravity, 1e-6);
  out->AtMost("moment of loads under 0.9 mu m g" + name, "weight x m", held.torque.norm() / kGravity, 1e-6);
  const GridStep slides = PushOnGrid(settings, points_per_side, 1.5 * kFriction * kGravity, kFriction);
  out->Relative("speed gained under 1.5 mu m g" + name, "", 0.5 * kFriction * kGravity * settings.dt,
                slides.cube.linear_velocity_W.x(), 1e-6);
}

}  // namespace

void MeasureTables(const CheckSettings& settings, Measurements* out) {
  for (const int legs : {3, 4, 8, 100}) MeasureTable(settings, legs, out);
  for (const int points_per_side : {2, 4, 8}) MeasureGrid(settings, points_per_side, out);
}

}  // namespace islet::verify
