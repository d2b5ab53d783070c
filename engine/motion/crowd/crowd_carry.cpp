// In: contacts near where a piece begins. Out: which of them carry, and their impulses.
#include "engine/motion/crowd/crowd.h"

#include <algorithm>
#include <cmath>

#include "engine/contact_pairs.h"
#include "engine/motion/tuning.h"
#include "engine/rotation.h"
#include "engine/slice.h"
#include "engine/stopwatch.h"
#include "qp/smallness.h"

namespace islet::motion {

// [m] what a piece takes back of an overlap.
double Crowd::PushOf(double gap) const { return std::min(-kPushOut * gap, kFastest * floor_ * dt_); }

// Overlaps are pushed out by who lost as much energy in the piece before as that costs: what rests is not moved.
void Crowd::AllowPushes(const CrowdMemory& memory) {
  pushes_.assign(bodies_.size(), 1);
  gained_.assign(bodies_.size(), 0);
  for (size_t c = 0; c < start_.size(); ++c) {
    const Contact& contact = start_[c];
    const double cost = PushOf(contact.gap) * contact.normal_W.dot(start_force_W_[c]);
    for (const int i : {contact.body_a, contact.body_b})
      if (!cut_[i] && contact.gap < -settings_.overlap_tolerance * Size(contact) && cost > memory.lost[i])
        pushes_[i] = 0;
  }
}

// What may close within the step, on the course that the velocities of its start give.
void Crowd::Select() {
  const double near =
      settings_.model == Model::kCoulomb ? kSamePoint : INFINITY;  // by the convex models what comes near parts
  held_.clear();
  held_of_.clear();
  impulse_W_.clear();
  centre_.clear();
  off_ = OffAhead(dt_);
  ways_.resize(bodies_.size());
  for (size_t i = 0; i < bodies_.size(); ++i) ways_[i].mean_W = begin_[i].linear_W;
  if (driven_) Foresee(dt_, settings_.gravity, bodies_, start_, start_force_W_, ways_);
  for (size_t c = 0; c < start_.size(); ++c) {
    const Contact& contact = start_[c];
    const Body &a = bodies_[contact.body_a], &b = bodies_[contact.body_b];
    if (!a.Moves() && !b.Moves()) continue;
    const auto free = [&](const Body& body, int i) -> Vector3 {
      return body.Moves() ? Vector3(free_[i].linear_W + free_[i].half.spin_W.cross(contact.point_W - body.position_W))
                          : MeanVelocity(i, contact.point_W + middle_[i].position_W - body.position_W);
    };
    const double opening = contact.normal_W.dot(free(b, contact.body_b) - free(a, contact.body_a));
    const double size = Size(contact);
    if (start_force_W_[c].isZero(0) && (contact.gap > near * size || contact.gap + dt_ * opening > kReach * size))
      continue;
    // What is closed stays as far apart as it is; what is open may close; an overlap that shows is pushed out.
    const double tolerance = settings_.overlap_tolerance * size;
    const bool pushed = contact.gap < -tolerance && pushes_[contact.body_a] && pushes_[contact.body_b];
    const double gap = contact.gap > tolerance ? contact.gap : pushed ? -PushOf(contact.gap) : 0;
    held_.push_back(contact);
    Held held;
    held.target = -gap / dt_ - YieldOf(contact);
    held.allowed = contact.gap - gap - dt_ * YieldOf(contact);
    held.push = gap < 0 ? -gap : 0;
    const Vector3 half = 0.5 * contact.gap * contact.normal_W;
    held.in_a = Inside(contact.body_a, begin_[contact.body_a].pose, contact.point_W - half);
    held.in_b = Inside(contact.body_b, begin_[contact.body_b].pose, contact.point_W + half);
    held_of_.push_back(held);
    impulse_W_.push_back(WithinCone(contact, dt_ * start_force_W_[c]));
    // At the lever of halfway, as far as bodies move and turn on.
    held_of_.back().faces_a = FacesAxis(shapes_[contact.body_a], begin_[contact.body_a].pose, contact);
    held_of_.back().faces_b = FacesAxis(shapes_[contact.body_b], begin_[contact.body_b].pose, contact);
    const auto turn = [&](const Body& body, int i) -> Vector3 {
      return 0.5 * dt_ * VisibleSpin(shapes_[i], body.rotation_WB, body.angular_velocity_W);
    };
    const Vector3 turn_a = turn(a, contact.body_a), turn_b = turn(b, contact.body_b);
    const auto ahead = [&](const Body& body) -> Vector3 { return 0.5 * dt_ * body.linear_velocity_W; };
    const Vector3 slip = ahead(b) + turn_b.cross(contact.point_W - b.position_W) - ahead(a) -
                         turn_a.cross(contact.point_W - a.position_W);
    held_.back().normal_W = NormalAhead(contact, SideAtStart(contact.body_a, contact),
                                        SideAtStart(contact.body_b, contact), turn_a, turn_b, slip);
    const Vector3 turns = held_.back().normal_W - contact.normal_W;
    const auto halfway = [&](const Body& body, int i) -> Vector3 {
      const double out = i == contact.body_a ? 1 : -1;
      const double radius = RoundRadius(shapes_[i], body.rotation_WB, contact.normal_W);
      const Vector3 faces = std::isfinite(radius) ? Vector3(out * radius * turns) : Vector3::Zero();
      if (TurnsInItself(i)) return contact.point_W + ahead(body) + faces;
      return contact.point_W + ahead(body) + faces +
             0.5 * ArmChange(shapes_[i], body.rotation_WB, 2 * (i == contact.body_a ? turn_a : turn_b),
                             contact.point_W - body.position_W, out * contact.normal_W);
    };
    held_of_.back().belt_W = contact.surface_W;
    const Vector3 slip_W = WallSlip(contact, bodies_, off_, ways_);
    held_.back().surface_W += slip_W;
    held_of_.back().target -= contact.normal_W.dot(slip_W);
    held_.back().point_W = Shared(contact, halfway(a, contact.body_a), halfway(b, contact.body_b));
    Face(held_of_.back(), a.position_W + ahead(a), b.position_W + ahead(b), &held_.back());
    centre_.push_back(Shared(held_.back(), a.position_W + ahead(a), b.position_W + ahead(b)));
  }
}

// [m] of the pair; infinite where it was out of reach.
double Crowd::GapAtStart(const Contact& pair) const {
  const auto [first, last] = std::equal_range(start_.begin(), start_.end(), pair, EarlierPair);
  return LeastGap({first, last});
}

// Whether its normal turns as the bodies pass each other.
bool Crowd::IsRound(const Contact& c) const {
  const ShapeKind a = shapes_[c.body_a].kind(), b = shapes_[c.body_b].kind();
  return a != ShapeKind::kHalfSpace && b != ShapeKind::kHalfSpace &&
         (a == ShapeKind::kSphere || b == ShapeKind::kSphere);
}

Side Crowd::SideAtStart(int i, const Contact& c) const {
  return SideOf(shapes_[i], begin_[i].pose.rotation_WB, MassOf(i), c.normal_W);
}

Matrix3 Crowd::Share(const Contact& c) const {
  return ShareOfA(SideAtStart(c.body_a, c), SideAtStart(c.body_b, c), c.normal_W);
}

Vector3 Crowd::Shared(const Contact& c, const Vector3& of_a, const Vector3& of_b) const {
  const Matrix3 share = Share(c);
  return share * of_a + (Matrix3::Identity() - share) * of_b;
}

void Crowd::Part(std::span<const Contact> contacts) {
  edges_.clear();
  frames_.resize(contacts.size());
  for (size_t c = 0; c < contacts.size(); ++c) {
    edges_.emplace_back(contacts[c].body_a, contacts[c].body_b);
    frames_[c] = ContactFrame(contacts[c].normal_W);
  }
  PartEdges();
}

// Islands of a problem, and room for their answers.
void Crowd::PartEdges() {
  islands::BuildPartition({cut_, edges_}, &partition_);
  outcomes_.assign(partition_.num_islands(), {});
  records_.resize(partition_.num_islands());
}

// Impulses that keep contacts open at the end of the step, of the islands that are disturbed. Unknown: the mean velocity, after half of
// each impulse.
void Crowd::Carry(bool first, StepReport* report) {
  frames_.resize(held_.size());
  edges_.clear();
  active_.clear();
  for (size_t c = 0; c < held_.size(); ++c) {
    if (!disturbed_[held_[c].body_a] && !disturbed_[held_[c].body_b]) continue;
    frames_[c] = ContactFrame(held_[c].normal_W);
    edges_.emplace_back(held_[c].body_a, held_[c].body_b);
    active_.push_back(static_cast<int>(c));
  }
  PartEdges();
  pool_->ForEachOf(bodies_.size(), [&](size_t i) {
    Body& p = posed_[i];
    p.position_W = first ? Vector3(begin_[i].pose.position_W + 0.5 * dt_ * begin_[i].linear_W) : middle_[i].position_W;
    if (cut_[i]) {
      p.linear_velocity_W = mean_W_[i];
      return;
    }
    p.rotation_WB = free_[i].half.rotation_WB;
    p.linear_velocity_W = free_[i].linear_W;
    p.angular_velocity_W = free_[i].half.spin_W;
    if (!bodies_[i].torque_W.isZero(0))
      p.angular_velocity_W += 0.5 * dt_ * SpinOf(bodies_[i], p.rotation_WB, bodies_[i].torque_W);
  });
  targets_.resize(held_.size());
  given_.assign(held_.size(), 0.0);
  local_.resize(held_.size());
  for (const int c : active_) {
    targets_[c] = held_of_[c].target;
    local_[c] = 0.5 * (frames_[c].transpose() * impulse_W_[c]);
  }
  const double start = Seconds();
  ForEachIsland([&](int island, Worker* worker) {
    worker->contacts.clear();
    for (const int k : partition_.contacts_of(island)) worker->contacts.push_back(active_[k]);
    const IslandView view{partition_.bodies_of(island), worker->contacts};
    if (view.contacts.empty()) return;
    outcomes_[island] =
        worker->responder.ResolveTargets(view, {held_, frames_}, targets_, settings_, floor_, posed_, local_);
    for (const int c : view.contacts) {
      impulse_W_[c] = 2 * (frames_[c] * local_[c]);
      if (impulse_W_[c].norm() <= settings_.tolerance * floor_ * LighterMass(held_[c]))
        impulse_W_[c].setZero();  // or what is open is held
    }
    for (size_t k = 0; k < view.contacts.size() && outcomes_[island].status == QpStatus::kInfeasible; ++k)
      given_[view.contacts[k]] = worker->responder.given()[k];
    for (const int i : view.bodies) errors_[i] = outcomes_[island].certificate.natural_map_max;
    Record(island, Stage::kStatic, outcomes_[island], *worker);
  });
  TellObserver();
  const double solved = Seconds();
  TellSlice({"solve", start, solved});
  Report(outcomes_, &report->static_qp, solved - start, &report->seconds.static_qp, report);
  MarkClosedUpon();
  GiveWay();
}

// What is frozen is no wall where nothing else can give way.
void Crowd::MarkClosedUpon() {
  for (int island = 0; island < partition_.num_islands(); ++island) {
    if (outcomes_[island].status != QpStatus::kInfeasible) continue;
    for (const int k : partition_.contacts_of(island))
      for (const int i : {held_[active_[k]].body_a, held_[active_[k]].body_b})
        if (bodies_[i].frozen) closed_upon_[i] = 1;
  }
}

// Pairs that moving walls press together faster than anything keeps them apart close at that speed for the rest of the step.
void Crowd::GiveWay() {
  ForEachPair(held_, {}, [&](size_t h, size_t h_end, size_t, size_t) {
    const double given = *std::max_element(given_.begin() + static_cast<std::ptrdiff_t>(h),
                                           given_.begin() + static_cast<std::ptrdiff_t>(h_end));
    if (given <= threshold_) return;
    const auto known =
        std::find_if(yields_.begin(), yields_.end(), [&](const Yield& y) { return SamePair(y.pair, held_[h]); });
    if (known != yields_.end())
      known->speed += given;
    else
      yields_.push_back({held_[h], given});
  });
}

// [m/s] at which a pair gives way.
double Crowd::YieldOf(const Contact& pair) const {
  for (const Yield& y : yields_)
    if (SamePair(y.pair, pair)) return y.speed;
  return 0;
}

// [kg] of the lighter of those that contacts move.
double Crowd::LighterMass(const Contact& contact) const {
  return std::min(MassOf(contact.body_a), MassOf(contact.body_b));
}

}  // namespace islet::motion
