// Error against the time step, in scenes whose course is not chaotic.
//
//   study_step --out step.csv [--scene csstack ...] [--finest 128]
//
// Every scene runs at 1/30 s divided by 1, 2, 4, 8 and 16, one thread, and once by `finest`.
//   error  [m] farthest that a body's centre ever is from where the finest run has it, looked at thirty times a second
//   order  by what power of the step the error fell since the row before
//   wall   [s] stepping, the least of five runs
// A commit before this file was: copy it there, and add `step` to the studies of CMakeLists.txt.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <stdexcept>
#include <string>
#include <vector>

#include "bench/studies/study_csv.h"
#include "scenes/scene.h"

namespace islet::studies {
namespace {

constexpr int kRate = 30;  // [1/s] frames
constexpr int kRepeats = 5;
constexpr int kDivisions[] = {1, 2, 4, 8, 16};

struct StudyScene {
  const char* name;
  const char* scene;
  SceneParameters parameters;
  double seconds;  // before it is chaotic
};
const StudyScene kScenes[] = {
    {"csstack", "csstack", {}, 1.2},
    {"balance", "balance", {}, 2},
    {"revival", "revival", {}, 1.5},
    {"officetoy", "officetoy", {}, 1},
    {"stack", "stack", {.drop = 0.1}, 1},
    {"stack of 20", "stack", {.count = 20, .drop = 0.2}, 1.2},
    {"manystacks", "manystacks", {.drop = 0.1}, 0.7},
};

struct Course {
  std::vector<Vector3> centres_W;  // [m] of all bodies, frame by frame
  double wall = std::numeric_limits<double>::infinity();
};

Course Run(const StudyScene& study, int division, int repeats) {
  const Scene* const scene = FindScene(study.scene);
  if (!scene) throw std::runtime_error(std::string("there is no scene ") + study.scene);
  Course course;
  for (int repeat = 0; repeat < repeats; ++repeat) {
    Settings settings;
    settings.threads = 1;
    BuiltScene built = scene->build(*scene, study.parameters, settings);
    course.centres_W.clear();
    double wall = 0;
    for (int frame = 0; frame < std::lround(study.seconds * kRate); ++frame) {
      const StudyClock clock;
      for (int k = 0; k < division; ++k) built.world.Step(1.0 / kRate / division);
      wall += clock.Wall();
      for (const Body& body : built.world.bodies()) course.centres_W.push_back(body.position_W);
    }
    course.wall = std::min(course.wall, wall);
  }
  return course;
}

double Farthest(const Course& x, const Course& y) {
  double farthest = 0;
  for (size_t i = 0; i < x.centres_W.size(); ++i)
    farthest = std::max(farthest, (x.centres_W[i] - y.centres_W[i]).norm());
  return farthest;
}

void Measure(const StudyScene& study, int finest, StudyCsv* csv) {
  const Course reference = Run(study, finest, 1);
  double before = 0;
  for (const int division : kDivisions) {
    const Course course = Run(study, division, kRepeats);
    const double error = Farthest(course, reference), order = before > 0 ? std::log2(before / error) : 0;
    csv->Row(study.name, 1.0 / (kRate * division), course.wall, error, order);
    char line[120];
    std::snprintf(line, sizeof line, "%-12s 1/%-4d %8.2f ms %10.1e m %6.1f", study.name, kRate * division,
                  1e3 * course.wall, error, order);
    Say(line);
    before = error;
  }
}

}  // namespace
}  // namespace islet::studies

int main(int argc, char** argv) {
  using namespace islet::studies;
  CLI::App app("Error against the time step");
  std::string out;
  std::vector<std::string> scenes;
  int finest = 128;
  app.add_option("--out", out, "CSV file")->required();
  app.add_option("--scene", scenes, "of these alone");
  app.add_option("--finest", finest, "division of 1/30 s that counts as exact")->check(CLI::Range(32, 4096));
  return RunStudy(&app, argc, argv, [&] {
    StudyCsv csv(out, {}, "scene,step,wall,error,order");
    for (const std::string& name : scenes)
      if (std::none_of(std::begin(kScenes), std::end(kScenes), [&](const StudyScene& s) { return name == s.name; }))
        throw std::runtime_error("--scene " + name + " is not one of this study's");
    for (const StudyScene& study : kScenes)
      if (scenes.empty() || std::find(scenes.begin(), scenes.end(), study.name) != scenes.end())
        Measure(study, finest, &csv);
  });
}
