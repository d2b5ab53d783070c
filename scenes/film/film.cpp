#include "scenes/film/film.h"

#include <algorithm>
#include <numeric>
#include <unordered_map>
#include <utility>

namespace islet {
namespace {

std::array<float, 3> ToFloats(const Vector3& v) {
  return {static_cast<float>(v.x()), static_cast<float>(v.y()), static_cast<float>(v.z())};
}

std::array<float, 7> PoseOf(const Body& body) {
  const Vector3& p = body.position_W;
  const Quaternion& q = body.rotation_WB;
  return {static_cast<float>(p.x()), static_cast<float>(p.y()), static_cast<float>(p.z()), static_cast<float>(q.x()),
          static_cast<float>(q.y()), static_cast<float>(q.z()), static_cast<float>(q.w())};
}

// Per body that moves the smallest number of those that contacts join to it; -1 of the others.
std::vector<int> IslandsOf(const World& world) {
  const std::span<const Body> bodies = world.bodies();
  std::vector<int> island(bodies.size());
  std::iota(island.begin(), island.end(), 0);
  const auto root = [&](int i) {
    while (island[i] != i) i = island[i] = island[island[i]];
    return i;
  };
  for (const Contact& c : world.resolved_contacts()) {
    if (!bodies[c.body_a].Moves() || !bodies[c.body_b].Moves()) continue;
    const int a = root(c.body_a), b = root(c.body_b);
    island[std::max(a, b)] = std::min(a, b);
  }
  for (size_t i = 0; i < bodies.size(); ++i) island[i] = bodies[i].Moves() ? root(static_cast<int>(i)) : -1;
  return island;
}

FilmNumbers NumbersOf(const World& world, const StepReport& report, double step_seconds, double start) {
  FilmNumbers n;
  n.contacts = report.contacts;
  n.islands = static_cast<int>(report.islands.size());
  n.awake = report.awake;
  n.frozen = report.frozen;
  n.step_seconds = step_seconds;
  n.stages = report.seconds;
  n.kinetic = report.kinetic_energy;
  n.potential = PotentialEnergy(world) - start;
  n.coulomb_map = report.certificate.coulomb_map_max;
  n.penetration = report.penetration_max;
  n.energy_created = report.ledger.energy_created.value;
  n.momentum_unexplained = report.ledger.momentum_unexplained.value;
  n.angular_momentum_unexplained = report.ledger.angular_momentum_unexplained.value;
  n.sides_changed = report.ledger.sides_changed;
  n.overlapping = report.overlapping;
  n.missed = report.collision_qp.missed + report.static_qp.missed;
  n.unsolved = report.collision_qp.failed + report.static_qp.failed;
  n.failed = report.Failed();
  return n;
}

// What a step's report would tell of the start.
void TellStart(const World& world, FilmNumbers* numbers) {
  for (const Body& body : world.bodies()) {
    if (body.kind != BodyKind::kDynamic || body.removed) continue;
    numbers->kinetic += body.KineticEnergy();
    ++(body.frozen ? numbers->frozen : numbers->awake);
  }
}

}  // namespace

const char* NameOf(ShapeKind kind) {
  switch (kind) {
    case ShapeKind::kSphere:
      return "sphere";
    case ShapeKind::kBox:
      return "box";
    case ShapeKind::kHalfSpace:
      return "half-space";
    case ShapeKind::kConvexHull:
      return "hull";
    case ShapeKind::kCapsule:
      return "capsule";
    case ShapeKind::kCylinder:
      return "cylinder";
    case ShapeKind::kCustom:
      break;
  }
  return "custom";
}

double PotentialEnergy(const World& world) {
  double sum = 0;
  for (const Body& body : world.bodies())
    if (body.kind == BodyKind::kDynamic && !body.removed)
      sum -= body.mass * world.settings().gravity.dot(body.position_W);
  return sum;
}

FilmHead HeadOf(const World& world, double dt, std::string scene, std::string command, std::optional<Region> bounds) {
  FilmHead head;
  head.scene = std::move(scene);
  head.command = std::move(command);
  head.dt = dt;
  head.tolerance = world.settings().tolerance;
  head.gravity_W = world.settings().gravity;
  head.bounds = std::move(bounds);
  std::unordered_map<const Shape::Data*, int> known;
  for (size_t i = 0; i < world.bodies().size(); ++i) {
    const Shape& shape = world.shape(static_cast<int>(i));
    const auto [place, added] = known.try_emplace(&shape.data(), static_cast<int>(head.shapes.size()));
    if (added) head.shapes.push_back(shape);
    const Body& body = world.bodies()[i];
    head.bodies.push_back({place->second, body.kind, body.kind == BodyKind::kDynamic ? body.mass : 0});
  }
  return head;
}

FilmFrame FrameOf(const World& world, const StepReport& report, int number, double step_seconds, double start) {
  FilmFrame frame;
  frame.number = number;
  frame.time = world.time();
  frame.state_hash = world.StateHash();
  frame.island = IslandsOf(world);
  std::unordered_map<int, double> map_of;
  for (const IslandReport& island : report.islands) map_of[island.first_body] = island.map;
  for (size_t i = 0; i < world.bodies().size(); ++i) {
    const Body& body = world.bodies()[i];
    frame.poses.push_back(PoseOf(body));
    frame.frozen.push_back(body.frozen);
    const auto map = map_of.find(frame.island[i]);
    frame.accuracy.push_back(map == map_of.end() ? 0.0f : static_cast<float>(map->second));
  }
  const std::span<const Contact> contacts = world.resolved_contacts();
  const std::span<const Vector3> impulses = world.impulses();
  for (size_t c = 0; c < contacts.size(); ++c)
    frame.contacts.push_back({contacts[c].body_a, contacts[c].body_b, ToFloats(contacts[c].point_W),
                              ToFloats(contacts[c].normal_W), ToFloats(impulses[c])});
  frame.numbers = NumbersOf(world, report, step_seconds, start);
  if (number == 0) TellStart(world, &frame.numbers);
  return frame;
}

}  // namespace islet
