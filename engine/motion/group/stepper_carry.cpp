// In: contacts where a piece begins, or where a pass ended. Out: which of them carry, and their impulses.
#include "engine/motion/group/stepper.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "engine/response/suite_frame.h"
#include "qp/smallness.h"

namespace islet::motion {
namespace {

constexpr int kAges = 2;  // passes for which a contact that pressed, and is not found again, stays

}  // namespace

// What of a pair of faces is there at the end of the piece, if both bodies go on as they do and one slides over the other. There a contact stays
// at the edge of one, or goes with a corner of the other.
void Stepper::LookAhead(int number, double h) {
  ahead_.clear();
  const auto [a, b] = group_->pairs[number];
  const Shape &of_a = *group_->shapes[a], &of_b = *group_->shapes[b];
  const auto flat = [](const Shape& s) { return s.kind() != ShapeKind::kSphere && !s.HasAxis(); };
  const double way = h * (state_[b].linear_W - state_[a].linear_W).norm();
  if (!flat(of_a) || !flat(of_b) || way <= kTouching * Size(group_->pairs[number])) return;
  const auto at_end = [&](int i) -> Placement {
    const State& s = state_[i];
    return Pose{s.pose.position_W + h * s.linear_W, Turned(h * s.angular_W, s.pose.rotation_WB)}.placement();
  };
  CollideShapes(of_a, at_end(a), of_b, at_end(b), Size(group_->pairs[number]), &ahead_);
  ++work_;
}

// A contact of the start of the piece, with the lever that it has halfway if its bodies go on as they do.
void Stepper::Hold(int pair, double target, bool faces_a, bool faces_b, const Contact& contact,
                   const Vector3& impulse_W, double h) {
  const auto [a, b] = group_->pairs[pair];
  held_.push_back(contact);
  held_.back().point_W = Shared(contact, PointAhead(a, contact, h), PointAhead(b, contact, h));
  const Vector3 slip_W = WallSlip(contact, group_->bodies, off_, ways_);
  held_.back().surface_W += slip_W;
  held_of_.push_back(
      {pair, Vector3::Zero(), target - contact.normal_W.dot(slip_W), target, contact.surface_W, faces_a, faces_b});
  impulse_W_.push_back(impulse_W);
}

// Contacts that may carry: what touches and does not leave. What is open carries where bodies meet (Guard), not where they are near:
// a ball that rolls over an edge is near it, and never meets it.
void Stepper::SelectHeld(double h) {
  held_.clear();
  held_of_.clear();
  impulse_W_.clear();
  closed_.assign(now_.size(), false);
  off_ = OffAhead(h);
  for (size_t i = 0; i < ways_.size(); ++i) ways_[i].mean_W = state_[i].linear_W;
  Foresee(h, settings_.gravity, group_->bodies, now_, force_W_, ways_);
  int looked_at = -1;
  for (size_t c = 0; c < now_.size(); ++c) {
    const Contact& contact = now_[c];
    const GroupPair& pair = group_->pairs[now_pair_[c]];
    if (contact.gap > settings_.overlap_tolerance * Size(pair)) continue;
    const double opening =
        contact.normal_W.dot(state_[pair.b].VelocityAt(contact.point_W) - state_[pair.a].VelocityAt(contact.point_W));
    if (WillHit(contact, opening) && yields_[now_pair_[c]] == 0) {
      if (freed_[now_pair_[c]] != kReturns) freed_[now_pair_[c]] = kHits;
      continue;
    }
    if (opening > (pull_ > 0 ? LeastRebound(contact) : threshold_) && freed_[now_pair_[c]] != kReturns) {
      if (freed_[now_pair_[c]] != kHits) freed_[now_pair_[c]] = kLeaves;  // its other side may hit
      continue;
    }
    const Vector3 guess = h * force_W_[c];
    if (guess.isZero(0) && contact.gap > ClosedGap(now_pair_[c])) continue;
    closed_[c] = true;
    if (now_pair_[c] != looked_at) LookAhead(looked_at = now_pair_[c], h);
    const double yields = yields_[now_pair_[c]];
    const double gap =
        contact.gap > kTouching * Size(pair) ? contact.gap : PushOut(now_pair_[c]) * std::min(0.0, contact.gap);
    Hold(now_pair_[c], yields > 0 ? -yields : -gap / h,
         FacesAxis(*group_->shapes[pair.a], state_[pair.a].pose, contact),
         FacesAxis(*group_->shapes[pair.b], state_[pair.b].pose, contact), contact, WithinCone(contact, guess), h);
    const double most = 2 * h * (state_[pair.b].linear_W - state_[pair.a].linear_W).norm();
    const Vector3 with_a = contact.point_W + h * state_[pair.a].VelocityAt(contact.point_W);
    const int there = FindAgain(ahead_, contact.feature, with_a, most, 0);
    if (there >= 0) held_.back().point_W = 0.5 * (contact.point_W + ahead_[there].point_W);
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
  const std::vector<Body>& bodies = group_->bodies;
  for (size_t i = 0; i < bodies.size(); ++i) {
    const Body& b = bodies[i];
    if (!b.Moves()) continue;
    const State& s = state_[i];
    turned_[i] = TurnFreely(b, s.pose.rotation_WB, s.angular_W, 0.5 * h);
    Body& p = posed_[i];
    p.position_W = first ? CentreAhead(static_cast<int>(i), h) : middle_[i].position_W;
    p.rotation_WB = turned_[i].rotation_WB;
    p.linear_velocity_W = s.linear_W + 0.5 * h * (settings_.gravity + b.force_W / b.mass);
    p.angular_velocity_W = turned_[i].spin_W;
    if (!b.torque_W.isZero(0)) p.angular_velocity_W += 0.5 * h * SpinOf(b, p.rotation_WB, b.torque_W);
  }
  for (size_t i = 0; i < bodies.size(); ++i) {
    if (bodies[i].Moves()) continue;
    const auto [pose, velocity_W] = WallHalfway(i, h);
    SetState({pose, velocity_W, bodies[i].angular_velocity_W}, &posed_[i]);
  }
  for (size_t c = 0; c < held_.size() && first; ++c) {  // what later passes pose faces them already
    const int a = held_[c].body_a, b = held_[c].body_b;
    Face(held_of_[c], posed_[a].position_W, posed_[b].position_W, &held_[c]);
    held_of_[c].centre = Shared(held_[c], CentreAhead(a, h), CentreAhead(b, h));
  }
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
  for (size_t c = 0; c < held_.size(); ++c) ApplyImpulse(held_[c], 0.5 * impulse_W_[c], trial_);
  const double still = kSettled * settings_.tolerance * floor_;
  for (size_t c = 0; c < held_.size(); ++c) {
    const Vector3 u =
        RelativeVelocity(held_[c], trial_[held_[c].body_a], trial_[held_[c].body_b]) - targets_[c] * held_[c].normal_W;
    if (held_[c].normal_W.dot(u) < -kExact * Size({held_[c].body_a, held_[c].body_b}) / h) return false;
    if (!impulse_W_[c].isZero(0) && !Agrees(held_[c], impulse_W_[c], u, still)) return false;
  }
  return true;
}

// Whether normals at the start of the piece do not describe it: what presses passes an edge, or turns.
bool Stepper::NormalsMove() const {
  for (size_t c = 0; c < held_.size(); ++c) {
    if (impulse_W_[c].isZero(0)) continue;
    bool alike = false;
    for (size_t e = 0; e < end_.size() && !alike; ++e)
      alike = end_pair_[e] == held_of_[c].pair &&
              (end_[e].normal_W - held_[c].normal_W).squaredNorm() < kSamePoint * kSamePoint;
    if (!alike) return true;
  }
  return false;
}

// Whether anything closed that presses nothing got deeper: by its place where the piece begins it would not, so its normal or lever moved.
bool Stepper::SinksFreely() const {
  for (size_t e = 0; e < end_.size(); ++e) {
    const double before = GapBefore(end_pair_[e]), least = kExact * Size(group_->pairs[end_pair_[e]]);
    if (end_[e].gap < before - least && yields_[end_pair_[e]] == 0 && !Hits(e) && CarriedBy(e).isZero(0) &&
        ClosedAtStart(e))
      return true;
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
      if (moves && TurnsInItself(i)) continue;
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
    const bool faces_a = FacesAxis(*group_->shapes[a], end_state_[a].pose, contact),
               faces_b = FacesAxis(*group_->shapes[b], end_state_[b].pose, contact);
    Held held{pair, {}, 0, 0, contact.surface_W, faces_a, faces_b};
    if (start) {
      contact.point_W = Halfway(contact, start->point_W, contact.point_W);
      const double turn = (contact.normal_W - start->normal_W).norm();
      contact.normal_W = (start->normal_W + contact.normal_W).normalized();
      Face(held, middle_[a].position_W, middle_[b].position_W, &contact);
      Course course_a = CourseOf(a), course_b = CourseOf(b);
      course_a.axis_W = AxisOf(a, faces_a);
      course_b.axis_W = AxisOf(b, faces_b);
      const double opening = (contact.gap - start->gap) / h;
      if (!TurnLever(opening, turn, course_a, course_b, Size(group_->pairs[pair]), &contact) &&
          !group_->shapes[a]->HasAxis() && !group_->shapes[b]->HasAxis())
        LeanNormal(opening, course_a, course_b, &contact);
    } else if (TurnInThemselves(pair)) {
      probe_.clear();  // what turns in itself takes no spin from a normal impulse: along the line halfway, it gets none
      CollideShapes(*group_->shapes[a], middle_[a].placement(), *group_->shapes[b], middle_[b].placement(), kFar,
                    &probe_);
      contact.point_W = probe_[0].point_W;
      contact.normal_W = probe_[0].normal_W;
    } else {
      contact.point_W -= Shared(contact, end_state_[a].pose.position_W - middle_[a].position_W,
                                end_state_[b].pose.position_W - middle_[b].position_W);
      Face(held, middle_[a].position_W, middle_[b].position_W, &contact);
    }
    const double u = contact.normal_W.dot(MeanVelocity(b, contact.point_W) - MeanVelocity(a, contact.point_W));
    double target = u - (contact.gap - GapToMeet(e, start)) / h;
    // A cylinder that lies by one end a hair deeper would roll uphill.
    if (start && !lifts_) target = std::max(std::min(target, 0.0), u - (contact.gap - GapToMeet(e, nullptr)) / h);
    target = yields_[pair] > 0 ? -yields_[pair] : std::min(target, kFastest * floor_);
    contact.surface_W += WallSlip(contact, group_->bodies, off_, ways_);
    next_.push_back(contact);
    const double opens = start && yields_[pair] == 0 ? target - u + (contact.gap - start->gap) / h : target;
    held.centre = CentreHalfway(contact), held.target = target, held.opens = opens;
    next_of_.push_back(held);
    next_impulse_W_.push_back(WithinCone(contact, CarriedBy(e)));
  }
  // What pressed and is not found again stays for some passes, or they would go round between corners; not where the pair has come apart.
  for (size_t c = 0; c < held_.size(); ++c) {
    if (impulse_W_[c].isZero(0) || held_of_[c].age >= kAges || follows_[c] >= 0 || IsOpenAtEnd(held_of_[c].pair))
      continue;
    Held old = held_of_[c];
    ++old.age;
    Contact contact = AsActed(c);
    const auto way = [&](int i) -> Vector3 {
      return CarriedWith(i, contact.point_W, Moment::kMiddle, Moment::kEnd) -
             CarriedWith(i, contact.point_W, Moment::kMiddle, Moment::kStart);
    };
    const double parted = contact.normal_W.dot(way(contact.body_b) - way(contact.body_a));
    TurnLever(parted / h, 0, CourseOf(contact.body_a), CourseOf(contact.body_b), Size(group_->pairs[old.pair]),
              &contact);
    const Vector3 u = MeanVelocity(contact.body_b, contact.point_W) - MeanVelocity(contact.body_a, contact.point_W);
    old.target = old.opens + contact.normal_W.dot(u) - parted / h;
    old.centre = CentreHalfway(contact);
    next_.push_back(contact);
    next_of_.push_back(old);
    next_impulse_W_.push_back(impulse_W_[c]);
  }
  std::swap(held_, next_);
  std::swap(held_of_, next_of_);
  std::swap(impulse_W_, next_impulse_W_);
}

}  // namespace islet::motion
