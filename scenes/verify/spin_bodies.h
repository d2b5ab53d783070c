// Bodies with a curved surface that spin and roll on a plane: an ellipsoid whose centre may be off the centre of mass. A sphere
// and the rim of a disk (one semi-axis 0) are ellipsoids too. None of them is a shape of the engine: SuiteRoller finds the
// contact in closed form, moves the body itself and leaves the contact to islet::ContactSuite, as another simulator would.
// ReferenceTop solves the same motion as ordinary differential equations, without any of the engine's code.
//
//   plane: z = 0, up is +z    units: SI    threads: one caller at a time
#pragma once

#include <vector>

#include "engine/contact_suite.h"
#include "engine/settings.h"
#include "parallel/worker_pool.h"

namespace islet::verify {

struct Ellipsoid {
  Vector3 semi_axes;  // [m] along the axes of B
  Vector3 centre_B;   // [m] from the centre of mass
  double mass = 1;
  Matrix3 inertia_B;  // [kg m^2] about the centre of mass

  // [m] from the centre of mass to the lowest point; down_B: unit, the plane's -z in B.
  Vector3 Lowest(const Vector3& down_B) const;
  // [m/s] of that point over the surface while down_B changes at this rate [1/s].
  Vector3 LowestRate(const Vector3& down_B, const Vector3& down_rate_B) const;
};

struct TopState {
  Vector3 position_W{0, 0, 0};  // [m] of the centre of mass
  Quaternion rotation_WB = Quaternion::Identity();
  Vector3 velocity_W{0, 0, 0};          // [m/s]
  Vector3 angular_velocity_W{0, 0, 0};  // [rad/s]
};

// The state in which the body touches the plane and its lowest point stands still.
TopState Rolling(const Ellipsoid& body, const Quaternion& rotation_WB, const Vector3& angular_velocity_W);

Vector3 ContactArm(const Ellipsoid& body, const TopState& state);  // [m] from the centre of mass to the lowest point, W
double Gap(const Ellipsoid& body, const TopState& state);          // [m]
double TopEnergy(const Ellipsoid& body, const TopState& state);    // [J] potential from z = 0
Vector3 TopMomentum(const Ellipsoid& body, const TopState& state);  // [N m s] about the centre of mass, W
Vector3 Slip(const Ellipsoid& body, const TopState& state);         // [m/s] of the material point at the contact

// Steps by the implicit midpoint rule: the contact suite resolves half a step at the middle of it, with the contact that the
// body has there, and what it answers is the mean velocity of the step. Contact forces then act with the velocity at which
// the body moves: rolling does no work, sliding takes exactly what it rubs off, all to rounding; and the motion is right to
// second order. A few repeats find the middle.
class SuiteRoller {
 public:
  SuiteRoller(const Settings& settings, const Ellipsoid& body, double friction, const TopState& start);
  void Step(double dt);

  const TopState& state() const { return state_; }
  bool froze() const { return froze_; }  // the suite once said that the body rests

 private:
  Ellipsoid body_;
  double friction_;
  parallel::WorkerPool pool_;
  ContactSuite suite_;
  TopState state_;
  std::vector<Body> bodies_;  // the plane, the body
  std::vector<Contact> contacts_;
  bool froze_ = false;
};

// Runge-Kutta of fourth order. The contact is kept: the normal force is what keeps the lowest point on the plane.
class ReferenceTop {
 public:
  // friction < 0: rolls, the friction force is what that needs.
  ReferenceTop(const Ellipsoid& body, double friction, const TopState& start);
  void Step(double dt);

  const TopState& state() const { return state_; }
  double least_normal() const { return least_normal_; }    // [N] so far; below 0 it would have left the plane
  double most_friction() const { return most_friction_; }  // largest ratio of friction to normal force so far

 private:
  using Numbers = Eigen::Matrix<double, 13, 1>;  // position, rotation's coefficients, velocity, angular velocity
  static Numbers Pack(const TopState& state);
  static TopState Unpack(const Numbers& numbers);
  Numbers Rates(const Numbers& numbers);
  Ellipsoid body_;
  double friction_;
  TopState state_;
  double least_normal_ = 1e300, most_friction_ = 0;
};

}  // namespace islet::verify
