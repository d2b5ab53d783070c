// Small islands of rigid bodies in contact, as problems for the solvers: hand-built ones from points and normals, and
// random families from a seed. Metres, kilograms, seconds; gravity along -z, already in the velocities where it says
// so.
//   families  chain      each body touches the next, the first the ground
//             cluster    bodies thrown on the ground; pairs that are close touch
//             stack      boxes on each other with four contacts per face: the impulses are redundant
//   deterministic: the same seed gives the same problem on every machine with this standard library
#pragma once

#include <cstdint>
#include <random>
#include <string>
#include <vector>

#include "qp/problem.h"

namespace islet::testing {

using qp::ContactTerm;
using qp::Matrix3;
using qp::Problem;
using qp::Vector3;
using qp::Vector6;

class Random {
 public:
  explicit Random(std::uint32_t seed) : engine_(seed) {}
  double Uniform(double lower, double upper) { return std::uniform_real_distribution<double>(lower, upper)(engine_); }
  int Integer(int lower, int upper) { return std::uniform_int_distribution<int>(lower, upper)(engine_); }  // inclusive
  Vector3 Vector(double size);
  Vector3 Direction();
  Matrix3 Rotation();
  Matrix3 PositiveDefinite(double smallest, double largest);  // eigenvalues in that range
  std::mt19937& engine() { return engine_; }

 private:
  std::mt19937 engine_;
};

class ProblemBuilder {
 public:
  // inertia [kg m^2] in the world frame. Returns the body's number.
  int AddBody(const Vector3& position, double mass, const Matrix3& inertia, const Vector6& velocity = Vector6::Zero());
  int AddBox(const Vector3& position, const Vector3& half, double mass, const Vector3& velocity = Vector3::Zero());
  // normal from a into b; -1: immovable. Tangents are chosen by the builder. Returns the contact's number.
  int AddContact(int a, int b, const Vector3& point, const Vector3& normal, double friction);
  // The four corners of a horizontal face of half-widths x, y with its centre at `centre`, normal +z.
  void AddFace(int below, int above, const Vector3& centre, double x, double y, double friction);

  Problem problem;
  std::vector<Vector3> positions;  // [m] centre of mass, per body
};

// Two unit vectors that make a right-handed frame with the normal.
void MakeTangents(const Vector3& normal, Vector3* t1, Vector3* t2);

struct NamedProblem {
  std::string name;
  Problem problem;
};

// mass_ratio: heaviest body over lightest. friction: drawn between the two.
Problem RandomChain(Random* random, int bodies, double friction_low, double friction_high, double mass_ratio);
Problem RandomCluster(Random* random, int bodies, double friction_low, double friction_high, double mass_ratio);
Problem RandomStack(Random* random, int boxes, double friction_low, double friction_high, double mass_ratio);

// A mix of all families, frictions 0 to 2, mass ratios 1 to largest_ratio. bounces: contacts that approach get targets
// -epsilon u_n with a random restitution.
std::vector<NamedProblem> RandomIslands(std::uint32_t seed, int count, double largest_ratio, bool bounces);

// Targets -restitution u_n at all contacts that approach with their free velocities.
void SetBounces(double restitution, Problem* problem);

// [kg m^2/s^2] 1/2 v^T M v.
double KineticEnergy(const Problem& problem, const std::vector<double>& velocities);
std::vector<double> FreeVelocities(const Problem& problem);
// Largest approach, or g dt if that is more: the scale that tolerances refer to [m/s].
double VelocityScale(const Problem& problem);
// Largest component of M (v - v0) - J^T j, as a velocity: divided by mass and inertia [m/s, rad/s].
double MomentumResidual(const Problem& problem, const std::vector<double>& velocities,
                        const std::vector<Vector3>& impulses);
// sqrt(sum_i dv_i^T M_i dv_i / sum_i m_i) [m/s].
double VelocityDistance(const Problem& problem, const std::vector<double>& a, const std::vector<double>& b);

}  // namespace islet::testing
