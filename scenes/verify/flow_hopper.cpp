#include "scenes/verify/flow_hopper.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "scenes/verify/builders.h"

namespace islet::verify {
namespace {

constexpr double kFloorThickness = 0.2;  // [m] its top is at z = 0
constexpr double kOut = -1.5;            // [m] a grain whose centre is here has left
constexpr double kGap = 0.02;            // [m] between the grains and one that is put on top of them
constexpr double kClogTime = 10;      // [sqrt(d / g)] without a grain that leaves: ten times what it takes to fall out
constexpr double kStartTime = 8;      // [sqrt(d / g)] until what was built, or blown away, flows as it will
constexpr double kSphereRoom = 1.13;  // [m] of a cell of the grid, for spheres of at most 1.1 m
constexpr double kCubeRoom = 1.5;     // [m] for cubes turned by at most 0.2

BodyDefinition Fixed(const Vector3& half_extents, const Vector3& position, const Quaternion& turn, double friction) {
  return {.shape = Shape::Box(half_extents),
          .kind = BodyKind::kFixed,
          .position_W = position,
          .rotation_WB = turn,
          .friction = friction,
          .restitution = 0};
}

// Four planks around the orifice, each from the end of the next, and four walls. A slab has two planks and two smooth panes.
void AddSilo(const HopperDefinition& silo, double depth, World* world) {
  const double inner = 0.5 * silo.orifice, outer = 0.5 * silo.width + 1;
  const double height = 2 * silo.height + 20;
  for (int side = 0; side < 4; ++side) {
    const Quaternion turn = Turn(side * 0.5 * std::numbers::pi, Vector3::UnitZ());
    const bool pane = silo.slab && side % 2 == 1;
    const Vector3 plank(0.5 * (outer - inner), 0.5 * (outer + inner), 0.5 * kFloorThickness);
    const Vector3 place(0.5 * (outer + inner), 0.5 * (outer - inner), -0.5 * kFloorThickness);
    if (!pane) world->Add(Fixed(plank, turn * place, turn, silo.friction));
    const double face = 0.5 * (side % 2 == 0 ? silo.width : depth);
    const Vector3 wall(0.5, outer, 0.5 * height);
    world->Add(Fixed(wall, turn * Vector3(face + 0.5, 0, 0.5 * height), turn, pane ? 0 : silo.friction));
  }
}

}  // namespace

Hopper::Hopper(const Settings& settings, const HopperDefinition& definition)
    : definition_(definition), world_(settings), random_(definition.seed) {
  AddSilo(definition, Depth(), &world_);
  // Materials mix by a rule; a smooth pane must stay smooth.
  world_.SetMaterialCallback([](const Contact&, const Body& a, const Body& b) {
    return Material{std::min(a.friction, b.friction), 0};
  });
  const double room = definition.cubes ? kCubeRoom : kSphereRoom;
  const int columns = static_cast<int>(definition.width / room);
  const int rows = definition.slab ? 1 : columns;
  const int layers = static_cast<int>(definition.height / room);
  for (int i = 0; i < columns * rows * layers; ++i) {
    const Vector3 cell(i % columns + 0.5, i / columns % rows + 0.5, i / (columns * rows) + 0.5);
    const Vector3 place(cell.x() * definition.width / columns - 0.5 * definition.width,
                        cell.y() * Depth() / rows - 0.5 * Depth(), cell.z() * room);
    BodyDefinition grain = definition.cubes ? Cube(place, definition.friction)
                                            : Ball(place, 0.5 * random_.Uniform(0.9, 1.1), definition.friction);
    if (definition.cubes) grain.rotation_WB = random_.Rotation(0.2);
    grain.mass.reset();
    grains_.push_back(world_.Add(grain));
  }
}

double Hopper::Depth() const { return definition_.slab ? kSlabDepth : definition_.width; }

int Hopper::Step(double dt) {
  world_.Step(dt);
  int left = 0;
  for (const int grain : grains_) {
    if (world_.body(grain).position_W.z() > kOut) continue;
    PutOnTop(grain);
    ++left;
  }
  return left;
}

void Hopper::BreakClog() {
  for (const int grain : grains_) {
    const Vector3 position = world_.body(grain).position_W;
    const double reach = 0.5 * definition_.orifice + 0.5;
    const bool above = std::abs(position.x()) < reach && (definition_.slab || std::abs(position.y()) < reach);
    if (above && position.z() < definition_.orifice) PutOnTop(grain);
  }
}

// Dropped along a vertical line it would touch the others at this height; the lowest of a few lines.
void Hopper::PutOnTop(int grain) {
  const double radius = world_.body(grain).radius + kGap;
  const double x = 0.5 * definition_.width - radius, y = std::max(0.0, 0.5 * Depth() - radius);
  Vector3 best(0, 0, std::numeric_limits<double>::infinity());
  for (int line = 0; line < 8; ++line) {
    Vector3 place(random_.Uniform(-x, x), random_.Uniform(-y, y), radius);
    for (const int other : grains_) {
      if (other == grain) continue;
      const Body& body = world_.body(other);
      const double reach = body.radius + radius;
      const double distance = (body.position_W - place).head<2>().norm();
      if (distance < reach)
        place.z() = std::max(place.z(), body.position_W.z() + std::sqrt(reach * reach - distance * distance));
    }
    if (place.z() < best.z()) best = place;
  }
  world_.Teleport(grain, best, world_.body(grain).rotation_WB);
  // Already falling, so that the next one does not have to be put on top of this one in the air.
  world_.SetVelocity(grain, {0, 0, -std::sqrt(4 * world_.settings().gravity.norm())}, Vector3::Zero());
}

double Hopper::FillHeight() const {
  double sum = 0;
  int count = 0;
  for (const int grain : grains_) {
    const double z = world_.body(grain).position_W.z();
    if (z < 0) continue;
    sum += z;
    ++count;
  }
  return 2 * sum / std::max(1, count);
}

double Hopper::SolidFraction() const {
  const double low = 1, high = std::max(2.0, 0.75 * FillHeight());
  double solid = 0;  // [m^3], of grains of 1 kg/m^3
  for (const int grain : grains_) {
    const Body& body = world_.body(grain);
    if (body.position_W.z() > low && body.position_W.z() < high) solid += body.mass;
  }
  return solid / (definition_.width * Depth() * (high - low));
}

double Hopper::GrainVolume() const {
  double sum = 0;
  for (const int grain : grains_) sum += world_.body(grain).mass;
  return sum / static_cast<double>(grains_.size());
}

Flow WatchFlow(const Settings& settings, const HopperDefinition& definition, double dt, double seconds) {
  Hopper hopper(settings, definition);
  const double unit = 1 / std::sqrt(settings.gravity.norm());  // [s] sqrt(d / g)
  Flow flow;
  flow.grain_volume = hopper.GrainVolume();
  std::vector<double> exits;                    // [s] on a clock that stands still in clogs and at starts
  double clock = -kStartTime * unit, last = 0;  // [s]
  int samples = 0;
  const int most_frames = Frames(3 * seconds, dt);
  for (int frame = 0; frame < most_frames && clock < seconds; ++frame) {
    const int left = hopper.Step(dt);
    clock += dt;
    if (clock - dt < last) continue;
    if (left > 0) last = clock;
    for (int i = 0; i < left; ++i) exits.push_back(clock);
    if (frame % 8 == 0) flow.solid_fraction += (hopper.SolidFraction() - flow.solid_fraction) / ++samples;
    if (clock - last < kClogTime * unit) continue;
    hopper.BreakClog();
    ++flow.clogs;
    clock = last - kStartTime * unit;
  }
  constexpr int kStretches = 8;
  const double flowed = std::max(std::min(std::max(clock, last), seconds), dt);
  double counts[kStretches] = {};
  for (const double exit : exits)
    counts[std::clamp(static_cast<int>(kStretches * exit / flowed), 0, kStretches - 1)] += 1;
  const double mean = static_cast<double>(exits.size()) / kStretches;
  double square = 0;
  for (const double count : counts) square += std::pow(count - mean, 2) / (kStretches - 1);
  flow.rate = static_cast<double>(exits.size()) / flowed;
  flow.error = std::sqrt(square / kStretches) * kStretches / flowed;
  return flow;
}

std::vector<int> WatchClogs(const Settings& settings, const HopperDefinition& definition, double dt, int clogs,
                            int most) {
  Hopper hopper(settings, definition);
  const int quiet = Frames(kClogTime / std::sqrt(settings.gravity.norm()), dt);
  std::vector<int> passed;
  for (int since = 0, count = 0; static_cast<int>(passed.size()) < clogs; ++since) {
    const int left = hopper.Step(dt);
    count += left;
    if (left > 0) since = 0;
    if (since < quiet && count < most) continue;
    passed.push_back(count);
    hopper.BreakClog();
    since = count = 0;
  }
  return passed;
}

}  // namespace islet::verify
