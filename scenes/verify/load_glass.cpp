// T41: an hourglass on a scale. While the pieces fall less is on the scale, when they land more; the mean is their weight.
#include <algorithm>
#include <cmath>
#include <string>

#include "scenes/scene.h"
#include "scenes/verify/builders.h"
#include "scenes/verify/load_measures.h"

namespace islet::verify {
namespace {

// [N s] on all fixed bodies together in the last step.
Vector3 ImpulseOnContainer(const World& world) {
  Vector3 sum = Vector3::Zero();
  for (size_t c = 0; c < world.resolved_contacts().size(); ++c) {
    const Contact& contact = world.resolved_contacts()[c];
    if (world.body(contact.body_a).kind == BodyKind::kFixed) sum -= world.impulses()[c];
    if (world.body(contact.body_b).kind == BodyKind::kFixed) sum += world.impulses()[c];
  }
  return sum;
}

void WeighGlass(const CheckSettings& settings, const char* scene, int count, double seconds, Measurements* out) {
  BuiltScene built = BuildScene(*FindScene(scene), {.count = count}, settings.engine);
  World& world = built.world;
  const double weight = Weight(world);
  const Vector3 gravity_impulse(0, 0, -weight * settings.dt);
  Vector3 on_container = Vector3::Zero();
  double worst_step = 0;
  const int frames = Frames(seconds, settings.dt);
  for (int frame = 0; frame < frames; ++frame) {
    const Vector3 before = Momentum(world);
    world.Step(settings.dt);
    const Vector3 impulse = ImpulseOnContainer(world);
    const Vector3 unexplained = Momentum(world) - before - gravity_impulse + impulse;
    worst_step = std::max(worst_step, unexplained.norm() / gravity_impulse.norm());
    on_container += impulse;
  }
  const double time = frames * settings.dt;
  const std::string name = ", " + std::string(scene) + " with " + std::to_string(count);
  // The pieces started at rest; what momentum they have at the end the scale has not felt yet.
  const double mean = -on_container.z() / time;
  const double bound = 1e-6;
  out->Relative("mean force on the container" + name, "N", weight + Momentum(world).z() / time, mean, bound);
  out->AtMost("momentum that no impulse explains, worst step" + name, "weight x dt", worst_step, bound);
}

}  // namespace

void MeasureWeighedGlass(const CheckSettings& settings, Measurements* out) {
  WeighGlass(settings, "cubeglass7", settings.quick ? 81 : 243, settings.quick ? 4 : 6, out);
  WeighGlass(settings, "sphereglass", settings.quick ? 81 : 243, settings.quick ? 4 : 6, out);
}

}  // namespace islet::verify
