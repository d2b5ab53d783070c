#include "engine/world.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstring>
#include <stdexcept>
#include <string>
#include <utility>

#include "engine/body_definition.h"
#include "engine/number_text.h"
#include "engine/response/suite_frame.h"
#include "engine/rotation.h"
#include "engine/state_hash.h"
#include "engine/world/world_impl.h"

namespace islet {

[[noreturn]] static void RefuseMaterial(const Contact& c, const std::string& field, double value) {
  throw std::invalid_argument("contact of bodies " + std::to_string(c.body_a) + " and " + std::to_string(c.body_b) +
                              ": " + field + " = " + Text(value));
}

// As what moves sees them: without a memory nobody knows who stands still.
static Settings OfMotion(Settings settings) {
  if (settings.stateless) settings.freezing = Freezing::kOff;
  return settings;
}

World::Impl::Impl(const Settings& s, parallel::WorkerPool* p)
    : settings(s),
      own_pool(p ? nullptr : std::make_unique<parallel::WorkerPool>(s.threads)),
      pool(p ? p : own_pool.get()),
      detector(pool, s.ladder.Has(qp::Rung::kKeptPairs)),
      group_motion(OfMotion(s), pool),
      crowd_motion(OfMotion(s), pool),
      mix([this](Contact* c, const Body& a, const Body& b) { Mix(c, a, b); }),
      ledger(pool) {}

// What the materials of two bodies make of their contact, in crowds and in small groups alike.
void World::Impl::Mix(Contact* c, const Body& a, const Body& b) const {
  c->friction = MixFriction(a.friction, b.friction);
  c->restitution = MixRestitution(a.restitution, b.restitution);
  c->surface_W = MixSurfaces(a, b);
  if (!material) return;
  const Material m = material(*c, a, b);
  if (!(m.friction >= 0 && m.friction <= kMostFriction)) RefuseMaterial(*c, "friction", m.friction);
  if (!(m.restitution >= 0 && m.restitution <= 1)) RefuseMaterial(*c, "restitution", m.restitution);
  c->friction = m.friction;
  c->restitution = m.restitution;
}

World::World(const Settings& settings) : World(settings, nullptr) {}
World::World(const Settings& settings, parallel::WorkerPool* pool) {
  settings.Validate();
  impl_ = std::make_unique<Impl>(settings, pool);
}
World::~World() = default;
World::World(World&&) noexcept = default;
World& World::operator=(World&&) noexcept = default;

// Who calls a world in its step, from a callback or another thread, would see it half done.
World::Impl::Busy::Busy(Impl* w, const char* call) : world(w) {
  if (world->stepping.exchange(true)) throw std::logic_error(std::string(call) + ": the world is in a step");
}
void World::Impl::Idle(const char* call) const {
  if (stepping) throw std::logic_error(std::string(call) + ": the world is in a step");
}

const Body& World::Impl::At(int number) const {
  if (number < 0 || number >= static_cast<int>(bodies.size()) || bodies[number].removed)
    throw std::invalid_argument("no body has number " + std::to_string(number));
  return bodies[number];
}
Body& World::Impl::At(int number) { return const_cast<Body&>(std::as_const(*this).At(number)); }

static std::string NameOf(int body) { return "body " + std::to_string(body); }

int World::Add(const BodyDefinition& definition) {
  Impl& w = *impl_;
  w.Idle("Add");
  const bool again = !w.vacant.empty();
  const int number = again ? w.vacant.back() : static_cast<int>(w.bodies.size());
  const MassProperties mass = MassOf(definition, NameOf(number));
  const Body body = MakeBody(definition, mass, NameOf(number));
  if (again) {
    w.vacant.pop_back();
    w.Forget(number);
    w.bodies[number] = body;
    w.shapes[number] = definition.shape;
    w.masses[number] = mass;
    w.user_data[number] = definition.user_data;
    w.unchecked[number] = 1;
  } else {
    w.bodies.push_back(body);
    w.shapes.push_back(definition.shape);
    w.masses.push_back(mass);
    w.user_data.push_back(definition.user_data);
    w.unchecked.push_back(1);
    w.generations.push_back(0);
  }
  w.Changed();
  return number;
}

// What a body of this number left behind. Contacts of the steps without it have gone already, but for those of a crowd that did not step.
void World::Impl::Forget(int number) {
  if (static_cast<size_t>(number) < groups.mark.size()) {
    groups.still[number] = 0;
    groups.load[number] = 0;
    groups.mark[number] = motion::GroupMemory::kAwake;
    groups.crowded[number] = 0;
  }
  if (static_cast<size_t>(number) < crowd_memory.lost.size()) crowd_memory.lost[number] = INFINITY;
  if (static_cast<size_t>(number) < crowd_memory.still.size()) crowd_memory.still[number] = {};
  if (static_cast<size_t>(number) < crowd_memory.freeze_counters.size()) crowd_memory.freeze_counters[number] = 0;
  if (static_cast<size_t>(number) < crowd.size()) crowd[number] = 0;
  size_t kept = 0;
  for (size_t c = 0; c < crowd_memory.contacts.size(); ++c) {
    const Contact contact = crowd_memory.contacts[c];
    if (contact.body_a == number || contact.body_b == number) continue;
    crowd_memory.forces_W[kept] = crowd_memory.forces_W[c];
    crowd_memory.contacts[kept++] = contact;
  }
  crowd_memory.contacts.resize(kept);
  crowd_memory.forces_W.resize(kept);
}

void World::Remove(int body) {
  impl_->Idle("Remove");
  Body& b = impl_->At(body);
  b.removed = true;
  b.frozen = false;
  SetTwist({}, &b);
  ++impl_->generations[body];
  impl_->pairs_apart.Forget(body);
  impl_->leaving.push_back(body);
  impl_->Changed();
}

BodyId World::id(int body) const {
  impl_->Idle("id");
  impl_->At(body);
  return {body, impl_->generations[body]};
}

bool World::Lives(BodyId id) const {
  impl_->Idle("Lives");
  return id.number >= 0 && id.number < static_cast<int>(impl_->bodies.size()) && !impl_->bodies[id.number].removed &&
         impl_->generations[id.number] == id.generation;
}

void World::Teleport(int body, const Vector3& position_W, const Quaternion& rotation_WB) {
  impl_->Idle("Teleport");
  Body& b = impl_->At(body);
  RequireFinite(NameOf(body), "position", position_W);
  RequireUnit(NameOf(body), rotation_WB);
  b.position_W = position_W;
  b.rotation_WB = rotation_WB.normalized();
  b.frozen = false;
  impl_->Changed();
}

void World::SetVelocity(int body, const Vector3& linear_W, const Vector3& angular_W) {
  impl_->Idle("SetVelocity");
  Body& b = impl_->At(body);
  RequireFinite(NameOf(body), "linear velocity", linear_W);
  RequireFinite(NameOf(body), "angular velocity", angular_W);
  if (b.kind == BodyKind::kFixed) {
    if (linear_W.isZero(0) && angular_W.isZero(0)) return;
    Reject(NameOf(body), "velocity", "of a fixed body must be zero; make it kinematic");
  }
  SetTwist({linear_W, angular_W}, &b);
  b.frozen = false;
  impl_->Changed();
}

void World::MoveTo(int body, const Vector3& position_W, const Quaternion& rotation_WB, double dt) {
  impl_->Idle("MoveTo");
  const Body& b = impl_->At(body);
  RequireFinite(NameOf(body), "position", position_W);
  RequireUnit(NameOf(body), rotation_WB);
  RequireStep(dt);
  if (b.kind != BodyKind::kKinematic) Reject(NameOf(body), "kind", "must be kinematic to be moved to a pose");
  SetVelocity(body, 1 / dt * (position_W - b.position_W),
              1 / dt * Log(rotation_WB.normalized() * b.rotation_WB.conjugate()));
}

void World::SetForce(int body, const Vector3& force_W, const Vector3& torque_W) {
  impl_->Idle("SetForce");
  Body& b = impl_->At(body);
  RequireFinite(NameOf(body), "force", force_W);
  RequireFinite(NameOf(body), "torque", torque_W);
  if (b.force_W == force_W && b.torque_W == torque_W) return;
  b.force_W = force_W;
  b.torque_W = torque_W;
  impl_->rest.reset();
}

void World::SetKind(int body, BodyKind kind) {
  impl_->Idle("SetKind");
  RequireKind(NameOf(body), kind);
  Body& b = impl_->At(body);
  if (kind == b.kind) return;
  if (kind == BodyKind::kDynamic) {
    if (impl_->shapes[body].kind() == ShapeKind::kHalfSpace)
      Reject(NameOf(body), "kind", "= dynamic: a half-space has no mass");
    RequirePositive(NameOf(body), "mass", impl_->masses[body].mass);
    RequireInertia(NameOf(body), impl_->masses[body].inertia_B);
    b.mass = impl_->masses[body].mass;
    b.inertia_B = impl_->masses[body].inertia_B;
    if (b.linear_velocity_W == b.linear_before_W) b.linear_velocity_W += b.beyond_before_W;  // along the arc's end
  }
  if (kind == BodyKind::kFixed) SetTwist({}, &b);
  b.kind = kind;
  b.frozen = false;
  impl_->WakeAll();
}

void World::SetMass(int body, double mass) {
  RequirePositive(NameOf(body), "mass", mass);
  impl_->At(body);
  const MassProperties& now = impl_->masses[body];
  SetMass(body, mass, mass / now.mass * now.inertia_B);
}

void World::SetMass(int body, double mass, const Matrix3& inertia_B) {
  impl_->Idle("SetMass");
  Body& b = impl_->At(body);
  if (impl_->shapes[body].kind() == ShapeKind::kHalfSpace) Reject(NameOf(body), "mass", "of a half-space is infinite");
  RequirePositive(NameOf(body), "mass", mass);
  RequireInertia(NameOf(body), inertia_B);
  impl_->masses[body] = {mass, inertia_B};
  if (b.kind != BodyKind::kDynamic) return;
  b.mass = mass;
  b.inertia_B = inertia_B;
  b.frozen = false;
  impl_->Changed();
}

void World::SetMaterial(int body, double friction, double restitution) {
  impl_->Idle("SetMaterial");
  Body& b = impl_->At(body);
  RequireMaterial(NameOf(body), friction, restitution);
  b.friction = friction;
  b.restitution = restitution;
  b.frozen = false;
  for (const auto* near : {&impl_->near_contacts, &impl_->groups.contacts, &impl_->crowd_memory.contacts})
    for (const Contact& c : *near)
      if (c.body_a == body || c.body_b == body) impl_->bodies[c.body_a].frozen = impl_->bodies[c.body_b].frozen = false;
  impl_->Changed();
}

void World::SetSurfaceVelocity(int body, const Vector3& velocity_B) {
  impl_->Idle("SetSurfaceVelocity");
  Body& b = impl_->At(body);
  RequireFinite(NameOf(body), "surface velocity", velocity_B);
  b.surface_velocity_B = velocity_B;
  impl_->WakeAll();
}

void World::SetLayers(int body, std::uint32_t layers, std::uint32_t collides_with) {
  impl_->Idle("SetLayers");
  Body& b = impl_->At(body);
  b.layers = layers;
  b.collides_with = collides_with;
  impl_->WakeAll();
}

void World::SetCollision(int body, int other, bool collide) {
  impl_->Idle("SetCollision");
  impl_->At(body);
  impl_->At(other);
  if (body == other) Reject(NameOf(body), "collision", "with itself");
  impl_->pairs_apart.Set(body, other, !collide);
  impl_->WakeAll();
}

void World::SetUserData(int body, std::uint64_t data) {
  impl_->Idle("SetUserData");
  impl_->At(body);
  impl_->user_data[body] = data;
}

void World::SetGravity(const Vector3& gravity_W) {
  impl_->Idle("SetGravity");
  RequireFinite("world", "gravity", gravity_W);
  impl_->settings.gravity = gravity_W;
  impl_->crowd_motion.SetGravity(gravity_W);
  impl_->group_motion.SetGravity(gravity_W);
  impl_->rest.reset();
}

void World::SetProblemObserver(ProblemObserver observer) {
  impl_->Idle("SetProblemObserver");
  impl_->observer = std::move(observer);
  impl_->rest.reset();
}

// Only whether two are equal decides anything.
static std::uint64_t NextCallbacks() {
  static std::atomic<std::uint64_t> last = 0;
  return ++last;
}

void World::SetMaterialCallback(MaterialCallback callback) {
  impl_->Idle("SetMaterialCallback");
  impl_->material = std::move(callback);
  impl_->callbacks = NextCallbacks();
  std::fill(impl_->groups.mark.begin(), impl_->groups.mark.end(), motion::GroupMemory::kAwake);
  impl_->Changed();
}

void World::SetCollisionCallback(CollisionCallback callback) {
  impl_->Idle("SetCollisionCallback");
  impl_->filter.SetCallback(std::move(callback));
  impl_->callbacks = NextCallbacks();
  impl_->WakeAll();
}

// Who touches whom has changed: what held may be gone, and nothing else would tell.
void World::Impl::WakeAll() {
  for (Body& body : bodies) body.frozen = false;
  std::fill(groups.mark.begin(), groups.mark.end(), motion::GroupMemory::kAwake);
  Changed();
}

void World::CheckInitialOverlap() {
  const Impl::Busy busy(impl_.get(), "CheckInitialOverlap");
  impl_->CheckNewcomers();
}

void World::Impl::RefuseOverlaps() const {
  for (const Contact& c : near_contacts) {
    const double allowed = 10 * settings.touch_gap * std::min(shapes[c.body_a].size(), shapes[c.body_b].size());
    if ((!unchecked[c.body_a] && !unchecked[c.body_b]) || -c.gap <= allowed) continue;
    throw std::invalid_argument("bodies " + std::to_string(c.body_a) + " and " + std::to_string(c.body_b) +
                                " overlap by " + Text(-c.gap) + " m at the start");
  }
}

bool World::Impl::AnyNewcomers() const {
  return std::any_of(unchecked.begin(), unchecked.end(), [](std::uint8_t is) { return is != 0; });
}

void World::Impl::CheckNewcomers() {
  if (!AnyNewcomers()) return;
  filter.SetFound({});
  if (stale) CheckTouching(bodies);
  RefuseOverlaps();
  std::fill(unchecked.begin(), unchecked.end(), 0);
  stale = stale || MovesGroups();  // a crowd looks without the others
}

void World::Impl::Changed() {
  stale = true;
  rest.reset();
}

WorldSnapshot World::Save() const {
  impl_->Idle("Save");
  return WorldSnapshot(std::make_shared<const WorldSnapshot::Data>(
      WorldSnapshot::Data{*impl_, impl_->settings.gravity, impl_->callbacks}));
}

void World::Restore(const WorldSnapshot& snapshot) {
  impl_->Idle("Restore");
  SetGravity(snapshot.data_->gravity);
  static_cast<WorldState&>(*impl_) = snapshot.data_->world;
  impl_->lost = false;
  impl_->rest.reset();
  const auto is_frozen = [](const Body& body) { return body.frozen; };
  const bool others = snapshot.data_->callbacks.value_or(impl_->callbacks) != impl_->callbacks;
  if (others || (impl_->settings.freezing == Freezing::kOff &&
                 std::any_of(impl_->bodies.begin(), impl_->bodies.end(), is_frozen)))
    impl_->WakeAll();  // nobody else would
}

// Positions, rotations, velocities, as they lie in memory.
static constexpr size_t kMotionBytes = 13 * sizeof(double);

std::vector<std::byte> World::SaveMotion() const {
  impl_->Idle("SaveMotion");
  std::vector<std::byte> bytes(kMotionBytes * impl_->bodies.size());
  std::byte* to = bytes.data();
  for (const Body& b : impl_->bodies) {
    std::memcpy(to, b.position_W.data(), 3 * sizeof(double));
    std::memcpy(to + 3 * sizeof(double), b.rotation_WB.coeffs().data(), 4 * sizeof(double));
    std::memcpy(to + 7 * sizeof(double), b.linear_velocity_W.data(), 3 * sizeof(double));
    std::memcpy(to + 10 * sizeof(double), b.angular_velocity_W.data(), 3 * sizeof(double));
    to += kMotionBytes;
  }
  return bytes;
}

void World::RestoreMotion(std::span<const std::byte> bytes) {
  impl_->Idle("RestoreMotion");
  std::vector<Body>& bodies = impl_->bodies;
  if (bytes.size() != kMotionBytes * bodies.size())
    throw std::invalid_argument("RestoreMotion: " + std::to_string(bytes.size()) + " bytes for " +
                                std::to_string(bodies.size()) + " bodies, of which each has 104");
  std::vector<Body> next = bodies;
  const std::byte* from = bytes.data();
  for (size_t i = 0; i < next.size(); ++i, from += kMotionBytes) {
    Body& b = next[i];
    std::memcpy(b.position_W.data(), from, 3 * sizeof(double));
    std::memcpy(b.rotation_WB.coeffs().data(), from + 3 * sizeof(double), 4 * sizeof(double));
    std::memcpy(b.linear_velocity_W.data(), from + 7 * sizeof(double), 3 * sizeof(double));
    std::memcpy(b.angular_velocity_W.data(), from + 10 * sizeof(double), 3 * sizeof(double));
    b.frozen = false;
    const std::string name = NameOf(static_cast<int>(i));
    RequireFinite(name, "position", b.position_W);
    RequireUnit(name, b.rotation_WB);
    RequireFinite(name, "linear velocity", b.linear_velocity_W);
    RequireFinite(name, "angular velocity", b.angular_velocity_W);
    if (b.kind == BodyKind::kFixed && !(b.linear_velocity_W.isZero(0) && b.angular_velocity_W.isZero(0)))
      Reject(name, "velocity", "of a fixed body must be zero");
  }
  std::copy(next.begin(), next.end(), bodies.begin());  // where they are: somebody may look at them
  impl_->Changed();
}

std::span<const Body> World::bodies() const { return impl_->bodies; }
static void RequireNumber(int number, size_t count) {
  if (number < 0 || number >= static_cast<int>(count))
    throw std::invalid_argument("no body has number " + std::to_string(number));
}
const Body& World::body(int number) const {
  RequireNumber(number, impl_->bodies.size());
  return impl_->bodies[number];
}
const Shape& World::shape(int number) const {
  RequireNumber(number, impl_->shapes.size());
  return impl_->shapes[number];
}
std::span<const Contact> World::contacts() const { return impl_->touching; }
std::span<const Contact> World::resolved_contacts() const { return impl_->resolved; }
std::span<const Vector3> World::impulses() const { return impl_->impulses; }
const Settings& World::settings() const { return impl_->settings; }
double World::time() const { return impl_->time; }
std::uint64_t World::user_data(int number) const {
  impl_->At(number);
  return impl_->user_data[number];
}
Vector3 World::ImpulseOn(int body) const {
  impl_->Idle("ImpulseOn");
  impl_->At(body);
  Vector3 sum = Vector3::Zero();
  for (size_t c = 0; c < impl_->resolved.size(); ++c) {
    if (impl_->resolved[c].body_b == body) sum += impl_->impulses[c];
    if (impl_->resolved[c].body_a == body) sum -= impl_->impulses[c];
  }
  return sum;
}
std::span<const ContactEvent> World::events() const { return impl_->events; }
std::span<const HitEvent> World::hits() const { return impl_->hits; }
std::uint64_t World::StateHash() const {
  impl_->Idle("StateHash");
  return HashBodies(impl_->bodies);
}

}  // namespace islet
