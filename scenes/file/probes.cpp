#include "scenes/file/probes.h"

#include <set>
#include <utility>

#include "scenes/file/number_format.h"

namespace islet {
namespace {

std::string NameOf(const BodyChoice& choice, size_t which, size_t of) {
  if (choice.name.empty()) return "body[" + std::to_string(choice.number) + "]";
  if (choice.number >= 0) return choice.name + "[" + std::to_string(choice.number) + "]";
  return of == 1 ? choice.name : choice.name + "[" + std::to_string(which) + "]";
}

// [N s] per body, of all contacts in the last step.
std::vector<Vector3> ImpulsesOf(const World& world) {
  std::vector<Vector3> sums(world.bodies().size(), Vector3::Zero());
  const std::span<const Contact> contacts = world.resolved_contacts();
  for (size_t c = 0; c < contacts.size(); ++c) {
    sums[contacts[c].body_b] += world.impulses()[c];
    sums[contacts[c].body_a] -= world.impulses()[c];
  }
  return sums;
}

}  // namespace

Probes::Probes(const SceneDescription& description, const MadeScene& made) {
  text_ = "frame,time";
  std::set<std::pair<int, ProbeWhat>> known;
  std::set<std::string> names;
  size_t numbers = 0;
  for (const ProbeEntry& probe : description.probes) {
    const std::vector<int> bodies = ChosenBodies(made, probe.bodies);
    for (size_t i = 0; i < bodies.size(); ++i) {
      for (const ProbeWhat what : probe.write) {
        const std::string name = NameOf(probe.bodies, i, bodies.size()) + "." + kProbeNames[static_cast<int>(what)];
        if (!known.emplace(bodies[i], what).second)
          probe.bodies.place.Refuse("its probes write " + name + " twice: one column has been asked for already");
        if (!names.insert(name).second)
          probe.bodies.place.Refuse("its probes write " + name + " of two bodies: choose one of them by another name");
        columns_.push_back({bodies[i], what});
        with_forces_ = with_forces_ || what == ProbeWhat::kForce;
        numbers += what == ProbeWhat::kRotation ? 4 : 3;
        if (numbers > kMostColumns)
          probe.bodies.place.Refuse("too many columns: all probes together have at most " +
                                    std::to_string(kMostColumns));
        for (const char* axis : {".w", ".x", ".y", ".z"})
          if (axis[1] != 'w' || what == ProbeWhat::kRotation) text_ += "," + name + axis;
      }
    }
  }
  text_ += "\n";
}

void Probes::Add(const World& world, int frame, double dt) {
  const auto add = [this](double value) { text_.append(1, ',').append(ExactNumber(value)); };
  const std::vector<Vector3> impulses = with_forces_ ? ImpulsesOf(world) : std::vector<Vector3>();
  text_ += std::to_string(frame);
  add(world.time());
  for (const auto& [number, what] : columns_) {
    const Body& body = world.body(number);
    Vector3 value = Vector3::Zero();
    switch (what) {
      case ProbeWhat::kPosition:
        value = body.position_W;
        break;
      case ProbeWhat::kRotation:
        add(body.rotation_WB.w());
        value = body.rotation_WB.vec();
        break;
      case ProbeWhat::kVelocity:
        value = body.linear_velocity_W;
        break;
      case ProbeWhat::kAngularVelocity:
        value = body.angular_velocity_W;
        break;
      case ProbeWhat::kForce:
        if (frame > 0) value = impulses[number] / dt;
        break;
    }
    for (int k = 0; k < 3; ++k) add(value[k]);
  }
  text_ += "\n";
}

}  // namespace islet
