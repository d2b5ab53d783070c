// What a scene file says, read and checked: shapes made, names of shapes and materials resolved, nothing repeated yet.
//
//   units: SI      threads: plain data
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "engine/settings.h"
#include "engine/world.h"
#include "scenes/file/document.h"
#include "scenes/file/time_function.h"

namespace islet {

// A body again and again: i of counts[0], j of counts[1], k of counts[2], i fastest, each by its spacing further along x, y, z.
struct GridRepetition {
  std::array<int, 3> counts{1, 1, 1};
  Vector3 spacing = Vector3::Zero();  // [m]
};

// Each one turned by `turn` about its own centre, or with it about a point, and then a `step` further than the one before.
struct StackRepetition {
  int count = 1;
  Vector3 step = Vector3::Zero();            // [m]
  Quaternion turn = Quaternion::Identity();  // W
  std::optional<Vector3> about;              // [m] W
};

// At random places in a region, all of it inside, bounding spheres apart.
struct CloudRepetition {
  int count = 1;
  bool turn = true;                   // each its own way
  std::optional<std::uint64_t> seed;  // else that of the scene, and the number of the entry
  std::optional<Region> box;          // W; or
  Vector3 centre = Vector3::Zero();   // [m] of a ball, W
  double radius = 0;                  // [m]
};

using Repetition = std::variant<std::monostate, GridRepetition, StackRepetition, CloudRepetition>;

struct BodyEntry {
  Field place;
  std::string name;  // of all that it makes; may be empty
  BodyDefinition definition;
  Vector3 surface_velocity_B = Vector3::Zero();                   // [m/s]
  Vector3 force_W = Vector3::Zero(), torque_W = Vector3::Zero();  // [N], [N m] for the whole run
  Repetition repetition;
};

// Which bodies: those of a name, the n-th of a name, or the n-th of the world.
struct BodyChoice {
  Field place;
  std::string name;  // empty: of the world
  int number = -1;   // -1: all of the name
};

struct ForceDrive {  // on dynamic bodies, held over a step at its value in the middle
  TimeVector force_W, torque_W;
};
struct VelocityDrive {  // of kinematic bodies, held over a step at its value in the middle; none: as it is
  std::optional<TimeVector> linear_W, angular_W;
};
// Of kinematic bodies: where they began, turned by `angle` about an axis, then shifted. Met at the end of every step.
struct PoseDrive {
  TimeVector shift_W;             // [m]
  Vector3 axis_W{0, 0, 1};        // unit
  std::optional<Vector3> centre;  // [m] a point of the axis, W; none: the body's own position
  TimeFunction angle;             // [rad]
};
struct GravityDrive {  // held over a step at its value in the middle
  TimeVector gravity_W;
};

struct DriveEntry {
  Field place;
  std::optional<BodyChoice> bodies;  // none: gravity
  std::variant<ForceDrive, VelocityDrive, PoseDrive, GravityDrive> what;
};

enum class ProbeWhat { kPosition, kRotation, kVelocity, kAngularVelocity, kForce };
inline constexpr const char* kProbeNames[] = {"position", "rotation", "velocity", "angular_velocity", "force"};

struct ProbeEntry {
  BodyChoice bodies;
  std::vector<ProbeWhat> write;
};

struct SceneDescription {
  std::shared_ptr<const Document> document;  // that the places lie in
  std::string title, about, expected;
  std::uint64_t seed = 0;
  Settings settings;     // with gravity and cold volumes
  double dt = 1.0 / 30;  // [s]
  double end = 10;       // [s]
  bool stop_at_rest = true;
  std::optional<Region> bounds;    // as SceneInfo
  std::optional<double> passed_z;  // as SceneInfo
  std::vector<BodyEntry> bodies;
  std::vector<DriveEntry> drives;
  std::vector<ProbeEntry> probes;
  std::vector<std::string> meshes;  // paths of the files that were read
};

}  // namespace islet
