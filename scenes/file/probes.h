// A table of what the probes of a scene file ask for: a row for each frame, comma-separated values.
//
//   in:  the world at the start and after each step      out: text, numbers that read back as the same bits
//   columns: frame, time, then for each body and quantity its x, y, z (rotation: w, x, y, z): `ball.velocity.x`. The force is the
//            mean over the step of all contacts on the body, W; 0 in frame 0
//   errors: std::invalid_argument that names the place in the file: where a column is asked for twice, and for more than kMostColumns
//   threads: one caller
#pragma once

#include <string>
#include <vector>

#include "scenes/file/scene_description.h"
#include "scenes/file/scene_maker.h"

namespace islet {

class Probes {
 public:
  static constexpr size_t kMostColumns = 10'000;

  Probes(const SceneDescription& description, const MadeScene& made);

  void Add(const World& world, int frame, double dt);  // dt: [s] of the last step
  const std::string& text() const { return text_; }

 private:
  struct Column {
    int body;
    ProbeWhat what;
  };

  std::vector<Column> columns_;
  bool with_forces_ = false;
  std::string text_;
};

}  // namespace islet
