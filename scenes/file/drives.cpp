#include "scenes/file/drives.h"

#include <cmath>
#include <map>
#include <numbers>
#include <string>

#include "engine/rotation.h"

namespace islet {
namespace {

void Require(const DriveEntry& entry, const Body& body, BodyKind kind, const char* why) {
  if (body.kind != kind) entry.bodies->place.Fail(why);
}

// A body that is there already stands still to the last bit, so that what lies on it may freeze.
void MoveOrHold(int number, const Pose& pose, double dt, World* world) {
  constexpr double kThere = 1e-12;  // [m] per m from the origin, [rad]
  const Body& body = world->body(number);
  const bool there = (pose.position_W - body.position_W).norm() <= kThere * (1 + pose.position_W.norm()) &&
                     pose.rotation_WB.angularDistance(body.rotation_WB) <= kThere;
  if (!there) return world->MoveTo(number, pose.position_W, pose.rotation_WB, dt);
  if (!body.linear_velocity_W.isZero(0) || !body.angular_velocity_W.isZero(0))
    world->SetVelocity(number, Vector3::Zero(), Vector3::Zero());
}

}  // namespace

Drives::Drives(const SceneDescription& description, const MadeScene& made) : drives_(description.drives) {
  std::map<int, size_t> driven_by;
  bool gravity = false;
  for (size_t d = 0; d < drives_.size(); ++d) {
    const DriveEntry& entry = drives_[d];
    if (!entry.bodies) {
      if (gravity) entry.place.Refuse("gravity is driven already");
      gravity = true;
      continue;
    }
    for (const int number : ChosenBodies(made, *entry.bodies)) {
      const Body& body = made.world.body(number);
      if (std::holds_alternative<ForceDrive>(entry.what)) {
        Require(entry, body, BodyKind::kDynamic, "forces act on dynamic bodies alone");
      } else {
        Require(entry, body, BodyKind::kKinematic, "only kinematic bodies can be moved");
      }
      const auto [other, fresh] = driven_by.try_emplace(number, d);
      if (!fresh) entry.bodies->place.Fail("is driven by drives[" + std::to_string(other->second) + "] already");
      driven_.push_back({number, d, {body.position_W, body.rotation_WB}, body.force_W, body.torque_W});
    }
  }
}

void Drives::Apply(double time, double dt, World* world) const {
  const double middle = time + 0.5 * dt;
  for (const DriveEntry& entry : drives_) {
    const auto* drive = std::get_if<GravityDrive>(&entry.what);
    if (!drive) continue;
    const Vector3 gravity = At(drive->gravity_W, middle);
    if (gravity != world->settings().gravity) world->SetGravity(gravity);
  }
  for (const Driven& d : driven_) {
    const auto& what = drives_[d.drive].what;
    if (const auto* force = std::get_if<ForceDrive>(&what)) {
      world->SetForce(d.body, d.force_W + At(force->force_W, middle), d.torque_W + At(force->torque_W, middle));
    } else if (const auto* velocity = std::get_if<VelocityDrive>(&what)) {
      const Body& body = world->body(d.body);
      const Vector3 linear = velocity->linear_W ? At(*velocity->linear_W, middle) : body.linear_velocity_W,
                    angular = velocity->angular_W ? At(*velocity->angular_W, middle) : body.angular_velocity_W;
      if (linear != body.linear_velocity_W || angular != body.angular_velocity_W)
        world->SetVelocity(d.body, linear, angular);
    } else if (const auto* pose = std::get_if<PoseDrive>(&what)) {
      const Quaternion turn = Exp(pose->angle.At(time + dt) * pose->axis_W);
      const Vector3 centre = pose->centre.value_or(d.start.position_W);
      const Vector3 place = centre + turn * (d.start.position_W - centre) + At(pose->shift_W, time + dt);
      MoveOrHold(d.body, {place, (turn * d.start.rotation_WB).normalized()}, dt, world);
      // More than half a turn in a step: MoveTo would go the short way.
      const double turned = pose->angle.At(time + dt) - pose->angle.At(time);
      const Body& body = world->body(d.body);
      if (std::abs(turned) > std::numbers::pi)
        world->SetVelocity(d.body, body.linear_velocity_W, turned / dt * pose->axis_W);
    }
  }
}

}  // namespace islet
