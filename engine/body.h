// One rigid body as the contact suite sees it: mass, pose, velocity, kind. No shape (see shape.h), no contacts.
//
// Frames: W world, B body. The origin of B is the centre of mass; rotation_WB takes vectors from B to W.
// Units: SI. Linear and angular velocity are both expressed in W.                                    [SM04 Sec. 3.1]
#pragma once

#include <cstdint>

#include "engine/linear_algebra.h"

namespace islet {

// What moves a body.
enum class BodyKind : std::uint8_t {
  kFixed,      // wall: never moves, carries any load
  kKinematic,  // moved by the user: prescribed velocity, carries any load
  kDynamic,    // moves under forces and contacts; may be frozen for a while
};

struct Body {
  BodyKind kind = BodyKind::kDynamic;  // what moves it
  bool frozen = false;                 // [SM04 Sec. 5.2]; only dynamic bodies freeze
  bool removed = false;  // the slot of a removed body stays, so that the numbers of the others do not change

  double mass = 1;                          // [kg], > 0 for dynamic bodies
  Matrix3 inertia_B = Matrix3::Identity();  // [kg m^2] about the centre of mass, symmetric positive definite
  double radius = 0;                        // [m] farthest point of the body from its centre of mass

  Vector3 position_W = Vector3::Zero();  // [m] centre of mass
  // Unit length; takes vectors from B to W.
  Quaternion rotation_WB = Quaternion::Identity();
  Vector3 linear_velocity_W = Vector3::Zero();   // [m/s]
  Vector3 angular_velocity_W = Vector3::Zero();  // [rad/s]

  Vector3 force_W = Vector3::Zero();   // [N] external, besides gravity; stays until it is changed
  Vector3 torque_W = Vector3::Zero();  // [N m] external, about the centre of mass

  std::uint32_t layers = 1;                  // bits: where it belongs
  std::uint32_t collides_with = 0xffffffff;  // layers whose bodies it touches; both must agree
  bool sensor = false;                       // touches nobody; tells who overlaps it

  double friction = 0.5;     // mu >= 0
  double restitution = 0.2;  // epsilon in [0, 1]
  // [m/s] of its surface along itself, beside its velocity: a conveyor's belt. A motor drives it: friction on it may do work.
  Vector3 surface_velocity_B = Vector3::Zero();
  // The same and the velocities in the step before, which a world keeps: what rides on a wall or a belt feels their change over a whole step.
  Vector3 surface_before_B = Vector3::Zero();  // [m/s]
  Vector3 linear_before_W = Vector3::Zero();   // [m/s]
  Vector3 angular_before_W = Vector3::Zero();  // [rad/s]
  // A wall that goes in a circle, and so on an arc, has the velocity of its chord. Where the step before ended it was faster by this.
  Vector3 beyond_before_W = Vector3::Zero();  // [m/s]
  // By which it speeds up on its arc while a step is under way.
  Vector3 arc_W = Vector3::Zero();  // [m/s^2]
  // Whether it rode in the step before: went along, as one with them, with walls or belts whose velocity changed. A world keeps it, too.
  bool rides = false;

  // A body that contact impulses can move in the collision and static-contact problems of this moment.
  bool Moves() const { return kind == BodyKind::kDynamic && !frozen && !removed; }

  Matrix3 InertiaW() const;                                             // [kg m^2] in W
  Matrix3 InverseInertiaW() const;                                      // [1/(kg m^2)] in W
  double KineticEnergy() const;                                         // [J]
  Vector3 AngularMomentumW() const;                                     // [N m s] about the centre of mass
  Vector3 VelocityAt(const Vector3& point_W) const;                     // [m/s] of the body's material point at point_W
  void ApplyImpulse(const Vector3& impulse_W, const Vector3& point_W);  // [N s]; [SM04 Eq. 11, 12]
};

}  // namespace islet
