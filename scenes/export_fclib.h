// Island problems of a run as FCLIB files, so that other solvers can be given the same problems.
//
//   fclib_global in compressed columns: M, H = J^T, f = M v0, w = drift - bounce, mu; our answer in /solution; info tells
//   scene, frame, stage and island. Names sort by frame, round, island, stage:
//     DIR/frame_000012_round_0_island_00003_static.hdf5
//
// Not in the format: the other models' laws (the answer may be one of theirs, the description says which), and the checks on
// frozen bodies, which are not problems of the frame.
//   errors: std::invalid_argument for a folder that cannot be written, before the run; std::runtime_error for a write that fails
#pragma once

#include <set>
#include <string>
#include <vector>

#include "engine/problem_record.h"
#include "scenes/fclib_file.h"

namespace islet {

struct FclibExample {
  FclibProblem problem;
  FclibSolution solution;
};
FclibExample ToFclib(const qp::Problem& problem, const qp::Solution& solution);

class FclibExport {
 public:
  // frames: counted from 1; empty for all. label: goes into every description.
  FclibExport(std::string folder, std::vector<int> frames, std::string label);

  // Leaves no trace: a missing folder is made and removed.
  static void CheckFolder(const std::string& option, const std::string& folder);

  bool Wants(int frame) const;
  void Write(int frame, const ProblemRecord& record);
  int files() const { return static_cast<int>(names_.size()); }
  std::string Told() const;  // a line: how many were written, and what was there before

 private:
  std::string folder_;
  std::vector<int> frames_;
  std::string label_;
  std::set<std::string> names_;  // of the files so far
};

}  // namespace islet
