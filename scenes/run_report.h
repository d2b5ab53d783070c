// The story of one run in numbers: gathers every frame's StepReport and writes the JSON object of `--report` and the
// summary for people. All units SI unless a key says otherwise; certificates and maps are the worst over the run.
//
// Keys whose meaning is not in their name:
//   bodies                dynamic bodies; fixed_bodies: the others
//   stopped_by            frames, seconds, time limit, rest or interrupt
//   stage_seconds         wall time over the whole run
//   collision_qp, static_qp   seconds_mean and iterations_mean are per problem, seconds_per_frame per frame
//   ledger                what the bodies did that physics does not allow, worst of the run with frame and body; engine/ledger.h
//   failed_steps          steps whose ledger is not clean, or that were not stepped to their end
//   energy_gain_max       [J] most energy that a step's islands gained, potential energy and moving walls included
//   mechanical_energy_gain    [J] sum of all rises of kinetic + gravity potential energy from one frame to the next
//   momentum_drift        |p_end - p_start| over the sum of m |v| at the start; null if gravity or fixed bodies act
//   escaped               bodies outside the scene's bounds at the end; 0 in a scene without bounds
//   passed                bodies below the scene's mark (the orifice) at the end; null in a scene without one
//   state_hash            of all poses and velocities at the end, 16 hexadecimal digits
#pragma once

#include <array>
#include <string>
#include <vector>

#include "engine/step_report.h"
#include "engine/world.h"
#include "scenes/scene.h"

namespace islet {

std::string CountedBodies(int count);  // "1 body", "2 bodies"

class RunReport {
 public:
  // name and expected: as in ReadyScene.
  RunReport(std::string name, std::string expected, const SceneInfo& info, const World& world, double dt);

  void AddFrame(const StepReport& report, double step_seconds, const World& world);
  void Finish(const World& world, double wall_seconds, const char* stopped_by);

  std::string Json() const;     // indented, newline at the end
  std::string Summary() const;  // a few lines
  std::string Warning() const;  // how many steps failed, the first of them and why, in half a line; empty: none

  int failed_steps() const { return failed_steps_; }

 private:
  struct Series {  // of one number per frame
    double sum = 0, max = 0;
    void Add(double value);
  };

  std::string name_, expected_;
  SceneInfo info_;
  Settings settings_;
  double dt_;
  int fixed_bodies_ = 0;
  Vector3 momentum_start_ = Vector3::Zero();  // [N s]
  double momentum_scale_ = 0;                 // [N s]
  double kinetic_energy_before_ = 0;          // [J] at the last frame
  Vector3 mass_moment_ = Vector3::Zero();     // [kg m] there
  bool weightless_ = true;                    // gravity acted in no frame

  std::vector<double> step_seconds_;
  StageSeconds stages_;
  Series contacts_, active_contacts_, islands_, largest_island_, penetration_;
  QpSummary collision_qp_, static_qp_;
  Certificate certificate_;
  Ledger ledger_;
  std::array<int, 4> ledger_frames_{-1, -1, -1, -1};  // of its worst entries, in the order of the report
  int failed_steps_ = 0, first_failed_ = 0;           // [frames] first_failed_: from 1
  std::string why_failed_;                            // the first of them
  double energy_gain_max_ = 0;                        // [J]
  LadderReport ladder_, motion_ladder_;
  double mechanical_energy_gain_ = 0;
  double frozen_imbalance_ = 0;
  int gave_up_ = 0, gave_up_max_ = 0;  // frames, bodies
  int bounces_ = 0, woken_ = 0, woken_max_ = 0, motion_passes_max_ = 0, motion_failures_ = 0, restitution_lowered_ = 0;

  int frozen_ = 0, awake_ = 0;  // at the last frame
  double kinetic_energy_ = 0;   // [J] of it
  double sim_seconds_ = 0, wall_seconds_ = 0;
  double momentum_drift_ = 0;
  int escaped_ = 0, passed_ = 0;
  std::string state_hash_, stopped_by_;
};

}  // namespace islet
