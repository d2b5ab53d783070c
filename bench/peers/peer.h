// What a chart needs of an engine: build a world from a plan, step it, read it. One file per engine implements it, each
// in a program of its own, so that no two engines share a process.
//
//   in:  a WorldPlan (what is in the world) and a Setting (how the engine is to solve it)    out: poses and velocities
//   plan: friction and restitution hold for every pair; an adaptor sets whatever its engine mixes to these values
//   rule: a setting is the engine's own default but for what the Setting names, and what the adaptor's head comment tells
//   note: this header is C++17, for an engine whose headers are
//   errors: an engine that cannot hold the plan throws std::runtime_error; the chart then says "refused"
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "engine/linear_algebra.h"
#include "engine/settings.h"

namespace islet::peers {

inline constexpr int kRefusedExit = 3;  // an adaptor that cannot throw ends the process of its run with this

struct State {
  Vector3 position_W = Vector3::Zero();  // [m] centre of mass
  Quaternion rotation_WB = Quaternion::Identity();
  Vector3 linear_velocity_W = Vector3::Zero();   // [m/s]
  Vector3 angular_velocity_W = Vector3::Zero();  // [rad/s]
};

struct BodyPlan {
  enum class Form { kBox, kSphere, kHull };
  Form form = Form::kBox;
  Vector3 half_extents{0.5, 0.5, 0.5};         // [m] of a box
  double radius = 0.5;                         // [m] of a sphere
  std::vector<Vector3> corners = {};           // [m] of a hull, B, about its centre of mass
  std::vector<std::vector<int>> faces = {};    // of a hull: corners, counter-clockwise seen from outside
  Vector3 moments_per_mass = Vector3::Zero();  // [m^2] of a hull, about the axes of B, which must be its principal ones
  double mass = 1;                             // [kg] filled evenly; 0: static
  State start = {};
  Vector3 push_W = Vector3::Zero();  // [N] a constant force at the centre of mass
  bool Moves() const { return mass > 0; }
  Vector3 Inertia() const;  // [kg m^2] principal moments about the centre of mass
};

struct WorldPlan {
  Vector3 gravity{0, 0, -9.81};  // [m/s^2]
  double friction = 0.5;         // of every pair
  double restitution = 0;        // of every pair
  std::vector<BodyPlan> bodies = {};
  std::optional<Region> bounds = {};  // [m] a body whose centre is outside is lost
};

struct Setting {
  std::string solver = {};  // names a line of the chart: "SI", "QuickStep"
  std::string sweep = {};   // which knob this point belongs to: "dt", "iterations", "tolerance", "both"
  double dt = 1.0 / 60;     // [s] the engine is stepped by this; smaller ones are the engine's substeps
  int iterations = 0;       // 0: the engine has none, or its default
  double tolerance = 0;     // 0: the engine has none, or its default
  bool sleeping = false;    // sleeping or freezing as the engine has it by default
  int threads = 1;
  bool is_default = false;  // what a user gets who changes nothing
  bool quick = false;       // in chart-quick too
};

class Peer {
 public:
  virtual ~Peer() = default;
  virtual void Step(double dt) = 0;
  virtual State Read(int body) const = 0;      // bodies are numbered as in the plan
  virtual int Contacts() const { return -1; }  // points in the last step; -1: not told
};

struct Engine {
  std::string name, version, precision;
  std::vector<Setting> settings;
  std::unique_ptr<Peer> (*make)(const WorldPlan& plan, const Setting& setting);
};

// Defined once in each program, by the engine's file.
Engine TheEngine();

}  // namespace islet::peers
