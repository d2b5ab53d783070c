// What the checks build their worlds from, and the sums they measure: floors, unit cubes, momentum, energy, loads.
//
//   units: SI; all vectors in W    threads: one caller at a time, like World
#pragma once

#include <span>

#include "engine/world.h"

namespace islet::verify {

inline constexpr double kGravity = 9.81;  // [m/s^2]

Quaternion Turn(double angle, const Vector3& axis);  // [rad], axis of any length

// Half-space below z = 0, or turned by `incline` about y: things then slide towards +x.
BodyDefinition Floor(double friction = 0.5, double restitution = 0, double incline = 0);
// Cube of 1 m and `mass`.
BodyDefinition Cube(const Vector3& position, double friction = 0.5, double restitution = 0, double mass = 1);
BodyDefinition Ball(const Vector3& position, double radius = 0.5, double friction = 0.5, double restitution = 0,
                    double mass = 1);

void StepTimes(World* world, int frames, double dt);
int Frames(double seconds, double dt);  // rounded

// Of the dynamic bodies that are still there.
double Weight(const World& world);            // [N]
Vector3 Momentum(const World& world);         // [N s]
Vector3 AngularMomentum(const World& world);  // [N m s] about the origin
double KineticEnergy(const World& world);     // [J]
double Energy(const World& world);            // [J] and m g z for gravity along -z

// That the last step's contacts put on a body: divide by dt for the mean force.
Vector3 ImpulseOn(const World& world, int body);           // [N s]
Vector3 ImpulseBetween(const World& world, int a, int b);  // [N s] on b from a, a < b

// [m] farthest that any corner of the body's bounding box in B is from where it was in `before`.
double Travel(const Shape& shape, const Body& before, const Body& now);
bool AllFinite(const World& world);  // positions, rotations and velocities

}  // namespace islet::verify
