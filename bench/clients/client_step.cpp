#include "bench/clients/client_step.h"

#include <algorithm>

namespace islet::clients {
namespace {

// Lengths in smaller radii of two bodies. What is deep is undone a share a step, or it would be pushed into neighbours not found yet.
constexpr double kAtOnce = 0.01;  // overlap that is undone in one step
constexpr double kShare = 0.2;    // of what is deeper
constexpr double kTouch = 5e-4;   // nearer points touch
constexpr double kSlop = 1e-6;    // overlap that stays where two bodies turn against each other
constexpr double kTurn = 1e-5;    // [rad] in a step, if by more than this
constexpr double kUnseen = 5e-4;  // overlap at the end of a step that is worth another round, for what moves fast
constexpr double kOfWay =
    0.1;  // the same in ways of both: what stands does not sink for a contact that its host overlooks
constexpr double kPaid = 0.9;  // of what bodies lose in a step: what undoing overlaps may give them
// A point found at the end of a step is one of its start again that is so near and whose normal is so alike, in its cosine.
constexpr double kSamePlace = 0.1, kSameNormal = 0.9;

double Size(const Contact& c, std::span<const Body> bodies) {
  return std::min(bodies[c.body_a].radius, bodies[c.body_b].radius);
}

}  // namespace

Quaternion Turned(const Vector3& turn_W, const Quaternion& rotation_WB) {
  const double angle = turn_W.norm();
  if (angle == 0) return rotation_WB;
  return (Eigen::AngleAxisd(angle, turn_W / angle) * rotation_WB).normalized();
}

void ClientStep::Begin(double dt, const Vector3& gravity_W) {
  dt_ = dt;
  gravity_W_ = gravity_W;
  suite_.SetGravity(gravity_W);
  bodies.clear();
  contacts.clear();
  found_.clear();
  first_ = true;
}

double ClientStep::Slop(const Contact& c) const {
  const double turn = dt_ * (bodies[c.body_b].angular_velocity_W - bodies[c.body_a].angular_velocity_W).norm();
  return turn > kTurn ? kSlop * Size(c, bodies) : 0;
}

bool ClientStep::WallsMove() const {
  return std::ranges::any_of(bodies, [](const Body& b) {
    return b.kind == BodyKind::kKinematic && !(b.linear_velocity_W.isZero(0) && b.angular_velocity_W.isZero(0));
  });
}

// Kinetic, and in the fields of gravity and of the step's forces, from where the host has them.
double ClientStep::Energy() const {
  double energy = 0;
  for (size_t i = 0; i < bodies.size(); ++i) {
    const Body &b = bodies[i], &from = given_[i];
    if (b.kind != BodyKind::kDynamic) continue;
    const Eigen::AngleAxisd turn(b.rotation_WB * from.rotation_WB.conjugate());
    energy += b.KineticEnergy() - (b.mass * gravity_W_ + b.force_W).dot(b.position_W - from.position_W) -
              turn.angle() * b.torque_W.dot(turn.axis());
  }
  return energy;
}

// Where nobody moves, nobody can pay: what rests is left alone.
void ClientStep::UndoOverlaps() {
  std::stable_sort(contacts.begin(), contacts.end(), EarlierPair);
  given_ = bodies;
  touching_ = contacts;
  undo_.assign(bodies.size(), {});
  const auto can_pay = [&](const Body& b) { return b.KineticEnergy() > b.mass * gravity_W_.norm() * kSlop * b.radius; };
  if (!WallsMove() && std::ranges::none_of(bodies, can_pay)) return Place(0);
  scratch_ = contacts;
  for (Contact& c : scratch_) c.gap = std::max(c.gap, std::min(-kAtOnce * Size(c, bodies), kShare * c.gap)) + Slop(c);
  suite_.Project(bodies, scratch_);
  undo_.assign(suite_.displacements().begin(), suite_.displacements().end());
  Place(1);
}

// Bodies and contacts where the step begins: as the host has them, with that share of what was undone before.
void ClientStep::Place(double share) {
  bodies = given_;
  contacts = touching_;
  for (Twist& w : undo_) w = {share * w.linear_W, share * w.angular_W};
  const std::vector<Twist>& w = undo_;
  const double before = Energy();
  const auto moved = [&](int body, const Vector3& point) -> Vector3 {
    return w[body].linear_W + w[body].angular_W.cross(point - bodies[body].position_W);
  };
  for (Contact& c : contacts) {
    c.gap += c.normal_W.dot(moved(c.body_b, c.point_W) - moved(c.body_a, c.point_W));
    const double slop = Slop(c);
    c.touches = c.gap <= (slop > 0 ? 0 : kTouch * Size(c, bodies));
    if (!c.touches) c.gap += slop;
  }
  for (size_t i = 0; i < bodies.size(); ++i) {
    if (!bodies[i].Moves()) continue;
    bodies[i].position_W += w[i].linear_W;
    bodies[i].rotation_WB = Turned(w[i].angular_W, bodies[i].rotation_WB);
  }
  undoing_ = Energy() - before;
  start_ = bodies;
  far_ = 1e6;
  for (const Body& b : bodies)
    if (b.Moves()) far_ = std::min(far_, kSlop * b.radius);
}

bool ClientStep::MovesFar(int body) const { return way_[body] > far_; }

bool ClientStep::AddFound(Contact c) {
  const double size = Size(c, bodies);
  const double unseen = std::max(kSlop * size, std::min(kUnseen * size, kOfWay * (way_[c.body_a] + way_[c.body_b])));
  if (c.gap > -unseen) return false;
  const auto at_start = [&](int body) -> Vector3 {
    const Body &from = start_[body], &to = bodies[body];
    return from.position_W + from.rotation_WB * (to.rotation_WB.conjugate() * (c.point_W - to.position_W));
  };
  const Vector3 a = at_start(c.body_a), b = at_start(c.body_b);
  const double closed = c.gap;
  c.gap += c.normal_W.dot(b - a);
  if (c.gap - closed < unseen) return false;  // not in this step, or along another normal
  c.gap = std::max(c.gap, 0.0);
  c.point_W = 0.5 * (a + b);
  const auto [begin, end] = std::equal_range(contacts.begin(), contacts.end(), c, EarlierPair);
  for (auto old = begin; old != end; ++old) {
    if ((old->point_W - c.point_W).norm() > kSamePlace * size || old->normal_W.dot(c.normal_W) < kSameNormal) continue;
    if (old->touches) return false;
    old->touches = old->gap == 0;
    old->gap = std::max(0.0, old->gap + closed);
    return true;
  }
  c.touches = c.restitution > 0;  // what bounces has to meet at full speed: it does so a part of a step too early
  found_.push_back(c);
  return true;
}

// Where it begins elsewhere, contacts that were found in earlier rounds are forgotten: the client finds again what closes.
void ClientStep::Resolve() {
  if (first_)
    memory_ = suite_.CopyMemory();
  else
    suite_.SetMemory(*memory_);
  first_ = false;
  ResolveOnce();
  for (const double share : {kPaid, 0.0}) {
    if (IsPaid()) return;
    Place(share * std::max(lost_, 0.0) / undoing_);
    suite_.SetMemory(*memory_);
    ResolveOnce();
  }
}

bool ClientStep::IsPaid() const { return undoing_ <= std::max(lost_, 0.0) || WallsMove(); }

// From the start of the step.
void ClientStep::ResolveOnce() {
  bodies = start_;
  contacts.insert(contacts.end(), found_.begin(), found_.end());
  found_.clear();
  std::stable_sort(contacts.begin(), contacts.end(), EarlierPair);
  const double before = Energy();
  suite_.Resolve(dt_, bodies, contacts, &report_);
  Move();
  lost_ = before - Energy();
}

void ClientStep::Move() {
  const std::span<const Twist> before = suite_.velocities_before_gravity();
  way_.assign(bodies.size(), 0);
  for (size_t i = 0; i < bodies.size(); ++i) {  // kinematic ones as well
    const Body& b = bodies[i];
    const auto farthest = [&](const Vector3& v, const Vector3& w) { return dt_ * (v.norm() + b.radius * w.norm()); };
    way_[i] = std::max(farthest(b.linear_velocity_W, b.angular_velocity_W),
                       farthest(before[i].linear_W, before[i].angular_W));
  }
  suite_.Move(bodies);
}

}  // namespace islet::clients
