// The front door: a world of bodies that moves in steps. Ten lines make a simulation:
//
//   islet::World world;
//   world.Add({.shape = islet::Shape::HalfSpace(), .kind = islet::BodyKind::kFixed});
//   const int cube = world.Add({.shape = islet::Shape::Box({0.5, 0.5, 0.5}), .position_W = {0, 0, 2}});
//   for (int i = 0; i < 60; ++i) {
//     const islet::StepReport report = world.Step(1.0 / 60);
//     std::printf("%g %g\n", world.body(cube).position_W.z(), report.certificate.natural_map_max);
//   }
//
//   errors: a bad value throws std::invalid_argument that names the field, the body and the value; a step never throws
//           for numerical reasons, it reports. What a callback throws reaches the caller, and the world is as it was before the step.
//           To change, save or ask a world that is in a step, from a callback or another thread, throws std::logic_error; spans and
//           bodies that are read meanwhile are unfinished
//   threads: one caller at a time; a step runs on Settings::threads threads and its result does not depend on them
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "engine/body.h"
#include "engine/collision_callback.h"
#include "engine/contact.h"
#include "engine/contact_events.h"
#include "engine/problem_record.h"
#include "engine/settings.h"
#include "engine/shape.h"
#include "engine/step_report.h"
#include "engine/world_snapshot.h"

namespace islet {

namespace parallel {
class WorkerPool;
}

// What World::Add makes a body of.
struct BodyDefinition {
  // In B, whose origin is the centre of mass.
  Shape shape;
  BodyKind kind = BodyKind::kDynamic;     // what moves it
  std::optional<double> mass = {};        // [kg]; if absent: density times volume
  std::optional<Matrix3> inertia_B = {};  // [kg m^2]; if absent: of the shape filled evenly
  double density = 1;                     // [kg/m^3]
  Vector3 position_W = Vector3::Zero();   // [m] of the centre of mass
  // Unit length; takes vectors from B to W.
  Quaternion rotation_WB = Quaternion::Identity();
  Vector3 linear_velocity_W = Vector3::Zero();   // [m/s]
  Vector3 angular_velocity_W = Vector3::Zero();  // [rad/s]
  double friction = 0.5;                         // mu in [0, 1e4]
  double restitution = 0.2;                      // epsilon in [0, 1]
  std::uint32_t layers = 1;                      // bits: where it belongs
  std::uint32_t collides_with = 0xffffffff;      // layers whose bodies it touches; both must agree
  bool sensor = false;                           // touches nobody; World::events() tells who overlaps it
  std::uint64_t user_data = 0;                   // the engine does not look at it
};

// A body for as long as it lives: the number of a removed one is used again, its id is not.
struct BodyId {
  int number = -1;                                 // as World::Add returned it; -1: nobody
  std::uint32_t generation = 0;                    // how many bodies had the number before
  bool operator==(const BodyId&) const = default;  // the same body
};

// What a ray or a moving shape meets first.
struct CastHit {
  int body;          // its number
  double share;      // of the way, in [0, 1]
  Vector3 point_W;   // [m]
  Vector3 normal_W;  // unit, out of the body; against the way where it begins inside
};

// Coefficients of one contact.
struct Material {
  double friction, restitution;  // mu in [0, 1e4], epsilon in [0, 1]
};
// Called from worker threads for each contact; must depend on its arguments alone.
using MaterialCallback = std::function<Material(const Contact& contact, const Body& a, const Body& b)>;

class World {
 public:
  explicit World(const Settings& settings = {});  // runs on Settings::threads threads of its own
  // Runs on the caller's pool (which must outlive the world) instead of one of its own.
  World(const Settings& settings, parallel::WorkerPool* pool);
  ~World();
  World(World&&) noexcept;             // a world that was moved from may be assigned to or destroyed, no more
  World& operator=(World&&) noexcept;  // the same

  int Add(const BodyDefinition& definition);  // returns the body's number, which it keeps
  // The next body added may get its number, from the next step on; its id stays dead.
  void Remove(int body);
  BodyId id(int body) const;    // of a body that lives, else it throws
  bool Lives(BodyId id) const;  // false once that body is removed, whoever has its number now

