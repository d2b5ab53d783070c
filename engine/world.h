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
//           for numerical reasons, it reports
//   threads: one caller at a time; a step runs on Settings::threads threads and its result does not depend on them
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>

#include "engine/body.h"
#include "engine/contact.h"
#include "engine/problem_record.h"
#include "engine/settings.h"
#include "engine/shape.h"
#include "engine/step_report.h"
#include "engine/world_snapshot.h"

namespace islet {

namespace parallel {
class WorkerPool;
}

struct BodyDefinition {
  Shape shape;
  BodyKind kind = BodyKind::kDynamic;
  std::optional<double> mass = {};        // [kg]; if absent: density times volume
  std::optional<Matrix3> inertia_B = {};  // [kg m^2]; if absent: of the shape filled evenly
  double density = 1;                     // [kg/m^3]
  Vector3 position_W = Vector3::Zero();   // [m] of the centre of mass
  Quaternion rotation_WB = Quaternion::Identity();
  Vector3 linear_velocity_W = Vector3::Zero();
  Vector3 angular_velocity_W = Vector3::Zero();
  double friction = 0.5;
  double restitution = 0.2;
};

struct Material {  // coefficients of one contact
  double friction, restitution;
};
// Called from worker threads for each contact; must depend on its arguments alone.
using MaterialCallback = std::function<Material(const Contact& contact, const Body& a, const Body& b)>;

class World {
 public:
  explicit World(const Settings& settings = {});
  // Runs on the caller's pool (which must outlive the world) instead of one of its own.
  World(const Settings& settings, parallel::WorkerPool* pool);
  ~World();
  World(World&&) noexcept;
  World& operator=(World&&) noexcept;

  int Add(const BodyDefinition& definition);  // returns the body's number, which it keeps
  void Remove(int body);                      // its number is not used again
  void Teleport(int body, const Vector3& position_W, const Quaternion& rotation_WB);
  void SetVelocity(int body, const Vector3& linear_W, const Vector3& angular_W);
  void SetForce(int body, const Vector3& force_W, const Vector3& torque_W);  // stays until changed
  void SetGravity(const Vector3& gravity_W);
  void SetMaterialCallback(MaterialCallback callback);
  void SetProblemObserver(ProblemObserver observer);  // see engine/problem_record.h; empty: none

  // Throws if two bodies overlap by more than the touch gap: names both and the depth. Step() checks the bodies that
  // were added since the last step.
  void CheckInitialOverlap();

  // Advances by dt > 0 [s].                                                                       [SM04 Fig. 1]
  StepReport Step(double dt);

  // Everything that later steps depend on, and back; see engine/world_snapshot.h.
  WorldSnapshot Save() const;
  void Restore(const WorldSnapshot& snapshot);

  std::span<const Body> bodies() const;  // including removed ones
  const Body& body(int number) const;
  const Shape& shape(int number) const;
  std::span<const Contact> contacts() const;           // touching, at the current poses
  std::span<const Contact> resolved_contacts() const;  // those that touched when the last step began
  std::span<const Vector3> impulses() const;           // [N s] of the last step at the resolved contacts, W, on body_b
  const Settings& settings() const;
  double time() const;              // [s]
  std::uint64_t StateHash() const;  // of all poses, velocities, frozen flags, bit for bit

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace islet
