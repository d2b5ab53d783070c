// Contact problems that several benches measure: the largest islands of measured frames, read from a folder, and piles made
// from a seed. Metres, kilograms, seconds; cubes of edge 1 and mass 1 in the piles; one step of 1/30 s under gravity is
// in the velocities.
//
//   frame     text: "gravity x y z"; "bodies n" and n lines "id mass Ixx Iyy Izz, position, rotation w x y z, velocity,
//             angular velocity, ..." (inertia in the body's frame, the rest in the world's); "contacts m" and m lines
//             "a b, point, normal from a to b, depth mu restitution" (b = -1: a wall)
//   throws std::runtime_error where a frame cannot be read or names an unknown body
#pragma once

#include <filesystem>
#include <vector>

#include "qp/problem.h"

namespace islet::qp {

inline constexpr double kGravityStep = 9.81 / 30;  // [m/s]

struct Island {
  Problem problem;
  double scale = kGravityStep;  // [m/s] v_ref: the fastest approach, or g dt if that is more
};

// The frames (*.txt) in the folder that the environment names in ISLET_PROBLEMS, by name; if it names none, a line on
// stderr and no files.
std::vector<std::filesystem::path> MeasuredFrames();

// The island with the most bodies, as its static problem: gravity of 1/30 s is added, nothing bounces.
Island ReadLargestIsland(const std::filesystem::path& frame);

// from_a, from_b [m]: from the centres of mass to the point, ignored where the body is -1.
ContactTerm MakeContact(int a, int b, const Vector3& from_a, const Vector3& from_b, const Vector3& normal, double mu);

// Jittered cubes in a lattice of nx x ny x nz on a floor, between four walls; three contacts to each neighbour.
Island MakePile(int nx, int ny, int nz, unsigned seed = 7);

// Cubes on top of each other on a floor, each pushed sideways a little; four contacts a face.
Island MakeTower(int cubes, unsigned seed = 7);

}  // namespace islet::qp
