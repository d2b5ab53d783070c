#include "engine/motion/stepper.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "engine/motion/visible_turn.h"
#include "engine/response/suite_frame.h"
#include "qp/smallness.h"

namespace islet::motion {
namespace {

constexpr double kNear = 5e-5;     // of a size: overlap by which what rests on each other has met anew
constexpr double kDeep = 2.5e-4;   // of a size: an overlap that is never left
constexpr double kThrough = 0.25;  // of a size: the same on the way through a piece, at the end of which there is none
constexpr double kNearer = 0.5;    // of the overlap that a pass leaves: more is no progress
constexpr int kAges = 2;           // passes for which a contact that pressed, and is not found again, stays
constexpr double kGain = 1e-11;    // of the energy at hand: a piece that gains more is done again, shorter
constexpr double kPositionRounding = 1e-15;  // of a position
constexpr double kLeft = 0.02;               // of the tolerance: velocities that solves leave, in what they may gain
constexpr int kLevels = 10;                  // times that a piece is halved
constexpr int kSolveWork = 32;
constexpr double kTurn = 0.5;    // [rad] of a piece, where something is near
constexpr double kNearby = 0.1;  // of a size: how far what presses is looked for
constexpr int kGuardRounds = 4;  // of looking for pairs that meet slowly within a piece
constexpr double kJam = 1;  // times |g| h (1 + mu), and bodies that may press: friction that throws back faster jams
constexpr double kInstant = 1e-4;    // of a piece: one in which a jam stops what slides
constexpr double kStopped = 1e-6;    // of the energy at hand: what a jam takes at least
constexpr double kSettled = 0.0002;  // of the tolerance: what velocities at the end may miss
constexpr double kMet =
    1e-8;  // of a size: gap below which a contact is closed beside one that presses, or about to hit
constexpr double kTogether =
    1e-4;  // of a size: what is this near to a blow takes part, or a flat landing were one of corners
constexpr double kNormalMoves = 1e-7;  // [rad] what a normal may turn by in such a piece
constexpr int kLineRounds = 20;        // each takes some ten times off the angle
constexpr int kBlowWork = 256;         // bodies times blows in a step; beyond it they have to be faster and faster
constexpr int kLeastBlows = 8;
constexpr double kRocks =
    0.25;  // restitution below which a blow is as brief: what does not rebound rocks over to where it did not press
constexpr double kBrief =
    4;  // times the step over the number of blows it may have: a rebound that is over sooner is none

Vector3 AngularMomentum(const Body& body, const Quaternion& rotation, const Vector3& w) {
  return rotation * Vector3(body.inertia_B * (rotation.conjugate() * w));
}
void ApplyTo(const Contact& contact, const Vector3& impulse_W, std::vector<Body>* bodies) {
  Body &a = (*bodies)[contact.body_a], &b = (*bodies)[contact.body_b];
  if (a.Moves()) a.ApplyImpulse(-impulse_W, contact.point_W);
  if (b.Moves()) b.ApplyImpulse(impulse_W, contact.point_W);
}

// Whether the impulse of a contact that presses is one that its velocity allows: closed, and stuck or rubbing.
bool Agrees(const Contact& contact, const Vector3& impulse, const Vector3& velocity, double still) {
  const Vector3& n = contact.normal_W;
  const double press = n.dot(impulse), opening = n.dot(velocity);
  const Vector3 friction = impulse - press * n, slip = velocity - opening * n;
  if (std::abs(opening) > still) return false;
  constexpr double kAlike = 1e-6;  // of the normal impulse
  if (slip.norm() <= still) return friction.norm() <= (1 + kAlike) * contact.friction * press;
  return (friction + contact.friction * press / slip.norm() * slip).norm() <= kAlike * press;
}

// The impulse of a contact that slid all the way, with its friction against the slip that it has now: the slip has turned since
// halfway, and what rubs has turned with it.
Vector3 TurnedAlong(const Contact& contact, const Vector3& impulse, const Vector3& velocity, double still) {
  constexpr double kOnCone = 1 - 1e-3;
  const Vector3& n = contact.normal_W;
  const double press = n.dot(impulse);
  const Vector3 friction = impulse - press * n, slip = velocity - n.dot(velocity) * n;
  if (slip.norm() <= still || friction.dot(slip) >= 0 || friction.norm() < kOnCone * contact.friction * press)
    return impulse;
  return press * n - contact.friction * press / slip.norm() * slip;
}

}  // namespace

void GroupOutcome::Clear() {
  pieces = blows = bounces = passes = halvings = 0;
  unstepped = overlap = 0;
  overlapping = 0;
  restitution_lowered = record = record_paths = false;
  impulses.clear();
  ends.clear();
  paths.clear();
  touching.clear();
  touching_force_W.clear();
  for (auto* answers : {&carried, &settled, &struck}) answers->clear();
  records.clear();
}

double Stepper::Size(const GroupPair& pair) const {
  return std::min(group_->shapes[pair.a]->size(), group_->shapes[pair.b]->size());
}

double Stepper::BodyRadius(int i) const {
  const Shape& shape = *group_->shapes[i];
  const bool turns_in_itself = shape.kind() == ShapeKind::kSphere || shape.kind() == ShapeKind::kHalfSpace;
  return turns_in_itself ? 0 : shape.radius();
}

// [m/s^2] fastest that the ways of two bodies bend towards each other: by weight, and where the user turns one.
double Stepper::BendOf(const Contact& contact) const {
  double bend = pull_;
  for (const int i : {contact.body_a, contact.body_b}) {
    const Body& b = group_->bodies[i];
    if (b.kind != BodyKind::kKinematic) continue;
    bend += b.angular_velocity_W.cross(b.angular_velocity_W.cross(contact.point_W - state_[i].pose.position_W)).norm();
  }
  return bend;
}

// [m/s] approaches above it are blows: what they do is not over at once. Where there have been too many in the step, it takes more
// and more.
double Stepper::CutSpeed(const Contact& contact) const {
  const double brief = 0.5 * kBrief * dt_ / blow_budget_ / std::max(contact.restitution, kRocks);  // [s]
  const int beyond = std::clamp(cuts_ - blow_budget_, 0, 60);
  return std::max(threshold_, std::ldexp(BendOf(contact) * std::min(brief, dt_), beyond));
}

// Whether it is a blow, when it gets there: as fast as it is, or falls by then.
bool Stepper::WillHit(const Contact& contact, double opening) const {
  const double approach = std::max(0.0, -opening), cut = CutSpeed(contact);
  const bool closed = contact.gap <= kMet * Size({contact.body_a, contact.body_b});
  return approach * approach + (closed ? 0 : 2 * pull_ * contact.gap) > cut * cut;
}

void Stepper::LoadState() {
  const size_t n = group_->bodies.size();
  state_.resize(n);
  for (size_t i = 0; i < n; ++i) {
    const Body& b = group_->bodies[i];
    state_[i] = {{b.position_W, b.rotation_WB}, b.linear_velocity_W, b.angular_velocity_W};
  }
  end_state_ = state_;
  middle_.resize(n);
  turned_.resize(n);
  spun_.resize(n);
  spun_after_.resize(n);
  mean_W_.resize(n);
  posed_ = group_->bodies;
  cut_.resize(n);
  for (size_t i = 0; i < n; ++i) cut_[i] = !posed_[i].Moves();
}

// Walls are where their velocity takes them: poses at time t of the step, in `states` of those that do not move by contacts.
static void PlaceWallsAt(double t, const std::vector<Body>& bodies,
                         const std::function<void(size_t, const Pose&)>& set) {
  for (size_t i = 0; i < bodies.size(); ++i) {
    const Body& b = bodies[i];
    if (b.Moves()) continue;
    set(i, {b.position_W + t * b.linear_velocity_W, Turned(t * b.angular_velocity_W, b.rotation_WB)});
  }
}

// [m] at least between the bodies of a pair, by the spheres around them.
double Stepper::Apart(const GroupPair& pair, std::span<const State> at) const {
  const Vector3 way = at[pair.b].pose.position_W - at[pair.a].pose.position_W;
  const bool plane_a = group_->shapes[pair.a]->kind() == ShapeKind::kHalfSpace,
             plane_b = group_->shapes[pair.b]->kind() == ShapeKind::kHalfSpace;
  const auto up = [&](int i) -> Vector3 { return at[i].pose.rotation_WB * Vector3::UnitZ(); };
  if (plane_a) return up(pair.a).dot(way) - group_->bodies[pair.b].radius;
  if (plane_b) return -up(pair.b).dot(way) - group_->bodies[pair.a].radius;
  return way.norm() - group_->bodies[pair.a].radius - group_->bodies[pair.b].radius;
}

void Stepper::DetectPair(int number, std::span<const State> at, double reach, std::vector<Contact>* contacts,
                         std::vector<int>* pair_of) {
  const GroupPair& pair = group_->pairs[number];
  if (Apart(pair, at) > reach) return;
  const size_t first = contacts->size();
  CollideShapes(*group_->shapes[pair.a], at[pair.a].pose.placement(), *group_->shapes[pair.b],
                at[pair.b].pose.placement(), reach, contacts);
  for (size_t c = first; c < contacts->size(); ++c) {
    Contact& contact = (*contacts)[c];
    Mix(pair, &contact);
    pair_of->push_back(number);
  }
}

// Materials are the world's to choose, by the bodies' numbers there.
void Stepper::Mix(const GroupPair& pair, Contact* contact) const {
  contact->body_a = group_->numbers[pair.a];
  contact->body_b = group_->numbers[pair.b];
  (*mix_)(contact, group_->bodies[pair.a], group_->bodies[pair.b]);
  contact->body_a = pair.a;
  contact->body_b = pair.b;
}

void Stepper::FindTouching() {
  now_.clear();
  now_pair_.clear();
  for (size_t p = 0; p < group_->pairs.size(); ++p)
    DetectPair(static_cast<int>(p), state_, 4 * settings_.overlap_tolerance * Size(group_->pairs[p]), &now_,
               &now_pair_);
}

// The forces that held where the step before ended, at the same contacts or the nearest of the same bodies.
void Stepper::Recall() {
  force_W_.assign(now_.size(), Vector3::Zero());
  for (size_t k = 0; k < group_->remembered.size(); ++k) {
    const Contact& old = group_->remembered[k];
    if (group_->remembered_force_W[k].isZero(0)) continue;
    const auto [first, last] = std::equal_range(now_.begin(), now_.end(), old, EarlierPair);
    const double size = std::min(group_->shapes[old.body_a]->size(), group_->shapes[old.body_b]->size());
    const int heir = FindAgain({first, last}, old.feature, old.point_W, kSamePlace * size, INFINITY);
    if (heir >= 0) force_W_[first - now_.begin() + heir] += group_->remembered_force_W[k];
  }
}

Vector3 Stepper::VisibleSpinOf(int i) const {
  return VisibleSpin(*group_->shapes[i], state_[i].pose.rotation_WB, state_[i].angular_W);
}

// [m/s] fastest that the turn moves a point of the box around a body.
double Stepper::WhirlOf(int i) const {
  const Vector3 w = (state_[i].pose.rotation_WB.conjugate() * VisibleSpinOf(i)).cwiseAbs(),
                e = group_->shapes[i]->half_extents();
  return Vector3(w.y() * e.z() + w.z() * e.y(), w.z() * e.x() + w.x() * e.z(), w.x() * e.y() + w.y() * e.x()).norm();
}

// A turn bends the way of a corner; a piece in which something is near is no longer than what one lever describes, and no way in it
// bends farther than its body is thick.
double Stepper::ChooseLength(double rest) {
  double most = rest;
  for (const GroupPair& pair : group_->pairs) {
    const double apart = std::max(0.0, Apart(pair, state_)),
                 speed = (state_[pair.b].linear_W - state_[pair.a].linear_W).norm();
    const double near_at = apart > 0 ? 2 * apart / (speed + std::sqrt(speed * speed + 8 * pull_ * apart)) : 0;  // [s]
    for (const int i : {pair.a, pair.b}) {
      if (near_at >= most) break;
      if (BodyRadius(i) == 0) continue;
      const double turn = VisibleSpinOf(i).norm(), size = group_->shapes[i]->size();
      const double bend = turn * WhirlOf(i) / 8;  // [m/s^2]
      if (turn * most > kTurn) most = std::max(near_at, kTurn / turn);
      if (bend * most * most > size) most = std::max(near_at, std::sqrt(size / bend));
    }
  }
  return most;
}

// Contacts that may carry: what touches and does not leave. What is open carries where bodies meet (Guard), not where they are near:
// a ball that rolls over an edge is near it, and never meets it.
void Stepper::SelectHeld(double h) {
  held_.clear();
  held_of_.clear();
  impulse_W_.clear();
  closed_.assign(now_.size(), false);
  const double leaves = pull_ > 0 ? least_rebound_ : threshold_;
  for (size_t c = 0; c < now_.size(); ++c) {
    const Contact& contact = now_[c];
    const GroupPair& pair = group_->pairs[now_pair_[c]];
    if (contact.gap > settings_.overlap_tolerance * Size(pair)) continue;
    const double opening =
        contact.normal_W.dot(state_[pair.b].VelocityAt(contact.point_W) - state_[pair.a].VelocityAt(contact.point_W));
    if (WillHit(contact, opening) && yields_[now_pair_[c]] == 0) {
      if (freed_[now_pair_[c]] == kStays) freed_[now_pair_[c]] = kHits;
      continue;
    }
    if (opening > leaves && freed_[now_pair_[c]] != kReturns) {
      freed_[now_pair_[c]] = kLeaves;
      continue;
    }
    const Vector3 guess = h * force_W_[c];
    if (contact.gap > kExact * Size(pair) && guess.isZero(0)) continue;
    closed_[c] = true;
    held_.push_back(contact);
    const double yields = yields_[now_pair_[c]];
    const double gap =
        contact.gap > kExact * Size(pair) ? contact.gap : PushOut(now_pair_[c]) * std::min(0.0, contact.gap);
    const double target = yields > 0 ? -yields : -gap / h;
    held_of_.push_back({now_pair_[c], CentreAtStart(now_pair_[c]), target, target});
    impulse_W_.push_back(WithinCone(contact, guess));
  }
}

// The contact frames and the islands of the problem at hand.
void Stepper::PartProblem() {
  frames_.resize(problem_.size());
  edges_.clear();
  for (size_t c = 0; c < problem_.size(); ++c) {
    frames_[c] = ContactFrame(problem_[c].normal_W);
    edges_.emplace_back(problem_[c].body_a, problem_[c].body_b);
  }
  islands::BuildPartition({cut_, edges_}, &partition_);
  work_ += kSolveWork * static_cast<int>(problem_.size());
}

void Stepper::SolveParts(std::span<const double> targets, double floor, std::vector<ResponseOutcome>* outcomes) {
  PartProblem();
  for (int island = 0; island < partition_.num_islands(); ++island) {
    const IslandView view{partition_.bodies_of(island), partition_.contacts_of(island)};
    if (view.contacts.empty()) continue;
    outcomes->push_back(
        responder_.ResolveTargets(view, {problem_, frames_}, targets, settings_, floor, posed_, local_impulses_));
    Record(Stage::kStatic, outcomes->back().status);
  }
}

void Stepper::Record(Stage stage, QpStatus status) {
  if (!out_->record || status == QpStatus::kNone) return;
  out_->records.push_back({static_cast<int>(out_->records.size()), group_->numbers[0], stage, status,
                           responder_.problem(), responder_.solution()});
}

// Impulses that keep the held contacts open at the end of the piece. Unknown: the mean velocity, after half of each impulse.
void Stepper::Carry(double h, bool first) {
  if (held_.empty()) return;
  const double t = time_of_piece_;
  const std::vector<Body>& bodies = group_->bodies;
  for (size_t i = 0; i < bodies.size(); ++i) {
    const Body& b = bodies[i];
    if (!b.Moves()) continue;
    const State& s = state_[i];
    turned_[i] = {s.pose.position_W,
                  Turned(FreeRotation(b.inertia_B, s.pose.rotation_WB, s.angular_W, 0.5 * h), s.pose.rotation_WB)};
    spun_[i] = AngularVelocityAfter(b.inertia_B, s.pose.rotation_WB, s.angular_W, turned_[i].rotation_WB);
    Body& p = posed_[i];
    p.position_W = first ? s.pose.position_W : middle_[i].position_W;
    p.rotation_WB = turned_[i].rotation_WB;
    p.linear_velocity_W = s.linear_W + 0.5 * h * (settings_.gravity + b.force_W / b.mass);
    p.angular_velocity_W = spun_[i];
    if (!b.torque_W.isZero(0)) p.angular_velocity_W += 0.5 * h * SpinOf(b, p.rotation_WB, b.torque_W);
  }
  PlaceWallsAt(first ? t : t + 0.5 * h, bodies, [&](size_t i, const Pose& pose) {
    posed_[i].position_W = pose.position_W;
    posed_[i].rotation_WB = pose.rotation_WB;
  });
  problem_ = held_;
  targets_.resize(held_.size());
  local_impulses_.resize(held_.size());
  for (size_t c = 0; c < held_.size(); ++c) {
    targets_[c] = held_of_[c].target;
    local_impulses_[c] = 0.5 * (ContactFrame(held_[c].normal_W).transpose() * impulse_W_[c]);
  }
  if (StillCarries(h)) return;
  SolveParts(targets_, floor_, &out_->carried);
  for (size_t c = 0; c < held_.size(); ++c) {
    impulse_W_[c] = 2 * (frames_[c] * local_impulses_[c]);
    if (impulse_W_[c].norm() < settings_.tolerance * floor_ * LighterMass(held_[c]))
      impulse_W_[c].setZero();  // it does not press
  }
}

double Stepper::LighterMass(const Contact& contact) const {
  const Body &a = posed_[contact.body_a], &b = posed_[contact.body_b];
  return !a.Moves() ? b.mass : !b.Moves() ? a.mass : std::min(a.mass, b.mass);
}

// Whether the impulses at hand, those of the piece before, are an answer. It sinks nothing: what one piece sinks, the next sinks
// again. None are asked of the solver: what jams (Painleve) has an answer with impulses, too.
bool Stepper::StillCarries(double h) {
  if (std::all_of(impulse_W_.begin(), impulse_W_.end(), [](const Vector3& j) { return j.isZero(0); })) return false;
  trial_ = posed_;
  for (size_t c = 0; c < held_.size(); ++c) ApplyTo(held_[c], 0.5 * impulse_W_[c], &trial_);
  const double still = kSettled * settings_.tolerance * floor_;
  for (size_t c = 0; c < held_.size(); ++c) {
    const Vector3 u =
        RelativeVelocity(held_[c], trial_[held_[c].body_a], trial_[held_[c].body_b]) - targets_[c] * held_[c].normal_W;
    if (held_[c].normal_W.dot(u) < -kExact * Size({held_[c].body_a, held_[c].body_b}) / h) return false;
    if (!impulse_W_[c].isZero(0) && !Agrees(held_[c], impulse_W_[c], u, still)) return false;
  }
  return true;
}

// Whether a contact that slid would be thrown back by more than what forces make in the piece: friction jams it (Painleve), and
// stops it at once, however short the piece.
bool Stepper::Jams(double h) const {
  const double g = movers_ * std::max(pull_ * h, threshold_);
  for (size_t c = 0; c < held_.size(); ++c) {
    if (impulse_W_[c].isZero(0) || held_[c].friction == 0) continue;
    const int a = held_[c].body_a, b = held_[c].body_b;
    const Vector3& n = held_[c].normal_W;
    const Vector3 belt = SurfaceSlip(held_[c]);
    Vector3 before = state_[b].VelocityAt(held_[c].point_W) - state_[a].VelocityAt(held_[c].point_W) + belt;
    const Vector3 shift = end_state_[b].pose.position_W - state_[b].pose.position_W;
    const Vector3 at_end = group_->bodies[b].Moves() ? Vector3(held_[c].point_W + shift) : held_[c].point_W;
    Vector3 after = end_state_[b].VelocityAt(at_end) - end_state_[a].VelocityAt(at_end) + belt;
    before -= n.dot(before) * n;
    after -= n.dot(after) * n;
    if (before.dot(after) < 0 && after.norm() > kJam * (1 + held_[c].friction) * g) return true;
  }
  return false;
}

// Positions and velocities of centres.
void Stepper::MoveCentres(double h) {
  const std::vector<Body>& bodies = group_->bodies;
  for (size_t i = 0; i < bodies.size(); ++i)
    if (bodies[i].Moves())
      end_state_[i].linear_W = state_[i].linear_W + h * (settings_.gravity + bodies[i].force_W / bodies[i].mass);
  for (size_t c = 0; c < held_.size(); ++c) {
    const int a = held_[c].body_a, b = held_[c].body_b;
    if (bodies[a].Moves()) end_state_[a].linear_W -= impulse_W_[c] / bodies[a].mass;
    if (bodies[b].Moves()) end_state_[b].linear_W += impulse_W_[c] / bodies[b].mass;
  }
  for (size_t i = 0; i < bodies.size(); ++i) {
    if (!bodies[i].Moves()) continue;
    mean_W_[i] = 0.5 * (state_[i].linear_W + end_state_[i].linear_W);
    end_state_[i].pose.position_W = state_[i].pose.position_W + h * mean_W_[i];
    middle_[i].position_W = state_[i].pose.position_W + 0.5 * h * mean_W_[i];
  }
}

// Contacts between two bodies that turn in themselves, with their impulses, into the line of centres halfway, where a normal impulse
// spins neither. Whether any turned.
bool Stepper::TurnIntoLine() {
  bool turned = false;
  for (size_t c = 0; c < held_.size(); ++c) {
    Contact& contact = held_[c];
    if (impulse_W_[c].isZero(0) || !TurnInThemselves(held_of_[c].pair)) continue;
    const Vector3 line = (middle_[contact.body_b].position_W - middle_[contact.body_a].position_W).normalized();
    const Vector3& from = middle_[contact.body_a].position_W;
    const Vector3 place = contact.point_W + CentreHalfway(held_of_[c].pair) - held_of_[c].centre;
    contact.point_W += from + line.dot(place - from) * line - place;
    if ((line - contact.normal_W).squaredNorm() < kRounding * kRounding) continue;
    impulse_W_[c] = Quaternion::FromTwoVectors(contact.normal_W, line) * impulse_W_[c];
    contact.normal_W = line;
    turned = true;
  }
  return turned;
}

// The piece under these impulses: parabolas, free turns, and half-way a kick to each angular momentum. Both bodies of a contact
// take their impulse at one point.
void Stepper::Fly(double h) {
  const std::vector<Body>& bodies = group_->bodies;
  for (int round = 0; round == 0 || (TurnIntoLine() && round < kLineRounds); ++round) MoveCentres(h);
  spin_gain_.assign(bodies.size(), Vector3::Zero());
  for (size_t i = 0; i < bodies.size(); ++i) {
    const Body& b = bodies[i];
    const State& s = state_[i];
    if (!b.Moves()) continue;
    turned_[i].rotation_WB =
        Turned(FreeRotation(b.inertia_B, s.pose.rotation_WB, s.angular_W, 0.5 * h), s.pose.rotation_WB);
    spun_[i] = AngularVelocityAfter(b.inertia_B, s.pose.rotation_WB, s.angular_W, turned_[i].rotation_WB);
    spin_gain_[i] = h * b.torque_W;
  }
  PlaceWallsAt(time_of_piece_ + 0.5 * h, bodies, [&](size_t i, const Pose& pose) { middle_[i] = pose; });
  PlaceWallsAt(time_of_piece_ + h, bodies, [&](size_t i, const Pose& pose) { end_state_[i].pose = pose; });
  acted_at_.resize(held_.size());
  for (size_t c = 0; c < held_.size(); ++c) {
    const Contact& contact = held_[c];
    const int a = contact.body_a, b = contact.body_b;
    acted_at_[c] = contact.point_W + (CentreHalfway(held_of_[c].pair) - held_of_[c].centre);  // it moves along
    spin_gain_[a] -= (acted_at_[c] - middle_[a].position_W).cross(impulse_W_[c]);
    spin_gain_[b] += (acted_at_[c] - middle_[b].position_W).cross(impulse_W_[c]);
  }
  for (size_t i = 0; i < bodies.size(); ++i) {
    const Body& b = bodies[i];
    if (!b.Moves()) continue;
    const Quaternion& half = turned_[i].rotation_WB;
    spun_after_[i] = spin_gain_[i].isZero(0) ? spun_[i] : Vector3(spun_[i] + SpinOf(b, half, spin_gain_[i]));
    State& e = end_state_[i];
    e.pose.rotation_WB = Turned(FreeRotation(b.inertia_B, half, spun_after_[i], 0.5 * h), half);
    e.angular_W = AngularVelocityAfter(b.inertia_B, half, spun_after_[i], e.pose.rotation_WB);
    const Vector3 turn = Log(e.pose.rotation_WB * state_[i].pose.rotation_WB.conjugate());
    middle_[i].rotation_WB = Turned(0.5 * turn, state_[i].pose.rotation_WB);
  }
}

Path Stepper::PathOf(int i, double h) const {
  const Body& b = group_->bodies[i];
  const Shape& shape = *group_->shapes[i];
  const State &s = state_[i], &e = end_state_[i];
  if (!b.Moves())
    return {s.pose, b.linear_velocity_W, Vector3::Zero(), b.angular_velocity_W, Vector3::Zero(), BodyRadius(i)};
  // By its mean velocity: that at the end may be the one after a blow.
  return PathThrough(s.pose, s.linear_W, (mean_W_[i] - s.linear_W) / h, VisibleSpinOf(i),
                     VisibleRotation(shape, s.pose.rotation_WB, e.pose.rotation_WB), h, BodyRadius(i));
}

// [s] of the first blow within the piece, h if there is none.
double Stepper::FindMeeting(double h) {
  double first = h;
  cut_pair_ = -1;
  returned_ = guarded_ = met_ = false;
  for (size_t p = 0; p < group_->pairs.size(); ++p) {
    if (yields_[p] > 0) continue;
    const GroupPair& pair = group_->pairs[p];
    const bool stays = Touches(static_cast<int>(p)) && freed_[p] == kStays;
    // An overlap by what was not met gets no deeper, or bounces of fine steps sink. A deeper one is that of a pair that gave way.
    const double sunk_by = -GapBefore(static_cast<int>(p)) / Size(pair);
    const bool sunk = sunk_by > 0.5 * kTouching && sunk_by < kDeep;
    const MeetingQuery query = WayOf(static_cast<int>(p), h, first, GapOfBlow(static_cast<int>(p)),
                                     stays  ? kNear
                                     : sunk ? kExact
                                            : 0.5 * kTouching);
    const Path &a = query.path_a, &b = query.path_b;
    if (query.Farthest() < std::max(0.5 * query.deep, Apart(pair, state_))) continue;
    double t = First(query);
    if (t >= first) continue;
    if (!MetInABlow(query, static_cast<int>(p), &t) ||
        static_cast<int>(p) == grazing_) {  // too slow: it carries when it is there
      met_ = true;
      if (freed_[p] == kLeaves) freed_[p] = kReturns, returned_ = true;
      Guard(static_cast<int>(p), t, a, b);
      continue;
    }
    first = t;
    cut_pair_ = static_cast<int>(p);
  }
  return first;
}

// Whether a pair that is too deep at t met in a blow. What its way bends by from there on, by weight or by a turn, is no speed of the
// blow: t goes back to where what is fast was as deep as the piece found it, and the contacts there are in probe_. A rebound that comes
// back before it is open was none.
bool Stepper::MetInABlow(const MeetingQuery& query, int number, double* t) {
  const GroupPair& pair = group_->pairs[number];
  const double closed = kExact * Size(pair);
  for (int round = 0; round < kHalvings; ++round) {
    ++work_;
    probe_.clear();
    const Pose at_a = query.path_a.At(*t), at_b = query.path_b.At(*t);
    CollideShapes(*query.a, at_a.placement(), *query.b, at_b.placement(), 4 * kNear * Size(pair), &probe_);
    double fastest = 0, back = 0;
    for (Contact& c : probe_) {
      Mix(pair, &c);
      const auto velocity = [&](const Path& path, const Pose& at) -> Vector3 {
        return path.VelocityAt(*t) + path.RateAt(*t).cross(c.point_W - at.position_W);
      };
      const double approach = -c.normal_W.dot(velocity(query.path_b, at_b) - velocity(query.path_a, at_a));
      if (approach <= std::max(fastest, CutSpeed(c))) continue;
      fastest = approach;
      back = std::max(0.0, query.gap - c.gap) / approach;
    }
    if (fastest * back <= closed || *t == 0)
      return fastest > 0 && (freed_[number] == kHits || 0.25 * fastest * *t > closed);
    *t = std::max(0.0, *t - back);
  }
  return true;
}

double Stepper::First(const MeetingQuery& query) {
  const std::int64_t before = meeting_.looks();
  const double first = meeting_.First(query);
  work_ += static_cast<int>(meeting_.looks() - before);
  return first;
}

// The query of a pair's way in the piece.
MeetingQuery Stepper::WayOf(int number, double h, double until, double gap, double deep) const {
  const GroupPair& pair = group_->pairs[number];
  return {group_->shapes[pair.a], group_->shapes[pair.b], PathOf(pair.a, h), PathOf(pair.b, h), until, gap,
          deep * Size(pair)};
}

// Whether some pair is so deep in each other on its way that it may come out on another side. What hits slowly is stopped over the
// whole piece, and overlaps for a while by less.
bool Stepper::WayIsBarred(double h) {
  for (size_t p = 0; p < group_->pairs.size(); ++p) {
    if (yields_[p] > 0) continue;
    const int pair = static_cast<int>(p);
    const MeetingQuery way = WayOf(pair, h, h, GapBefore(pair), kThrough);
    if (way.Farthest() > 0.5 * way.deep && First(way) < h) return true;
  }
  return false;
}

// A pair that meets within the piece carries at the plane in which it does, through what is nearest then. Its gap is that which
// these points have where the piece begins.
void Stepper::Guard(int number, double t, const Path& a, const Path& b) {
  for (const Guarded& guard : guard_of_)
    if (guard.pair == number) return;
  const Pose at_a = a.At(t), at_b = b.At(t);
  for (Contact c : probe_) {
    const auto at_start = [&](const Vector3& point, const Pose& now, const Path& path) -> Vector3 {
      return path.start.position_W + path.start.rotation_WB * (now.rotation_WB.conjugate() * (point - now.position_W));
    };
    const Vector3 half = 0.5 * c.gap * c.normal_W;
    const double gap = c.normal_W.dot(at_start(c.point_W + half, at_b, b) - at_start(c.point_W - half, at_a, a));
    const Vector3 with_a = c.point_W - (at_a.position_W - a.start.position_W),
                  with_b = c.point_W - (at_b.position_W - b.start.position_W);
    c.body_a = group_->pairs[number].a;
    c.body_b = group_->pairs[number].b;
    c.point_W = Shared(number, with_a, with_b);
    guards_.push_back(c);
    guard_of_.push_back({number, gap});
    guarded_ = true;
  }
}

// Ends the piece earlier, under the same forces.
void Stepper::EndAt(double at, double* h) {
  for (Vector3& impulse : impulse_W_) impulse *= at / *h;
  *h = at;
  Fly(at);
}

// The piece ends at the blow: secant steps from the moment found towards the gap that the pair had at the start, 0 as a rule, as
// long as they get nearer.
double Stepper::Shorten(double h, double moment) {
  const GroupPair& pair = group_->pairs[cut_pair_];
  const double before = GapOfBlow(cut_pair_), whole = h;
  double at = std::max(moment, 1e-9 * dt_), best = at, nearest = kFar;
  for (int k = 0; k < 6; ++k) {
    EndAt(at, &h);
    probe_.clear();
    CollideShapes(*group_->shapes[pair.a], end_state_[pair.a].pose.placement(), *group_->shapes[pair.b],
                  end_state_[pair.b].pose.placement(), 1e-2 * Size(pair), &probe_);
    double gap = kFar, approach = 0;
    for (Contact& c : probe_) {  // of what hits; other corners of the pair may rest
      Mix(pair, &c);
      const double speed =
          -c.normal_W.dot(end_state_[pair.b].VelocityAt(c.point_W) - end_state_[pair.a].VelocityAt(c.point_W));
      if (c.gap < gap && speed > CutSpeed(c)) gap = c.gap, approach = speed;
    }
    gap -= before;
    if (std::abs(gap) >= nearest) break;
    nearest = std::abs(gap);
    best = at;
    if (nearest <= kExact * Size(pair)) break;
    at = std::clamp(at + gap / approach, 1e-9 * dt_, whole);
  }
  if (h != best) EndAt(best, &h);
  return h;
}

void Stepper::DetectEnd() {
  end_.clear();
  end_pair_.clear();
  for (size_t p = 0; p < group_->pairs.size(); ++p) {
    double reach = 4 * settings_.overlap_tolerance * Size(group_->pairs[p]);
    for (size_t c = 0; c < held_.size(); ++c) {
      if (held_of_[c].pair != static_cast<int>(p) || impulse_W_[c].isZero(0)) continue;
      const Moment from = held_of_[c].at_start ? Moment::kStart : Moment::kMiddle;
      const auto at_end = [&](int i) -> Vector3 { return CarriedWith(i, held_[c].point_W, from, Moment::kEnd); };
      const double parted = held_[c].normal_W.dot(at_end(held_[c].body_b) - at_end(held_[c].body_a));
      reach = std::max(reach, kNearby * Size(group_->pairs[p]) + std::abs(parted));
    }
    DetectPair(static_cast<int>(p), end_state_, reach, &end_, &end_pair_);
  }
  FollowHeld();
}

bool Stepper::Touches(int pair) const {
  for (size_t c = 0; c < now_.size(); ++c)
    if (now_pair_[c] == pair && now_[c].gap <= settings_.overlap_tolerance * Size(group_->pairs[pair])) return true;
  return false;
}

// [m] <= 0: overlap as the piece begins.
double Stepper::GapBefore(int pair) const {
  double gap = 0;
  for (size_t c = 0; c < now_.size(); ++c)
    if (now_pair_[c] == pair) gap = std::min(gap, now_[c].gap);
  return gap;
}

// Of the pair's overlap, what the piece takes back: where it shows, and the pair itself has paid for it.
double Stepper::PushOut(int pair) const {
  return pays_[pair] && GapBefore(pair) < -kTouching * Size(group_->pairs[pair]) ? kPushOut : 0;
}

// [m] <= 0: gap at which the pair meets. Where it bounces, an overlap too small to be met is none, or bounces would sink, one by one.
double Stepper::GapOfBlow(int pair) const {
  const double gap = GapBefore(pair);
  return freed_[pair] != kStays && gap > -0.5 * kTouching * Size(group_->pairs[pair]) ? 0 : gap;
}

// Of a size: overlap that the piece made.
double Stepper::FreshOverlap() const {
  double worst = 0;
  for (size_t c = 0; c < end_.size(); ++c)
    if (end_[c].gap < 0 && yields_[end_pair_[c]] == 0)
      worst = std::max(worst, (GapBefore(end_pair_[c]) - end_[c].gap) / Size(group_->pairs[end_pair_[c]]));
  return worst;
}

// The same since the step began.
double Stepper::DeepestSinceStart() const {
  double worst = 0;
  for (size_t c = 0; c < end_.size(); ++c)
    if (yields_[end_pair_[c]] == 0)
      worst = std::max(worst, (step_gap_[end_pair_[c]] - end_[c].gap) / Size(group_->pairs[end_pair_[c]]));
  return worst;
}

// Of a size: what the piece missed of gap(x1) = gap(x0), or >=, by.
double Stepper::Missed() const {
  double worst = 0;
  for (size_t e = 0; e < end_.size(); ++e) {
    const int pair = end_pair_[e];
    const double size = Size(group_->pairs[pair]), before = GapBefore(pair);
    if (end_[e].gap < 0 && yields_[pair] == 0 && !Hits(e)) worst = std::max(worst, (before - end_[e].gap) / size);
    const double rose = end_[e].gap - (1 - PushOut(pair)) * before;
    if (rose > 0 && !CarriedBy(e).isZero(0)) worst = std::max(worst, rose / size);
  }
  return worst;
}

// Whether normals at the start of the piece do not describe it: what presses passes an edge, or turns.
bool Stepper::NormalsMove() const {
  for (size_t c = 0; c < held_.size(); ++c) {
    if (impulse_W_[c].isZero(0)) continue;
    bool alike = false;
    for (size_t e = 0; e < end_.size() && !alike; ++e)
      alike = end_pair_[e] == held_of_[c].pair &&
              (end_[e].normal_W - held_[c].normal_W).squaredNorm() < kNormalMoves * kNormalMoves;
    if (!alike) return true;
  }
  return false;
}

// The same of levers: what presses turns, or slides on what moves.
bool Stepper::LeversMove(double h) const {
  for (size_t c = 0; c < held_.size(); ++c) {
    if (impulse_W_[c].isZero(0)) continue;
    const int a = held_[c].body_a, b = held_[c].body_b;
    for (const int i : {a, b}) {
      const bool moves = group_->bodies[i].Moves();
      if (moves && BodyRadius(i) == 0) continue;
      const Vector3& spin = moves ? spun_after_[i] : group_->bodies[i].angular_velocity_W;
      if (h * VisibleSpin(*group_->shapes[i], state_[i].pose.rotation_WB, spin).norm() > kNegligible) return true;
    }
    if (!group_->bodies[a].Moves() || !group_->bodies[b].Moves()) continue;
    const Vector3& n = held_[c].normal_W;
    const Vector3 slip = mean_W_[b] - mean_W_[a];
    const double lever = std::min(group_->bodies[a].radius, group_->bodies[b].radius);
    if (h * (slip - n.dot(slip) * n).norm() > kNegligible * lever) return true;
  }
  return false;
}

// Whether the contacts that are held are those of their pairs at the end, one by one.
bool Stepper::AllFollowed() const {
  for (size_t c = 0; c < follows_.size(); ++c)
    if (follows_[c] < 0 || std::count(follows_.begin(), follows_.end(), follows_[c]) > 1) return false;
  for (size_t e = 0; e < end_.size(); ++e)
    if (Presses(end_pair_[e]) && !WasHeld(e)) return false;
  return true;
}

// Where forces at hand move levers, and keep closed what they press, the first pass has levers of halfway on the course that these forces
// give. Returns whether it does.
bool Stepper::Foresee(double h) {
  if (std::all_of(impulse_W_.begin(), impulse_W_.end(), [](const Vector3& j) { return j.isZero(0); })) return false;
  Fly(h);
  cut_pair_ = -1;
  bool foresees = LeversMove(h);
  if (foresees) DetectEnd(), foresees = Missed() <= kDeep && AllFollowed();
  if (foresees) {
    foreseen_ = end_state_;
    NextTargets(h);
  } else {
    SelectHeld(h);
  }
  return foresees;
}

// Whether the course is another one than was foreseen, or the levers are not those of its middle.
bool Stepper::Strays() const {
  for (size_t i = 0; i < foreseen_.size(); ++i) {
    if (!group_->bodies[i].Moves()) continue;
    const Pose &now = end_state_[i].pose, &then = foreseen_[i].pose;
    const double turn = BodyRadius(static_cast<int>(i)) * Log(now.rotation_WB * then.rotation_WB.conjugate()).norm();
    if ((now.position_W - then.position_W).norm() + turn > kNegligible * group_->shapes[i]->size()) return true;
  }
  return false;
}

// Of the contacts at another time of the piece the one that this contact is; -1: none. The same feature is the same
// place only as far as the two bodies' points have parted, or as a piece may turn: the lowest point of a rim goes around it.
int Stepper::FindAt(int pair, const Contact& contact, Moment from, Moment to, std::span<const Contact> there) const {
  const auto [a, b] = group_->pairs[pair];
  const auto [first, last] = std::equal_range(there.begin(), there.end(), contact, EarlierPair);
  const Vector3 with_a = CarriedWith(a, contact.point_W, from, to), with_b = CarriedWith(b, contact.point_W, from, to);
  const double far = kSamePlace * Size(group_->pairs[pair]);
  const double around = kTurn * std::min(group_->bodies[a].radius, group_->bodies[b].radius);
  const double moved = std::max(around, far + 0.5 * (with_a - with_b).norm());
  const int found = FindAgain({first, last}, contact.feature, 0.5 * (with_a + with_b), moved, far);
  return found < 0 ? -1 : static_cast<int>(first - there.begin()) + found;
}

// Where a held contact is found again at the end: by its feature, or by its place, where faces take turns.
void Stepper::FollowHeld() {
  follows_.assign(held_.size(), -1);
  for (size_t c = 0; c < held_.size(); ++c) {
    const Moment from = held_of_[c].at_start ? Moment::kStart : Moment::kMiddle;
    follows_[c] = FindAt(held_of_[c].pair, held_[c], from, Moment::kEnd, end_);
  }
}

// A rotation that has the body where this pose has it, reached without a turn about its own axis.
Quaternion Stepper::SeenAs(int i, const Pose& pose) const {
  return VisibleRotation(*group_->shapes[i], state_[i].pose.rotation_WB, pose.rotation_WB);
}

// Where a place on the surface of a body, or of two, is at another time of the piece: round bodies show no turn in themselves.
Vector3 Stepper::CarriedWith(int i, const Vector3& point, Moment from, Moment to) const {
  const auto at = [&](Moment moment) -> const Pose& {
    return moment == Moment::kStart ? state_[i].pose : moment == Moment::kEnd ? end_state_[i].pose : middle_[i];
  };
  const Pose &x = at(from), &y = at(to);
  if (group_->shapes[i]->kind() == ShapeKind::kSphere) return point + y.position_W - x.position_W;
  return y.position_W + SeenAs(i, y) * (SeenAs(i, x).conjugate() * (point - x.position_W));
}

Vector3 Stepper::Carried(int pair, const Vector3& point, Moment from, Moment to) const {
  const auto [a, b] = group_->pairs[pair];
  return 0.5 * (CarriedWith(a, point, from, to) + CarriedWith(b, point, from, to));
}

bool Stepper::TurnInThemselves(int pair) const {
  const auto [a, b] = group_->pairs[pair];
  return BodyRadius(a) == 0 && BodyRadius(b) == 0 && group_->bodies[a].Moves() && group_->bodies[b].Moves();
}

// Of a body, in the piece as it is now.
Course Stepper::CourseOf(int i) const {
  const Body& b = group_->bodies[i];
  return {state_[i].pose,
          middle_[i],
          {end_state_[i].pose.position_W, SeenAs(i, end_state_[i].pose)},
          b.Moves() ? mean_W_[i] : b.linear_velocity_W,
          MeanSpin(i),
          BodyRadius(i) == 0,
          group_->shapes[i]->kind() == ShapeKind::kSphere};
}

// Of what the two bodies of a contact do, what the contact does.
Vector3 Stepper::Shared(int pair, const Vector3& of_a, const Vector3& of_b) const {
  const auto [a, b] = group_->pairs[pair];
  const double share =
      ShareOfA(group_->bodies[a].Moves(), BodyRadius(a) == 0, group_->bodies[b].Moves(), BodyRadius(b) == 0);
  return share * of_a + (1 - share) * of_b;
}

// [m] what a contact moves along with.
Vector3 Stepper::CentreAtStart(int pair) const {
  return Shared(pair, state_[group_->pairs[pair].a].pose.position_W, state_[group_->pairs[pair].b].pose.position_W);
}
Vector3 Stepper::CentreHalfway(int pair) const {
  return Shared(pair, middle_[group_->pairs[pair].a].position_W, middle_[group_->pairs[pair].b].position_W);
}

// Between these points of start and end, on the arc about each body's axis.
Vector3 Stepper::Halfway(int pair, const Vector3& start, const Vector3& end) const {
  return Shared(pair, OnArc(CourseOf(group_->pairs[pair].a), start, end),
                OnArc(CourseOf(group_->pairs[pair].b), start, end));
}

// The contact as the piece began, if it was closed.
const Contact* Stepper::ClosedAtStart(size_t at_end) const {
  const Contact& end = end_[at_end];
  const int found = FindAt(end_pair_[at_end], end, Moment::kEnd, Moment::kStart, now_);
  return found >= 0 && closed_[found] && now_[found].normal_W.dot(end.normal_W) > 0 ? &now_[found] : nullptr;
}

// [rad/s] of a body halfway.
Vector3 Stepper::MeanSpin(int i) const {
  const Body& b = group_->bodies[i];
  return b.Moves() ? Vector3(0.5 * (spun_[i] + spun_after_[i])) : b.angular_velocity_W;
}

// [m/s] of a body's point halfway.
Vector3 Stepper::MeanVelocity(int i, const Vector3& point) const {
  const Body& b = group_->bodies[i];
  return (b.Moves() ? mean_W_[i] : b.linear_velocity_W) + MeanSpin(i).cross(point - middle_[i].position_W);
}

// Contacts with targets that correct what the last pass left at the end. One that is closed all the time lies between where it
// begins and ends, so that levers are those of the chord along which its points move. One that closes within the piece is as it
// ends.
void Stepper::NextTargets(double h) {
  next_.clear();
  next_of_.clear();
  next_impulse_W_.clear();
  for (size_t e = 0; e < end_.size(); ++e) {
    if (Hits(e)) continue;
    Contact contact = end_[e];
    const int pair = end_pair_[e], a = contact.body_a, b = contact.body_b;
    const Contact* const start = ClosedAtStart(e);
    if (start) {
      contact.point_W = Halfway(pair, start->point_W, contact.point_W);
      const double turn = (contact.normal_W - start->normal_W).norm();
      contact.normal_W = (start->normal_W + contact.normal_W).normalized();
      TurnLever((contact.gap - start->gap) / h, turn, CourseOf(a), CourseOf(b), Size(group_->pairs[pair]), &contact);
    } else if (TurnInThemselves(pair)) {
      probe_.clear();  // what turns in itself takes no spin from a normal impulse: along the line halfway, it gets none
      CollideShapes(*group_->shapes[a], middle_[a].placement(), *group_->shapes[b], middle_[b].placement(), kFar,
                    &probe_);
      contact.point_W = probe_[0].point_W;
      contact.normal_W = probe_[0].normal_W;
    } else {
      contact.point_W -= Shared(pair, end_state_[a].pose.position_W - middle_[a].position_W,
                                end_state_[b].pose.position_W - middle_[b].position_W);
    }
    const double u = contact.normal_W.dot(MeanVelocity(b, contact.point_W) - MeanVelocity(a, contact.point_W));
    double target = u - (contact.gap - (1 - PushOut(pair)) * GapBefore(pair)) / h;
    target = yields_[pair] > 0 ? -yields_[pair] : std::min(target, kFastest * floor_);
    next_.push_back(contact);
    const double opens = start && yields_[pair] == 0 ? target - u + (contact.gap - start->gap) / h : target;
    next_of_.push_back({pair, CentreHalfway(pair), target, opens, 0, false});
    next_impulse_W_.push_back(WithinCone(contact, CarriedBy(e)));
  }
  // What pressed and is not found again stays for some passes, or they would go round between corners.
  for (size_t c = 0; c < held_.size(); ++c) {
    if (impulse_W_[c].isZero(0) || held_of_[c].age >= kAges || follows_[c] >= 0) continue;
    Held old = held_of_[c];
    ++old.age;
    Contact contact = held_[c];
    contact.point_W = acted_at_[c];
    const Moment at = old.at_start ? Moment::kStart : Moment::kMiddle;
    const auto way = [&](int i) -> Vector3 {
      return CarriedWith(i, held_[c].point_W, at, Moment::kEnd) - CarriedWith(i, held_[c].point_W, at, Moment::kStart);
    };
    const double parted = held_[c].normal_W.dot(way(contact.body_b) - way(contact.body_a));
    TurnLever(parted / h, 0, CourseOf(contact.body_a), CourseOf(contact.body_b), Size(group_->pairs[old.pair]),
              &contact);
    const Vector3 u = MeanVelocity(contact.body_b, contact.point_W) - MeanVelocity(contact.body_a, contact.point_W);
    old.target = old.opens + contact.normal_W.dot(u) - parted / h;
    old.at_start = false;
    old.centre = CentreHalfway(old.pair);
    next_.push_back(contact);
    next_of_.push_back(old);
    next_impulse_W_.push_back(impulse_W_[c]);
  }
  std::swap(held_, next_);
  std::swap(held_of_, next_of_);
  std::swap(impulse_W_, next_impulse_W_);
}

// [N s] what a contact at the end held in the piece.
Vector3 Stepper::CarriedBy(size_t at_end) const {
  Vector3 sum = Vector3::Zero();
  for (size_t c = 0; c < held_.size(); ++c)
    if (follows_[c] == static_cast<int>(at_end)) sum += impulse_W_[c];
  return sum;
}

bool Stepper::WasHeld(size_t at_end) const {
  return std::find(follows_.begin(), follows_.end(), static_cast<int>(at_end)) != follows_.end();
}

bool Stepper::Presses(int pair) const {
  for (size_t c = 0; c < held_.size(); ++c)
    if (held_of_[c].pair == pair && !impulse_W_[c].isZero(0)) return true;
  return false;
}

// The bodies of the contact problems, as they are at the end.
void Stepper::PoseAtEnd() {
  for (size_t i = 0; i < posed_.size(); ++i) {
    posed_[i].position_W = end_state_[i].pose.position_W;
    posed_[i].rotation_WB = end_state_[i].pose.rotation_WB;
    if (!posed_[i].Moves()) continue;
    posed_[i].linear_velocity_W = end_state_[i].linear_W;
    posed_[i].angular_velocity_W = end_state_[i].angular_W;
  }
}

// The impulses of contacts that still touch, redone at the end pose: what presses stays closed, what sticks stays. Contacts that
// hit are left to Strike.
void Stepper::Settle() {
  settle_W_.assign(end_.size(), Vector3::Zero());
  PoseAtEnd();
  problem_.clear();
  problem_of_.clear();
  carried_W_.clear();
  bool settled = true;
  const double still = kSettled * settings_.tolerance * floor_;
  for (size_t e = 0; e < end_.size(); ++e) {
    Vector3 carried = WithinCone(end_[e], CarriedBy(e));
    const double closed = !carried.isZero(0) ? kTouching : Presses(end_pair_[e]) || WasHeld(e) ? kMet : kExact;
    if (end_[e].gap > closed * Size(group_->pairs[end_pair_[e]])) continue;
    const Vector3 u = RelativeVelocity(end_[e], posed_[end_[e].body_a], posed_[end_[e].body_b]);
    const double normal = end_[e].normal_W.dot(u);
    if (carried.isZero(0) && WillHit(end_[e], normal)) continue;
    carried = TurnedAlong(end_[e], carried, u, still);
    settled = settled && (carried.isZero(0) ? normal >= -still : Agrees(end_[e], carried, u, still));
    problem_.push_back(end_[e]);
    problem_of_.push_back(static_cast<int>(e));
    carried_W_.push_back(carried);
  }
  if (settled) return;
  local_impulses_.resize(problem_.size());
  for (size_t c = 0; c < problem_.size(); ++c) {
    ApplyTo(problem_[c], -carried_W_[c], &posed_);
    local_impulses_[c] = ContactFrame(problem_[c].normal_W).transpose() * carried_W_[c];
  }
  targets_.resize(problem_.size());
  for (size_t c = 0; c < problem_.size(); ++c) targets_[c] = -yields_[end_pair_[problem_of_[c]]];
  SolveParts(targets_, floor_, &out_->settled);
  for (size_t c = 0; c < problem_.size(); ++c)
    settle_W_[problem_of_[c]] = frames_[c] * local_impulses_[c] - carried_W_[c];
  ApplyAtEnd(settle_W_);
}

// Velocities follow from the impulses, not from the solver that found them.
void Stepper::ApplyAtEnd(std::span<const Vector3> impulses_W) {
  PoseAtEnd();
  for (size_t e = 0; e < end_.size(); ++e)
    if (!impulses_W[e].isZero(0)) ApplyTo(end_[e], impulses_W[e], &posed_);
  for (size_t i = 0; i < posed_.size(); ++i) {
    if (!posed_[i].Moves()) continue;
    end_state_[i].linear_W = posed_[i].linear_velocity_W;
    end_state_[i].angular_W = posed_[i].angular_velocity_W;
  }
}

// Near enough to a blow to take part in it.
bool Stepper::IsThere(size_t at_end) const {
  return end_[at_end].gap <= kTogether * Size(group_->pairs[end_pair_[at_end]]);
}

// Whether a contact is a blow where the piece ends: it strikes now, or when the next one begins, and carries nothing. What a push
// of the piece threw against it does not strike: Settle stops that.
bool Stepper::Hits(size_t at_end) const {
  const Contact& c = end_[at_end];
  if (yields_[end_pair_[at_end]] > 0 || !CarriedBy(at_end).isZero(0) || (cut_pair_ < 0 && ClosedAtStart(at_end)))
    return false;
  const Vector3 now = end_state_[c.body_a].VelocityAt(c.point_W) - end_state_[c.body_b].VelocityAt(c.point_W);
  const Vector3 on_the_way = MeanVelocity(c.body_a, c.point_W) - MeanVelocity(c.body_b, c.point_W);
  return std::min(c.normal_W.dot(now), c.normal_W.dot(on_the_way)) > CutSpeed(c);
}

// Whether something hit before the piece ends, on the way that a pass has changed.
bool Stepper::HitsEarlier() const {
  for (size_t e = 0; e < end_.size(); ++e)
    if (end_[e].gap < GapBefore(end_pair_[e]) && Hits(e)) return true;
  return false;
}

bool Stepper::HasMet(int pair) const {
  for (size_t e = 0; e < end_.size(); ++e)
    if (end_pair_[e] == pair && IsThere(e)) return true;
  return false;
}

// Blows at the end pose: the queue, then the collision problem.                                     [SM04 Fig. 1, 1 and 2]
void Stepper::Strike() {
  problem_.clear();
  problem_of_.clear();
  bool strikes = false;
  for (size_t e = 0; e < end_.size(); ++e) {
    if (end_[e].gap > settings_.overlap_tolerance * Size(group_->pairs[end_pair_[e]])) continue;
    const double approach = -NormalVelocity(end_[e], posed_[end_[e].body_a], posed_[end_[e].body_b]);
    const bool hits = approach > CutSpeed(end_[e]) && yields_[end_pair_[e]] == 0;
    if (hits && !IsThere(e)) continue;
    problem_.push_back(end_[e]);
    problem_of_.push_back(static_cast<int>(e));
    strikes = strikes || hits;
  }
  if (!strikes) return;
  PartProblem();
  const double least_rebound = pull_ > 0 ? least_rebound_ : 0;
  bounces_.assign(problem_.size(), Vector3::Zero());
  local_impulses_.assign(problem_.size(), Vector3::Zero());
  for (int island = 0; island < partition_.num_islands(); ++island) {
    const IslandView view{partition_.bodies_of(island), partition_.contacts_of(island)};
    if (view.contacts.empty()) continue;
    const ContactFrames contacts{problem_, frames_};
    out_->bounces += sequential_.Resolve(view.bodies, view.contacts, contacts, settings_.bounce_law,
                                         {threshold_, settings_.bounce_limit, true, least_rebound}, posed_, bounces_);
    for (const int c : view.contacts) {
      const double approach = -NormalVelocity(problem_[c], posed_[problem_[c].body_a], posed_[problem_[c].body_b]);
      if (ReboundSpeed(problem_[c], approach, least_rebound) == 0) problem_[c].restitution = 0;
    }
    out_->struck.push_back(
        responder_.ResolveCollisions(view, contacts, settings_, floor_, threshold_, posed_, local_impulses_));
    Record(Stage::kCollision, out_->struck.back().status);
    out_->restitution_lowered |= out_->struck.back().restitution_lowered;
  }
  ++out_->blows;
  for (size_t c = 0; c < problem_.size(); ++c) {
    strike_W_[problem_of_[c]] = frames_[c] * (bounces_[c] + local_impulses_[c]);
    const double approach = -NormalVelocity(problem_[c], posed_[problem_[c].body_a], posed_[problem_[c].body_b]);
    double& yields = yields_[end_pair_[problem_of_[c]]];
    if (approach > CutSpeed(problem_[c])) yields = std::max(yields, approach);
  }
  ApplyAtEnd(strike_W_);
}

// [J] of a body, its height counted from where the step began.
double Stepper::EnergyOf(int i, const State& s) const {
  const Body& b = group_->bodies[i];
  return 0.5 * b.mass * s.linear_W.squaredNorm() +
         0.5 * s.angular_W.dot(AngularMomentum(b, s.pose.rotation_WB, s.angular_W)) -
         (b.mass * settings_.gravity + b.force_W).dot(s.pose.position_W - b.position_W);
}

// What the piece gave to those who did something to each other, beyond the work of torques and of walls that move; what they had;
// and what they may gain: of that, what solves of this accuracy leave, and what heights are rounded by.
void Stepper::KeepAccounts(double h) {
  const std::vector<Body>& bodies = group_->bodies;
  accounts_.assign(bodies.size(), {});
  edges_.clear();
  for (size_t i = 0; i < bodies.size(); ++i) {
    const Body& b = bodies[i];
    if (!b.Moves()) continue;
    const State& s = state_[i];
    accounts_[i].gain = EnergyOf(static_cast<int>(i), end_state_[i]) - EnergyOf(static_cast<int>(i), s) -
                        0.5 * h * b.torque_W.dot(spun_[i] + spun_after_[i]);
    accounts_[i].at_hand = 0.5 * b.mass * (s.linear_W.squaredNorm() + floor_ * floor_) +
                           0.5 * s.angular_W.dot(AngularMomentum(b, s.pose.rotation_WB, s.angular_W));
    accounts_[i].allowed = kGain * accounts_[i].at_hand + kPositionRounding * b.mass * pull_ * s.pose.position_W.norm();
  }
  const auto act = [&](const Contact& contact, const Vector3& point, const Vector3& impulse, bool at_end) {
    if (impulse.isZero(0)) return;
    const int a = contact.body_a, b = contact.body_b, mover = bodies[a].Moves() ? a : b;
    accounts_[mover].allowed += kLeft * settings_.tolerance * floor_ * impulse.norm();
    for (const int i : {a, b}) {
      const Body& wall = bodies[i];
      if (wall.kind != BodyKind::kKinematic) continue;
      const Vector3& centre = at_end ? end_state_[i].pose.position_W : middle_[i].position_W;
      const double work = impulse.dot(wall.linear_velocity_W + wall.angular_velocity_W.cross(point - centre));
      accounts_[mover].gain += (i == b ? 1 : -1) * work;
      accounts_[mover].allowed += 10 * kPositionRounding * std::abs(work);
    }
    accounts_[mover].gain += impulse.dot(SurfaceSlip(contact));  // what drives a belt works on what it carries
    edges_.emplace_back(a, b);
  };
  for (size_t c = 0; c < held_.size(); ++c) act(held_[c], acted_at_[c], impulse_W_[c], false);
  FindWork();
  for (size_t p = 0; p < work_of_.size(); ++p) {  // what pushes an overlap out was paid before
    const GroupPair& pair = group_->pairs[p];
    if (PushOut(static_cast<int>(p)) > 0)
      accounts_[bodies[pair.a].Moves() ? pair.a : pair.b].allowed +=
          std::clamp(work_of_[p], 0.0, std::max(0.0, purse_[p]));
  }
  for (size_t e = 0; e < end_.size(); ++e) {
    act(end_[e], end_[e].point_W, settle_W_[e], true);
    act(end_[e], end_[e].point_W, strike_W_[e], true);
  }
  islands::BuildPartition({cut_, edges_}, &partition_);
  gains_ = creates_ = loses_ = false;
  for (int island = 0; island < partition_.num_islands(); ++island) {
    Account sum;
    for (const int i : partition_.bodies_of(island)) {
      sum.gain += accounts_[i].gain;
      sum.at_hand += accounts_[i].at_hand;
      sum.allowed += accounts_[i].allowed;
    }
    gains_ = gains_ || sum.gain > sum.allowed;
    creates_ = creates_ || sum.gain > sum.allowed + Ledger::kMostEnergy * sum.at_hand;
    loses_ = loses_ || sum.gain < -kStopped * sum.at_hand;
  }
}

// [J] per pair: work of what carried in the piece.
void Stepper::FindWork() {
  work_of_.assign(group_->pairs.size(), 0.0);
  for (size_t c = 0; c < held_.size(); ++c)
    work_of_[held_of_[c].pair] +=
        impulse_W_[c].dot(MeanVelocity(held_[c].body_b, acted_at_[c]) - MeanVelocity(held_[c].body_a, acted_at_[c]) +
                          SurfaceSlip(held_[c]));
}

// Which pairs took more in the step, by friction and where they sank, than a piece of this length would give them for their overlap.
// What one took another may have given: all that did something to each other in the step must have taken as much together.
void Stepper::SeeWhoPays(double h) {
  costs_.assign(group_->pairs.size(), 0.0);
  for (size_t c = 0; c < held_.size(); ++c) {
    const int pair = held_of_[c].pair;
    costs_[pair] -= held_[c].normal_W.dot(impulse_W_[c]) * kPushOut * GapBefore(pair) / h;
  }
  edges_.clear();
  problem_of_.clear();
  for (size_t p = 0; p < costs_.size(); ++p) {
    taken_[p] -= work_of_[p];
    if (taken_[p] == 0) continue;
    edges_.emplace_back(group_->pairs[p].a, group_->pairs[p].b);
    problem_of_.push_back(static_cast<int>(p));
  }
  pays_.assign(costs_.size(), false);
  if (edges_.empty()) return;
  islands::BuildPartition({cut_, edges_}, &partition_);
  for (int island = 0; island < partition_.num_islands(); ++island) {
    double taken = 0, costs = 0;
    for (const int e : partition_.contacts_of(island)) {
      const int p = problem_of_[e];
      taken += taken_[p];
      if (taken_[p] > costs_[p]) costs += costs_[p];
    }
    for (const int e : partition_.contacts_of(island)) {
      const int p = problem_of_[e];
      pays_[p] = taken_[p] > costs_[p] && taken > costs;
      purse_[p] = std::min(taken_[p], taken);
    }
  }
}

// Whether any overlap was pushed out.
bool Stepper::Pushed() const {
  for (size_t p = 0; p < pays_.size(); ++p)
    if (PushOut(static_cast<int>(p)) > 0) return true;
  return false;
}

void Stepper::Commit(double t, double h) {
  carried_at_.assign(end_.size(), -1);
  last_ = end_;
  for (size_t c = 0; c < held_.size(); ++c) {
    if (impulse_W_[c].isZero(0)) continue;
    Contact contact = held_[c];
    contact.point_W = acted_at_[c];
    if (follows_[c] >= 0) {
      carried_at_[follows_[c]] = static_cast<int>(out_->impulses.size());
      // What carried is remembered where it did. Of two edges that are all but parallel detection finds now this point and now that one,
      // and what rests would not balance.
      last_[follows_[c]].point_W = Carried(held_of_[c].pair, acted_at_[c], Moment::kMiddle, Moment::kEnd);
    }
    out_->impulses.push_back({contact, impulse_W_[c], t, h});
  }
  force_W_.resize(end_.size());
  for (size_t e = 0; e < end_.size(); ++e) {
    force_W_[e] = (CarriedBy(e) + settle_W_[e]) / h;
    if (!settle_W_[e].isZero(0)) out_->impulses.push_back({end_[e], settle_W_[e], t + h, 0, carried_at_[e]});
    if (!strike_W_[e].isZero(0)) out_->impulses.push_back({end_[e], strike_W_[e], t + h, 0});
  }
  if (out_->record_paths) {
    out_->ends.push_back(t + h);
    for (int i = 0; i < static_cast<int>(state_.size()); ++i) out_->paths.push_back(PathOf(i, h));
  }
  state_ = end_state_;
  now_ = end_;
  now_pair_ = end_pair_;
}

void Stepper::Step(double dt, const Settings& settings, const MixMaterial& mix, Group* group, GroupOutcome* outcome) {
  dt_ = dt;
  settings_ = settings;
  mix_ = &mix;
  group_ = group;
  out_ = outcome;
  double fastest = 0;
  for (const Body& b : group->bodies)
    if (b.Moves()) fastest = std::max(fastest, FastestPoint(TwistOf(b), b.radius));
  pull_ = settings.gravity.norm();
  for (const Body& b : group->bodies) {
    if (!b.Moves() || (b.force_W.isZero(0) && b.torque_W.isZero(0))) continue;
    pull_ = std::max(
        pull_, (settings.gravity + b.force_W / b.mass).norm() + b.radius * SpinOf(b, b.rotation_WB, b.torque_W).norm());
  }
  floor_ = std::max({pull_ * dt, 1e-3 * fastest, 1e-12});
  threshold_ = 10 * settings.tolerance * floor_;
  movers_ = 0;
  for (const Body& b : group->bodies) movers_ += b.Moves();
  blow_budget_ = std::max(kLeastBlows, kBlowWork / std::max(1, movers_));
  least_rebound_ = 0.5 * kBrief * pull_ * dt / blow_budget_;
  LoadState();
  FindTouching();
  Recall();
  step_gap_.resize(group->pairs.size());
  for (size_t p = 0; p < group->pairs.size(); ++p) step_gap_[p] = GapBefore(static_cast<int>(p));
  cuts_ = work_ = 0;
  yields_.assign(group->pairs.size(), 0.0);
  grazing_ = -1;
  pays_.assign(group->pairs.size(), false);
  taken_.assign(group->pairs.size(), 0.0);
  purse_.assign(group->pairs.size(), 0.0);
  bool jammed = false, instant = false, stopped = false;
  double t = 0, most = dt;
  for (int level = 0; dt - t > 1e-12 * dt;) {
    ++out_->pieces;
    if (work_ > group->most_work) {
      out_->unstepped = dt - t;
      break;
    }
    work_ += kSolveWork + static_cast<int>(group->pairs.size());
    time_of_piece_ = t;
    PlaceWallsAt(t, group->bodies, [&](size_t i, const Pose& pose) { state_[i].pose = pose; });
    double h = ChooseLength(std::min(dt - t, most));
    if (dt - t - h < 0.2 * h) h = std::min(dt - t, 1.2 * h);
    freed_.assign(group->pairs.size(), kStays);
    double moment = h;
    bool foresaw = false;
    guards_.clear();
    guard_of_.clear();
    for (int round = 0; round < kGuardRounds; ++round) {
      SelectHeld(h);
      for (size_t g = 0; g < guards_.size(); ++g) {
        const int pair = guard_of_[g].pair;
        const double target = ((1 - PushOut(pair)) * GapBefore(pair) - guard_of_[g].gap) / h;
        held_.push_back(guards_[g]);
        held_of_.push_back({pair, CentreAtStart(pair), target, target});
        impulse_W_.push_back(Vector3::Zero());
      }
      foresaw = guards_.empty() && Foresee(h);
      Carry(h, !foresaw);
      Fly(h);
      moment = FindMeeting(h);
      if (!returned_ && (!guarded_ || moment < h)) break;
    }
    bool cut = moment < h;
    if (!jammed && !instant && !stopped && Jams(h)) {
      instant = true;
      most = kInstant * h;
      continue;
    }
    if (cut) h = Shorten(h, moment);
    DetectEnd();
    double missed = Missed();
    const bool moves = foresaw && !cut ? Strays() : LeversMove(h) || NormalsMove();
    bool redone = met_;  // what is on the way was left to what carries, or the way is not the one that was searched
    bool deep = false;
    int blows = out_->blows, pass = 1;
    for (double enough = kTouching;;
         enough = kExact) {  // what gaps miss is work: where that is too much, they miss less
      while (pass < kPasses && (missed > enough || (pass == 1 && moves))) {
        ++out_->passes;
        redone = true;
        NextTargets(h);
        Carry(h, false);
        Fly(h);
        DetectEnd();
        if (!cut && HitsEarlier() && (moment = FindMeeting(h)) < h) {
          cut = true;
          h = Shorten(h, moment);
          DetectEnd();
        }
        const double before = std::exchange(missed, Missed());
        const bool stalls =
            pass > 1 && missed > kDeep && missed > kNearer * before;  // a shorter piece gets there sooner
        pass = stalls ? kPasses : pass + 1;
      }
      deep = std::max(FreshOverlap(), DeepestSinceStart()) > kDeep || (redone && WayIsBarred(h));
      if (deep && level < kLevels) break;
      Settle();
      blows = out_->blows;
      strike_W_.assign(end_.size(), Vector3::Zero());
      if (cut) Strike();
      KeepAccounts(h);
      if (!gains_ || missed <= kExact || pass >= kPasses) break;
    }
    if (deep && level < kLevels) {
      ++level;
      ++out_->halvings;
      most = 0.5 * h;
      continue;
    }
    if (gains_ && Pushed()) {  // it cost more than that: not now
      pays_.assign(group->pairs.size(), false);
      continue;
    }
    const bool yields = std::any_of(yields_.begin(), yields_.end(), [](double y) { return y > 0; });
    if (gains_ && level < kLevels && !yields) {
      ++level;
      ++out_->halvings;
      most = 0.5 * h;
      continue;
    }
    if (deep || (creates_ && !yields)) {  // no way on: they stay where they are for the rest of the step
      out_->unstepped = dt - t;
      break;
    }
    Commit(t, h);
    t += h;
    cuts_ += cut;
    jammed = jammed || (instant && !loses_);  // nothing was stopped: a false alarm, not to be given again
    stopped = std::exchange(instant, false);
    SeeWhoPays(h);
    grazing_ = cut && out_->blows == blows && HasMet(cut_pair_) ? cut_pair_ : -1;
    most = level == 0 ? dt : stopped ? h / kInstant : 2 * h;
    level = std::max(0, level - 1);
  }
  outcome->touching.clear();
  outcome->touching_force_W.clear();
  outcome->overlap = 0;
  for (size_t c = 0; c < now_.size(); ++c) {
    outcome->touching.push_back(out_->unstepped == 0 ? last_[c] : now_[c]);
    outcome->touching_force_W.push_back(force_W_[c]);
    outcome->overlap = std::max(outcome->overlap, -now_[c].gap);
  }
  outcome->overlapping = CountOverlapping(outcome->touching, [&](const Contact& c) {
    return Size({c.body_a, c.body_b});
  });
  for (size_t i = 0; i < group->bodies.size(); ++i) {
    Body& b = group->bodies[i];
    if (!b.Moves()) continue;
    b.position_W = state_[i].pose.position_W;
    b.rotation_WB = state_[i].pose.rotation_WB;
    b.linear_velocity_W = state_[i].linear_W;
    b.angular_velocity_W = state_[i].angular_W;
  }
}

}  // namespace islet::motion
