#include "scenes/ready_scene.h"

#include <fmt/format.h>

#include <memory>
#include <stdexcept>
#include <utility>

#include "scenes/file/drives.h"
#include "scenes/file/scene_maker.h"
#include "scenes/file/scene_reader.h"
#include "scenes/output_file.h"

namespace islet {
namespace {

constexpr double kUsualStep = 1.0 / 30;  // [s]

template <typename T>
void RefuseParameter(const char* field, const std::optional<T>& value) {
  if (value) throw std::invalid_argument(fmt::format("{}: a scene file says that itself; got {}", field, *value));
}

void RefuseOutputTo(const RunOptions& options, const std::string& input, const char* what) {
  for (const auto& [option, file] : Outputs(options))
    if (SameOutput(file, input))
      throw std::invalid_argument(fmt::format("{}: an output goes to {}: {}", option, what, file));
}

ReadyScene FromFile(const RunOptions& options) {
  RefuseOutputTo(options, options.scene, "the scene file itself");
  const SceneParameters& p = options.parameters;
  RefuseParameter("count", p.count);
  RefuseParameter("friction", p.friction);
  RefuseParameter("restitution", p.restitution);
  RefuseParameter("drop", p.drop);
  RefuseParameter("angle", p.angle);
  RefuseParameter("incoming", p.incoming);
  std::string text = options.scene_text ? *options.scene_text : ReadSceneText(options.scene);
  const auto description =
      std::make_shared<const SceneDescription>(ReadScene(std::make_shared<const Document>(options.scene, text)));
  for (const std::string& mesh : description->meshes) RefuseOutputTo(options, mesh, "a mesh of the scene");
  const double dt = options.dt.value_or(description->dt);
  MadeScene made =
      MakeScene(*description, MakeSettings(options, description->settings), p.seed.value_or(description->seed));
  const auto drives = std::make_shared<const Drives>(*description, made);
  Probes probes(*description, made);
  if (!options.probes.empty() && description->probes.empty())
    throw std::invalid_argument(fmt::format("--probes {}: {} has no \"probes\"", options.probes, options.scene));
  return {.name = options.scene,
          .title = description->title,
          .about = description->about,
          .text = std::move(text),
          .expected = description->expected.empty() ? "the file does not say" : description->expected,
          .dt = dt,
          .time_limit = description->end,
          .stop_at_rest = description->stop_at_rest,
          .world = std::move(made.world),
          .info = made.info,
          .drive = [description, drives, dt](double time, World* world) { drives->Apply(time, dt, world); },
          .probes = options.probes.empty() ? std::nullopt : std::optional<Probes>(std::move(probes))};
}

}  // namespace

bool IsSceneFile(const std::string& name) { return name.ends_with(".json") || name.find('/') != std::string::npos; }

ReadyScene MakeReady(const RunOptions& options) {
  if (IsSceneFile(options.scene)) return FromFile(options);
  const Scene& scene = RequireScene(options.scene);
  if (!options.probes.empty())
    throw std::invalid_argument(
        fmt::format("--probes {}: the scene {} has none; those of files can have some", options.probes, options.scene));
  BuiltScene built = BuildScene(scene, options.parameters, MakeSettings(options));
  return {.name = std::string(scene.name),
          .title = {},
          .about = std::string(scene.summary),
          .text = {},
          .expected = std::string(scene.expected),
          .dt = options.dt.value_or(kUsualStep),
          .time_limit = scene.time_limit,
          .stop_at_rest = true,
          .world = std::move(built.world),
          .info = built.info,
          .drive = {},
          .probes = std::nullopt};
}

}  // namespace islet
