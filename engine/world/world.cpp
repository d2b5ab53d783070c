#include "engine/world.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <utility>

#include "engine/body_definition.h"
#include "engine/response/suite_frame.h"
#include "engine/state_hash.h"
#include "engine/world/world_impl.h"

namespace islet {

struct WorldSnapshot::Data {
  WorldState world;
  Vector3 gravity;
};

[[noreturn]] static void RefuseMaterial(const Contact& c, const std::string& field, double value) {
  throw std::invalid_argument("contact of bodies " + std::to_string(c.body_a) + " and " + std::to_string(c.body_b) +
                              ": " + field + " = " + std::to_string(value));
}

World::Impl::Impl(const Settings& s, parallel::WorkerPool* p)
    : settings(s),
      own_pool(p ? nullptr : std::make_unique<parallel::WorkerPool>(s.threads)),
      pool(p ? p : own_pool.get()),
      detector(pool, s.ladder.Has(qp::Rung::kKeptPairs)),
      group_motion(s, pool),
      crowd_motion(s, pool),
      mix([this](Contact* c, const Body& a, const Body& b) {
        c->friction = MixFriction(a.friction, b.friction);
        c->restitution = MixRestitution(a.restitution, b.restitution);
        if (!material) return;
        const Material m = material(*c, a, b);
        c->friction = m.friction;
        c->restitution = m.restitution;
        if (!(m.friction >= 0 && std::isfinite(m.friction))) RefuseMaterial(*c, "friction", m.friction);
        if (!(m.restitution >= 0 && m.restitution <= 1)) RefuseMaterial(*c, "restitution", m.restitution);
      }),
      ledger(pool) {}

World::World(const Settings& settings) : World(settings, nullptr) {}
World::World(const Settings& settings, parallel::WorkerPool* pool) {
  settings.Validate();
  impl_ = std::make_unique<Impl>(settings, pool);
}
World::~World() = default;
World::World(World&&) noexcept = default;
World& World::operator=(World&&) noexcept = default;

Body& World::Impl::At(int number) {
  if (number < 0 || number >= static_cast<int>(bodies.size()) || bodies[number].removed)
    throw std::invalid_argument("no body has number " + std::to_string(number));
  return bodies[number];
}

int World::Add(const BodyDefinition& definition) {
  Impl& w = *impl_;
  const int number = static_cast<int>(w.bodies.size());
  w.bodies.push_back(MakeBody(definition, "body " + std::to_string(number)));
  w.shapes.push_back(definition.shape);
  w.Changed();
  return number;
}

void World::Remove(int body) {
  impl_->At(body).removed = true;
  impl_->bodies[body].frozen = false;
  SetTwist({}, &impl_->bodies[body]);
  impl_->Changed();
}

void World::Teleport(int body, const Vector3& position_W, const Quaternion& rotation_WB) {
  const std::string name = "body " + std::to_string(body);
  Body& b = impl_->At(body);
  RequireFinite(name, "position", position_W);
  RequireUnit(name, rotation_WB);
  b.position_W = position_W;
  b.rotation_WB = rotation_WB.normalized();
  b.frozen = false;
  impl_->Changed();
}

void World::SetVelocity(int body, const Vector3& linear_W, const Vector3& angular_W) {
  const std::string name = "body " + std::to_string(body);
  Body& b = impl_->At(body);
  RequireFinite(name, "linear velocity", linear_W);
  RequireFinite(name, "angular velocity", angular_W);
  if (b.kind == BodyKind::kFixed) Reject(name, "velocity", "of a fixed body must be zero; make it kinematic");
  SetTwist({linear_W, angular_W}, &b);
  b.frozen = false;
  impl_->Changed();
}

void World::SetForce(int body, const Vector3& force_W, const Vector3& torque_W) {
  const std::string name = "body " + std::to_string(body);
  Body& b = impl_->At(body);
  RequireFinite(name, "force", force_W);
  RequireFinite(name, "torque", torque_W);
  if (b.force_W == force_W && b.torque_W == torque_W) return;
  b.force_W = force_W;
  b.torque_W = torque_W;
  impl_->rest.reset();
  impl_->groups.Disturb();
}

void World::SetGravity(const Vector3& gravity_W) {
  if (!gravity_W.allFinite()) throw std::invalid_argument("gravity is not finite");
  impl_->settings.gravity = gravity_W;
  impl_->crowd_motion.SetGravity(gravity_W);
  impl_->group_motion.SetGravity(gravity_W);
  impl_->rest.reset();
  impl_->groups.Disturb();
}

void World::SetProblemObserver(ProblemObserver observer) {
  impl_->observer = std::move(observer);
  impl_->rest.reset();
}
void World::SetMaterialCallback(MaterialCallback callback) {
  impl_->material = std::move(callback);
  std::fill(impl_->groups.mark.begin(), impl_->groups.mark.end(), motion::GroupMemory::kAwake);
  impl_->Changed();
}

void World::CheckInitialOverlap() {
  Impl& w = *impl_;
  if (w.stale) w.CheckTouching();
  for (const Contact& c : w.near_contacts) {
    const double allowed = w.settings.touch_gap * std::min(w.shapes[c.body_a].size(), w.shapes[c.body_b].size());
    if (std::max(c.body_a, c.body_b) < static_cast<int>(w.checked_bodies) || -c.gap <= allowed) continue;
    throw std::invalid_argument("bodies " + std::to_string(c.body_a) + " and " + std::to_string(c.body_b) +
                                " overlap by " + std::to_string(-c.gap) + " m at the start");
  }
  w.checked_bodies = w.bodies.size();
}

void World::Impl::Changed() {
  stale = true;
  rest.reset();
  groups.Disturb();
}

WorldSnapshot World::Save() const {
  return WorldSnapshot(
      std::make_shared<const WorldSnapshot::Data>(WorldSnapshot::Data{*impl_, impl_->settings.gravity}));
}

void World::Restore(const WorldSnapshot& snapshot) {
  SetGravity(snapshot.data_->gravity);  // first: it disturbs what rests, and what is restored was not
  static_cast<WorldState&>(*impl_) = snapshot.data_->world;
  impl_->rest.reset();
}

std::span<const Body> World::bodies() const { return impl_->bodies; }
const Body& World::body(int number) const { return impl_->bodies.at(number); }
const Shape& World::shape(int number) const { return impl_->shapes.at(number); }
std::span<const Contact> World::contacts() const { return impl_->touching; }
std::span<const Contact> World::resolved_contacts() const { return impl_->resolved; }
std::span<const Vector3> World::impulses() const { return impl_->impulses; }
const Settings& World::settings() const { return impl_->settings; }
double World::time() const { return impl_->time; }
std::uint64_t World::StateHash() const { return HashBodies(impl_->bodies); }

}  // namespace islet
