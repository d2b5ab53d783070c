#include "scenes/verify/builders.h"

#include <algorithm>
#include <cmath>

namespace islet::verify {
namespace {

bool Counts(const Body& b) { return b.kind == BodyKind::kDynamic && !b.removed; }

}  // namespace

Quaternion Turn(double angle, const Vector3& axis) { return Quaternion(Eigen::AngleAxisd(angle, axis.normalized())); }

BodyDefinition Floor(double friction, double restitution, double incline) {
  return {.shape = Shape::HalfSpace(),
          .kind = BodyKind::kFixed,
          .rotation_WB = Turn(incline, Vector3::UnitY()),
          .friction = friction,
          .restitution = restitution};
}

BodyDefinition Cube(const Vector3& position, double friction, double restitution, double mass) {
  return {.shape = Shape::Box({0.5, 0.5, 0.5}),
          .mass = mass,
          .position_W = position,
          .friction = friction,
          .restitution = restitution};
}

BodyDefinition Ball(const Vector3& position, double radius, double friction, double restitution, double mass) {
  return {.shape = Shape::Sphere(radius),
          .mass = mass,
          .position_W = position,
          .friction = friction,
          .restitution = restitution};
}

void StepTimes(World* world, int frames, double dt) {
  for (int i = 0; i < frames; ++i) world->Step(dt);
}

int Frames(double seconds, double dt) { return static_cast<int>(std::lround(seconds / dt)); }

double Weight(const World& world) {
  double mass = 0;
  for (const Body& b : world.bodies())
    if (Counts(b)) mass += b.mass;
  return mass * world.settings().gravity.norm();
}

Vector3 Momentum(const World& world) {
  Vector3 sum = Vector3::Zero();
  for (const Body& b : world.bodies())
    if (Counts(b)) sum += b.mass * b.linear_velocity_W;
  return sum;
}

Vector3 AngularMomentum(const World& world) {
  Vector3 sum = Vector3::Zero();
  for (const Body& b : world.bodies())
    if (Counts(b)) sum += b.position_W.cross(b.mass * b.linear_velocity_W) + b.AngularMomentumW();
  return sum;
}

double KineticEnergy(const World& world) {
  double energy = 0;
  for (const Body& b : world.bodies())
    if (Counts(b)) energy += b.KineticEnergy();
  return energy;
}

double Energy(const World& world) {
  const double gravity = world.settings().gravity.norm();
  double energy = 0;
  for (const Body& b : world.bodies())
    if (Counts(b)) energy += b.KineticEnergy() + b.mass * gravity * b.position_W.z();
  return energy;
}

Vector3 ImpulseOn(const World& world, int body) {
  Vector3 sum = Vector3::Zero();
  for (size_t c = 0; c < world.resolved_contacts().size(); ++c) {
    if (world.resolved_contacts()[c].body_a == body) sum -= world.impulses()[c];
    if (world.resolved_contacts()[c].body_b == body) sum += world.impulses()[c];
  }
  return sum;
}

Vector3 ImpulseBetween(const World& world, int a, int b) {
  Vector3 sum = Vector3::Zero();
  for (size_t c = 0; c < world.resolved_contacts().size(); ++c) {
    const Contact& contact = world.resolved_contacts()[c];
    if (contact.body_a == a && contact.body_b == b) sum += world.impulses()[c];
  }
  return sum;
}

double Travel(const Shape& shape, const Body& before, const Body& now) {
  double farthest = 0;
  for (int corner = 0; corner < 8; ++corner) {
    const Vector3 sign(corner & 1 ? 1 : -1, corner & 2 ? 1 : -1, corner & 4 ? 1 : -1);
    const Vector3 p = sign.cwiseProduct(shape.half_extents());
    const double way = (now.position_W + now.rotation_WB * p - before.position_W - before.rotation_WB * p).norm();
    farthest = Worse(farthest, way);
  }
  return farthest;
}

bool AllFinite(const World& world) {
  return std::all_of(world.bodies().begin(), world.bodies().end(), [](const Body& b) {
    return b.position_W.allFinite() && b.rotation_WB.coeffs().allFinite() && b.linear_velocity_W.allFinite() &&
           b.angular_velocity_W.allFinite();
  });
}

}  // namespace islet::verify