  // [m], unit length. Wakes the body; its velocity stays.
  void Teleport(int body, const Vector3& position_W, const Quaternion& rotation_WB);
  // [m/s], [rad/s]. Wakes the body; throws for a fixed one, unless both are zero.
  void SetVelocity(int body, const Vector3& linear_W, const Vector3& angular_W);
  // [N], [N m]; stays until changed. Of a body that is not dynamic it waits until it is.
  void SetForce(int body, const Vector3& force_W, const Vector3& torque_W);
  // Sets the velocities that take a kinematic body there in a step of dt [s]. They stay; call it again before each step. Between the two poses it
  // goes straight, or on an arc where it has gone in a circle since the step before.
  void MoveTo(int body, const Vector3& position_W, const Quaternion& rotation_WB, double dt);
  // A body that becomes fixed loses its velocity; one that becomes dynamic has the mass that it was given last, and goes on as it went: from the end of its arc along that. Wakes all bodies.
  void SetKind(int body, BodyKind kind);
  void SetMass(int body, double mass);  // [kg]; the inertia changes with it
  // [kg], [kg m^2] about the centre of mass.
  void SetMass(int body, double mass, const Matrix3& inertia_B);
  // Friction in [0, 1e4], restitution in [0, 1]. Wakes the body and whom it touches.
  void SetMaterial(int body, double friction, double restitution);
  // [m/s] of its surface along itself, as of a conveyor's belt; of bodies of any kind. Wakes all bodies.
  void SetSurfaceVelocity(int body, const Vector3& velocity_B);
  // Who touches whom. Both wake all bodies.
  void SetLayers(int body, std::uint32_t layers, std::uint32_t collides_with);
  void SetCollision(int body, int other, bool collide);  // of these two alone; until one of them is removed
  void SetUserData(int body, std::uint64_t data);        // the engine does not look at it
  void SetGravity(const Vector3& gravity_W);             // [m/s^2]
  void SetMaterialCallback(MaterialCallback callback);   // in place of MixFriction and MixRestitution; empty: those
  // Asked of each pair that comes near while one of it is awake, beside layers and SetCollision(); empty: these alone. Not of sensors.
  void SetCollisionCallback(CollisionCallback callback);
  void SetProblemObserver(ProblemObserver observer);  // see engine/problem_record.h; empty: none

  // Throws if a body that was added since the last step overlaps another by more than ten touch gaps, more than steps leave: names both and
  // the depth; contacts() are then those of the present poses. Step() asks the same first, and leaves them as they were.
  void CheckInitialOverlap();

  // Advances by dt > 0 [s].                                                                       [SM04 Fig. 1]
  StepReport Step(double dt);

  // Everything that later steps depend on, and back; see engine/world_snapshot.h.
  WorldSnapshot Save() const;
  void Restore(const WorldSnapshot& snapshot);  // goes back there; settings but gravity, and callbacks, stay
  // Poses and velocities alone, 104 bytes a body: with Settings::stateless later steps depend on nothing else, and a world with the same
  // bodies that restores them goes on bit for bit (rollback). Time, forces and materials are the caller's.
  std::vector<std::byte> SaveMotion() const;
  void RestoreMotion(std::span<const std::byte> bytes);  // goes back there; throws unless there are as many bodies

  std::span<const Body> bodies() const;       // including removed ones
  const Body& body(int number) const;         // also of a removed one, until its number is used again
  const Shape& shape(int number) const;       // the same
  std::uint64_t user_data(int number) const;  // of a body that lives, else it throws
  std::span<const Contact> contacts() const;  // touching, where the last step ended
  // Where impulses acted in the last step: once in each piece of it, in the order of time; where bodies and feature are those of a
  // contact in contacts(), it is the same one.
  std::span<const Contact> resolved_contacts() const;
  std::span<const Vector3> impulses() const;  // [N s] of the last step at the resolved contacts, W, on body_b
  Vector3 ImpulseOn(int body) const;  // [N s] of all contacts in the last step, W; of a body that lives, else it throws

  // Of the last step, by (body_a, body_b): pairs that touch or touched, those with sensors too; and what hit, each pair once.
  std::span<const ContactEvent> events() const;
  std::span<const HitEvent> hits() const;  // of the last step, see events()

  // What a ray from origin to origin + way meets first, sensors too; the smaller number where two are met together. layers: of the bodies
  // looked at.
  std::optional<CastHit> CastRay(const Vector3& origin_W, const Vector3& way_W,
                                 std::uint32_t layers = 0xffffffff) const;
  // The same of a shape that moves without turning, which is no half-space. The share is good to 1e-6 of its size.
  std::optional<CastHit> CastShape(const Shape& shape, const Vector3& position_W, const Quaternion& rotation_WB,
                                   const Vector3& way_W, std::uint32_t layers = 0xffffffff) const;
  // Bodies that overlap a shape, ascending.
  std::vector<int> Overlapping(const Shape& shape, const Vector3& position_W, const Quaternion& rotation_WB,
                               std::uint32_t layers = 0xffffffff) const;

  const Settings& settings() const;  // with the present gravity
  double time() const;               // [s] sum of all steps
  std::uint64_t StateHash() const;   // of all poses, velocities, frozen flags, bit for bit

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace islet
