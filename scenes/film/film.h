// What a run showed: its bodies once, then a frame for each step. Recordings keep it, pages and pictures draw it, the live server sends it.
// Nothing that the program runs removes a body. One that World::Remove took out stands in later frames where it was last.
//
//   frames: W world, B body    units: SI, numbers that are only looked at in single precision
//   threads: pure functions of a world that is in no step
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "engine/step_report.h"
#include "engine/world.h"

namespace islet {

struct FilmBody {
  int shape = 0;  // in FilmHead::shapes
  BodyKind kind = BodyKind::kDynamic;
  double mass = 0;  // [kg] of a dynamic one
};

struct FilmHead {
  std::string scene;                   // its name, or the path of its file
  std::string title, about;            // of the scene, for people; either may be empty
  std::string command;                 // that makes the same run again: `islet run ...`
  std::vector<std::string> arguments;  // of that command, behind `run`; empty: of a run that no command makes
  std::string scene_text;              // of the scene's file; empty: the program knows the scene
  std::string version;                 // of the program
  double dt = 1.0 / 30;                // [s]
  double tolerance = 1e-6;             // that was aimed at
  Vector3 gravity_W = {0, 0, -9.81};
  std::optional<Region> bounds;  // [m] of what is to be seen, if the scene tells
  std::vector<Shape> shapes;     // each once
  std::vector<FilmBody> bodies;
};

struct FilmContact {
  int body_a = 0, body_b = 0;
  std::array<float, 3> point_W{}, normal_W{};  // [m], unit, out of a
  std::array<float, 3> impulse_W{};            // [N s] on b
};

struct FilmNumbers {
  int contacts = 0, islands = 0, awake = 0, frozen = 0;
  double step_seconds = 0;  // [s] wall
  StageSeconds stages;      // [s] wall
  double kinetic = 0;       // [J]
  double potential = 0;     // [J] in the field of gravity, against the start
  double coulomb_map = 0;   // [m/s] worst contact, exact Coulomb friction
  double penetration = 0;   // [m]
  double energy_created = 0, momentum_unexplained = 0, angular_momentum_unexplained = 0;  // of the ledger
  int sides_changed = 0, overlapping = 0, missed = 0;
  int unsolved =
      0;  // problems without an answer, QpSummary::failed; -1: not told, of a recording that is older than this number
  bool failed = false;  // StepReport::Failed()
};

struct FilmFrame {
  int number = 0;                           // 0: before the first step
  double time = 0;                          // [s]
  std::vector<std::array<float, 7>> poses;  // per body: position [m], rotation x y z w
  std::vector<std::uint8_t> frozen;         // per body
  std::vector<int> island;                  // per body: the smallest body of its island; -1: of none
  std::vector<float> accuracy;              // per body: natural map of its island over v_ref; 0 of those of none
  std::vector<FilmContact> contacts;        // those at which impulses acted
  FilmNumbers numbers;
  std::uint64_t state_hash = 0;
};

// Of a scene as it is built.
FilmHead HeadOf(const World& world, double dt, std::string scene, std::string command, std::optional<Region> bounds);

// The world as its last step, which had this report, left it. start: [J] potential energy of frame 0. Frame 0 has an empty report;
// what is awake and its kinetic energy are told nevertheless.
FilmFrame FrameOf(const World& world, const StepReport& report, int number, double step_seconds, double start);

const char* NameOf(ShapeKind kind);  // "half-space" and the like, for people and pages

double PotentialEnergy(const World& world);  // [J] of dynamic bodies in the field of gravity

}  // namespace islet
