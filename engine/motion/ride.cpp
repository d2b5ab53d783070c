#include "engine/motion/ride.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "engine/motion/lever.h"
#include "engine/response/suite_frame.h"
#include "engine/rotation.h"
#include "qp/smallness.h"

namespace islet::motion {
namespace {

// [m/s] of a velocity, across a contact's normal.
double SlipOf(const Contact& contact, const Vector3& velocity_W) {
  const Vector3& n = contact.normal_W;
  return (velocity_W - n.dot(velocity_W) * n).norm();
}

}  // namespace

bool Ride::Changed(const Body& b) {
  return b.surface_velocity_B != b.surface_before_B ||
         (b.kind != BodyKind::kDynamic &&
          (b.linear_velocity_W != b.linear_before_W || b.angular_velocity_W != b.angular_before_W));
}

bool Ride::AnyChanged(std::span<const Body> bodies) {
  return std::any_of(bodies.begin(), bodies.end(), [](const Body& b) { return !b.removed && Changed(b); });
}

// By which the velocity of a wall differs, where the step begins, from that where the one before ended.
Twist Ride::ChangeOf(const Body& wall) const {
  Twist change;
  if (wall.kind == BodyKind::kDynamic) return change;
  change.linear_W = wall.linear_velocity_W - 0.5 * dt_ * wall.arc_W - (wall.linear_before_W + wall.beyond_before_W);
  change.angular_W = wall.angular_velocity_W - wall.angular_before_W;
  return change;
}

// [m/s] the same of b's surface against a's at a contact.
Vector3 Ride::ChangeAt(const Contact& c, std::span<const Body> bodies) const {
  const auto change = [&](const Body& body) -> Vector3 {
    const Twist twist = ChangeOf(body);
    return body.rotation_WB * (body.surface_velocity_B - body.surface_before_B) + twist.linear_W +
           twist.angular_W.cross(c.point_W - body.position_W);
  };
  const Vector3 change_W = change(bodies[c.body_b]) - change(bodies[c.body_a]);
  const double rounding =
      kRounding * (bodies[c.body_a].linear_velocity_W.norm() + bodies[c.body_b].linear_velocity_W.norm());
  return change_W.norm() > rounding ? change_W : Vector3(Vector3::Zero());
}

void Ride::Begin(double dt, const Settings& settings, std::span<const Shape> shapes, const ContactFilter& filter,
                 const MixMaterial& mix, std::span<const Contact> contacts, std::span<const Vector3> forces_W,
                 std::span<Body> bodies) {
  dt_ = dt;
  const size_t n = bodies.size();
  cut_.resize(n);
  for (size_t i = 0; i < n; ++i) cut_[i] = !CanMove(bodies[i]);
  edges_.clear();
  for (const Contact& c : contacts) edges_.emplace_back(c.body_a, c.body_b);
  islands::BuildPartition({cut_, edges_}, &partition_);
  posed_.resize(n);
  given_W_.resize(n);
  moment_W_.resize(n);
  upright_.assign(n, false);
  rode_.resize(n);
  for (size_t i = 0; i < n; ++i) rode_[i] = std::exchange(bodies[i].rides, false);
  for (int island = 0; island < partition_.num_islands(); ++island) {
    const std::span<const int> of_island = partition_.contacts_of(island), members = partition_.bodies_of(island);
    if (std::all_of(of_island.begin(), of_island.end(), [&](int c) { return ChangeAt(contacts[c], bodies).isZero(0); }))
      continue;
    Detect(of_island, settings, shapes, filter, mix, contacts, forces_W, bodies);
    if (!Predict(members, settings, bodies) || !Load(members, bodies)) continue;
    bool solved = Solve(members, settings);
    const bool upright = solved && FindChange(bodies) && KeepUpright(members, settings, bodies);
    if (upright) solved = Solve(members, settings);
    if (solved) Give(members, upright, bodies);
  }
}

// The contacts that an island has now, where bodies may have been moved since, and the forces that held there.
void Ride::Detect(std::span<const int> of_island, const Settings& settings, std::span<const Shape> shapes,
                  const ContactFilter& filter, const MixMaterial& mix, std::span<const Contact> contacts,
                  std::span<const Vector3> forces_W, std::span<const Body> bodies) {
  before_.clear();
  before_force_W_.clear();
  now_.clear();
  const auto size_of = [&](const Contact& c) { return std::min(shapes[c.body_a].size(), shapes[c.body_b].size()); };
  for (const int k : of_island) {
    const Contact& c = contacts[k];
    const bool same_pair = !before_.empty() && SamePair(before_.back(), c);
    before_.push_back(c);
    before_force_W_.push_back(forces_W[k]);
    const Body &a = bodies[c.body_a], &b = bodies[c.body_b];
    if (same_pair || a.removed || b.removed || !filter.Allows(bodies, c.body_a, c.body_b)) continue;
    const size_t first = now_.size();
    CollideShapes(shapes[c.body_a], Pose{a.position_W, a.rotation_WB}.placement(), shapes[c.body_b],
                  Pose{b.position_W, b.rotation_WB}.placement(), 4 * settings.overlap_tolerance * size_of(c), &now_);
    for (size_t found = first; found < now_.size(); ++found) {
      now_[found].body_a = c.body_a, now_[found].body_b = c.body_b;
      mix(&now_[found], a, b);
    }
  }
  RecallForces(before_, before_force_W_, now_, size_of, &force_W_);
  found_ = now_;
}

// A body in changes of velocities: it has none, a wall its own.
void Ride::PoseChange(const Body& body, Body* posed) const {
  *posed = body;
  SetTwist(ChangeOf(body), posed);
  posed->frozen = false;
}

// What all of an island weigh together, and how fast they may be.
void Ride::Weigh(std::span<const int> members, const Settings& settings, std::span<const Body> bodies) {
  double pull = settings.gravity.norm(), fastest = 0;  // [m/s^2], [m/s]
  mass_ = 0;
  for (const int i : members) {
    const Body& b = bodies[i];
    mass_ += b.mass;
    fastest = std::max(fastest, FastestPoint(TwistOf(b), b.radius));
    if (b.force_W.isZero(0) && b.torque_W.isZero(0)) continue;
    pull = std::max(
        pull, (settings.gravity + b.force_W / b.mass).norm() + b.radius * SpinOf(b, b.rotation_WB, b.torque_W).norm());
  }
  floor_ = std::max({pull * dt_, 1e-3 * fastest, 1e-12});
}

// A body as weight and forces alone would leave it where the step ends; a wall as it goes in the step.
void Ride::PoseFree(const Settings& settings, const Body& body, Body* posed) const {
  *posed = body;
  posed->linear_velocity_W += 0.5 * dt_ * body.arc_W;
  if (body.kind != BodyKind::kDynamic) return;
  posed->frozen = false;
  posed->linear_velocity_W += dt_ * (settings.gravity + body.force_W / body.mass);
  const Vector3 torque_W = body.torque_W - body.angular_velocity_W.cross(body.AngularMomentumW());
  posed->angular_velocity_W += dt_ * SpinOf(body, body.rotation_WB, torque_W);
}

// Who rides: the step is solved as one piece, roughly, with the change of the walls, weight, the user's forces and true cones. What stays closed in
// that goes along with its wall, and is held by friction if it sticks. Returns whether that is known.
bool Ride::Predict(std::span<const int> members, const Settings& settings, std::span<const Body> bodies) {
  Weigh(members, settings, bodies);
  for (const int i : members) PoseFree(settings, bodies[i], &posed_[i]);
  frames_.resize(now_.size());
  targets_.resize(now_.size());
  local_.resize(now_.size());
  held_.clear();
  for (size_t c = 0, end = 0; c < now_.size(); c = end) {
    double pressed = 0;  // [N s] of the pair
    for (end = c; end < now_.size() && SamePair(now_[c], now_[end]); ++end)
      pressed += std::max(0.0, dt_ * now_[end].normal_W.dot(force_W_[end]));
    const auto [i, k] = std::pair(now_[c].body_a, now_[c].body_b);
    const Body &a = bodies[i], &b = bodies[k];
    if (cut_[i]) PoseFree(settings, a, &posed_[i]);
    if (cut_[k]) PoseFree(settings, b, &posed_[k]);
    const double ends_at_once = settings.gravity.norm() * dt_ + pressed / mass_;  // [m/s] a rebound within the step
    for (size_t p = c; p < end; ++p) {
      Contact& contact = now_[p];
      frames_[p] = ContactFrame(contact.normal_W);
      local_[p] = frames_[p].transpose() * (dt_ * force_W_[p]);
      targets_[p] = -2 * std::max(0.0, contact.gap) / dt_;  // the speed grows evenly, from none
      contact.surface_W = b.rotation_WB * b.surface_velocity_B - a.rotation_WB * a.surface_velocity_B;
      if (contact.restitution == 0 || -contact.normal_W.dot(ChangeAt(contact, bodies)) <= ends_at_once)
        held_.push_back(static_cast<int>(p));
    }
  }
  Settings rough = settings;
  rough.tolerance = std::max(settings.tolerance, 1e-4);
  if (responder_.ResolveTargets({members, held_}, {now_, frames_}, targets_, rough, floor_, posed_, local_).status ==
      QpStatus::kFailed)
    return false;
  const double still = 10 * rough.tolerance * floor_;  // [m/s]
  std::erase_if(held_, [&](int c) {
    const Contact& contact = now_[c];
    const Vector3 velocity_W = RelativeVelocity(contact, posed_[contact.body_a], posed_[contact.body_b]);
    if (SlipOf(contact, velocity_W) > still) now_[c].friction = 0;
    return local_[c].x() <= 0 && contact.normal_W.dot(velocity_W) > targets_[c] + still;
  });
  return true;
}

// The problem of what rides: its contacts hold as if by a load that nothing lifts and no friction lets slip. Returns whether any changes.
bool Ride::Load(std::span<const int> members, std::span<const Body> bodies) {
  for (const int i : members) PoseChange(bodies[i], &posed_[i]);
  double most = 0;
  for (const int c : held_) {
    Contact& contact = now_[c];
    const Body &a = bodies[contact.body_a], &b = bodies[contact.body_b];
    contact.surface_W = b.rotation_WB * (b.surface_velocity_B - b.surface_before_B) -
                        a.rotation_WB * (a.surface_velocity_B - a.surface_before_B);
    most = std::max(most, ChangeAt(contact, bodies).norm());
    PoseChange(a, &posed_[contact.body_a]);
    PoseChange(b, &posed_[contact.body_b]);
  }
  if (most == 0) return false;
  targets_.assign(now_.size(), 0.0);
  local_.assign(now_.size(), Vector3::Zero());
  load_W_.assign(now_.size(), Vector3::Zero());
  for (const int c : held_) {
    if (now_[c].friction > 0) now_[c].friction = 1;
    load_W_[c] = 2 * mass_ * most * now_[c].normal_W;
  }
  return true;
}

bool Ride::Solve(std::span<const int> members, const Settings& settings) {
  for (const int i : members) {
    Twist twist;
    if (upright_[i]) twist.angular_W = change_.angular_W;
    SetTwist(twist, &posed_[i]);
  }
  for (const int c : held_) {
    local_[c] = frames_[c].transpose() * load_W_[c];
    ApplyImpulse(now_[c], -load_W_[c], posed_);
  }
  return responder_.ResolveTargets({members, held_}, {now_, frames_}, targets_, settings, floor_, posed_, local_)
             .status != QpStatus::kFailed;
}

// The change of velocity of all walls of an island. Returns whether they have one in common.
bool Ride::FindChange(std::span<const Body> bodies) {
  bool found = false;
  for (const int c : held_) {
    for (const auto& [i, sign] : {std::pair{now_[c].body_a, -1.0}, std::pair{now_[c].body_b, 1.0}}) {
      if (!cut_[i]) continue;
      Twist change = TwistOf(posed_[i]);  // at the origin
      change.linear_W += sign * now_[c].surface_W - change.angular_W.cross(bodies[i].position_W);
      if (found && (change.linear_W != change_.linear_W || change.angular_W != change_.angular_W)) return false;
      change_ = change;
      found = true;
    }
  }
  return found;
}

// What rode as one and would turn now, since it tips or is held at one side, does not turn at once: what it is given goes through its centre, and
// so does what takes it back. Returns whether there is any.
bool Ride::KeepUpright(std::span<const int> members, const Settings& settings, std::span<Body> bodies) {
  bool any = false;
  for (const int i : members) {
    const Body& p = posed_[i];
    const double least = 10 * settings.tolerance * floor_;
    const Vector3 change_W = change_.linear_W + change_.angular_W.cross(p.position_W);
    const bool turns = p.radius * (p.angular_velocity_W - change_.angular_W).norm() > least;
    upright_[i] = rode_[i] && turns;
    bodies[i].rides =
        rode_[i] || (!turns && (p.linear_velocity_W - change_W).norm() <= least && change_W.norm() > 10 * least);
    if (!upright_[i]) continue;
    posed_[i].inertia_B /= kNegligible;
    any = true;
  }
  return any;
}

// [rad/s] of the walls that give something: all that rides turns with them.
Vector3 Ride::TurnOfWalls(std::span<const Body> bodies) const {
  Vector3 turn = Vector3::Zero();
  double all = 0;
  for (const int c : held_) {
    for (const int i : {now_[c].body_a, now_[c].body_b}) {
      if (bodies[i].kind != BodyKind::kKinematic) continue;
      const double weight = GivenBy(c).norm();
      turn += weight * bodies[i].angular_velocity_W;
      all += weight;
    }
  }
  return all > 0 ? Vector3(turn / all) : turn;
}

// [N s] on body_b.
Vector3 Ride::GivenBy(int c) const { return frames_[c] * local_[c] - load_W_[c]; }

// What the contacts of an island give at once, and take back all through the step, turned with what turns them.
void Ride::Give(std::span<const int> members, bool upright, std::span<Body> bodies) {
  const Quaternion halfway = upright ? Quaternion(Quaternion::Identity()) : Exp(0.5 * dt_ * TurnOfWalls(bodies));
  for (const int i : members) {
    given_W_[i].setZero();
    moment_W_[i].setZero();
  }
  for (const int c : held_) {
    const Contact& contact = now_[c];
    const Vector3 impulse = GivenBy(c), left = impulse - halfway * impulse;
    for (const auto& [i, sign] : {std::pair{contact.body_a, -1.0}, std::pair{contact.body_b, 1.0}}) {
      if (cut_[i]) continue;
      given_W_[i] += sign * impulse;
      moment_W_[i] += sign * (contact.point_W - bodies[i].position_W).cross(impulse);
    }
    if (left.norm() <= kRounding * impulse.norm()) continue;
    kept_.push_back(found_[c]);
    kept_W_.push_back(left);
  }
  for (const int i : members) {
    Body& b = bodies[i];
    if (upright_[i]) moment_W_[i] = b.InertiaW() * change_.angular_W;
    const double least = kRounding * std::max(b.mass * floor_, given_W_[i].norm());
    if (given_W_[i].norm() <= least) given_W_[i].setZero();
    if (moment_W_[i].norm() <= b.radius * least) moment_W_[i].setZero();
    if (given_W_[i].isZero(0) && moment_W_[i].isZero(0)) continue;
    riders_.push_back({i, b.force_W, b.torque_W});
    b.frozen = false;
    b.linear_velocity_W += given_W_[i] / b.mass;
    b.force_W -= halfway * given_W_[i] / dt_;
    if (moment_W_[i].isZero(0)) continue;
    b.angular_velocity_W += SpinOf(b, b.rotation_WB, moment_W_[i]);
    b.torque_W -= halfway * moment_W_[i] / dt_;
  }
}

void Ride::End(std::span<Body> bodies, std::vector<Contact>* contacts, std::vector<Vector3>* impulses_W) {
  for (const Rider& rider : riders_) {
    bodies[rider.body].force_W = rider.force_W;
    bodies[rider.body].torque_W = rider.torque_W;
  }
  contacts->insert(contacts->end(), kept_.begin(), kept_.end());
  impulses_W->insert(impulses_W->end(), kept_W_.begin(), kept_W_.end());
  Clear();
}

void Ride::Clear() {
  riders_.clear();
  kept_.clear();
  kept_W_.clear();
}

}  // namespace islet::motion
