// In: the course of a pass, and the gaps at its end. Out: who missed or gained energy, and is posed anew.
#include "engine/motion/crowd/crowd.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "engine/contact_pairs.h"
#include "islands/disjoint_sets.h"
#include "qp/smallness.h"

namespace islet::motion {
namespace {

constexpr int kLettingGo = 3;  // passes that go on because something was let go

}  // namespace

// Returns whether gaps meet their end, and marks the islands in which they do not.
bool Crowd::Judge(int pass) {
  const std::vector<Contact>& end = *near_;
  FollowHeld();
  disturbed_.assign(bodies_.size(), 0);
  bool met = true;
  for (size_t e = 0; e < end.size(); ++e) {
    const double size = Size(end[e]);
    if (cut_[end[e].body_a] && cut_[end[e].body_b]) continue;
    // Who is beyond the tolerance goes no deeper, or every step would add a little.
    const double tolerance = settings_.overlap_tolerance * size;
    const double deepest = before_[e] - (before_[e] < -tolerance ? kSamePoint * size : tolerance);
    if (end[e].gap >= deepest - dt_ * YieldOf(end[e])) continue;
    met = false;
    Disturb(end[e]);
  }
  met = (!LetGo() || pass > kLettingGo) && met;
  met = !Gains() && met;
  met = !LeversMiss() && met;
  if (met) return true;
  // All of an island that misses its end somewhere.
  edges_.clear();
  for (const Contact& contact : held_) edges_.emplace_back(contact.body_a, contact.body_b);
  islands::BuildPartition({cut_, edges_}, &partition_);
  for (int island = 0; island < partition_.num_islands(); ++island) {
    const std::span<const int> members = partition_.bodies_of(island);
    if (std::none_of(members.begin(), members.end(), [&](int i) { return disturbed_[i] != 0; })) continue;
    for (const int i : members) disturbed_[i] = 1;
  }
  return false;
}

// Its bodies are solved again.
void Crowd::Disturb(const Contact& contact) {
  for (const int i : {contact.body_a, contact.body_b})
    if (!cut_[i]) disturbed_[i] = 1;
}

// Whether something heavy lands on flat sides and pressed at levers that a pass before had. All of its impulse is taken back for the blow, and
// leaves a spin by as much as the levers of the end are others. What is not much lighter is spun by less than what gaps may miss. Marks those
// whose points would be as fast as blows may differ that tie.
bool Crowd::LeversMiss() {
  spins_W_.assign(bodies_.size(), Vector3::Zero());
  lands_.assign(bodies_.size(), 0.0);
  bool any = false;
  for (size_t c = 0; c < held_.size(); ++c) {
    if (impulse_W_[c].isZero(0) || follows_[c] < 0) continue;
    const Contact& end = (*near_)[follows_[c]];
    const int a = end.body_a, b = end.body_b, light = MassOf(a) < MassOf(b) ? a : b, heavy = light == a ? b : a;
    if (cut_[heavy] || MassOf(heavy) < 10 * MassOf(light) || end.restitution == 0) continue;
    if (GapAtStart(end) <= settings_.overlap_tolerance * Size(end)) continue;
    const auto velocity = [&](int i) -> Vector3 {
      return begin_[i].linear_W + begin_[i].angular_W.cross(end.point_W - begin_[i].pose.position_W);
    };
    lands_[light] = std::max(lands_[light], end.normal_W.dot(velocity(a) - velocity(b)));
    any = true;
  }
  if (!any) return false;
  for (size_t c = 0; c < held_.size(); ++c) {
    if (impulse_W_[c].isZero(0) || follows_[c] < 0) continue;
    const Contact& end = (*near_)[follows_[c]];
    for (const int i : {end.body_a, end.body_b}) {
      if (lands_[i] <= 0 || TurnsInItself(i) || std::isfinite(SideAtStart(i, end).radius)) continue;
      const Vector3 r = end.point_W - bodies_[i].position_W;
      const Vector3 before = begin_[i].pose.rotation_WB * (SeenAs(i, bodies_[i].rotation_WB).conjugate() * r);
      const Vector3 off = acted_at_[c] - middle_[i].position_W - 0.5 * (r + before);
      spins_W_[i] += off.cross(i == end.body_b ? impulse_W_[c] : Vector3(-impulse_W_[c]));
    }
  }
  any = false;
  for (size_t i = 0; i < bodies_.size(); ++i) {
    if (lands_[i] <= 0) continue;
    const double speed = (bodies_[i].InverseInertiaW() * spins_W_[i]).norm() * bodies_[i].radius;
    if (speed <= kTie * std::max(floor_, lands_[i])) continue;
    disturbed_[i] = 1;
    any = true;
  }
  return any;
}

// What presses a pair that ends open holds by a plane that is not the pair's at the end. It is posed once more as it ends, then let go.
// Returns whether there is any. (By the convex models what rubs parts.)
bool Crowd::LetGo() {
  if (settings_.model != Model::kCoulomb) return false;
  opens_.resize(pairs_.size());
  pool_->ForEachOf(pairs_.size(), [&](size_t p) {
    const PairPlaces& pair = pairs_[p];
    opens_[p] = 0;
    if (pair.x == pair.x_end) return;
    const Contact& held = held_[pair.x];
    const double gap = LeastGap(std::span(*near_).subspan(pair.y, pair.y_end - pair.y));
    opens_[p] = gap > std::max(0.0, GapAtStart(held)) + settings_.overlap_tolerance * Size(held);
  });
  bool any = false;
  for (size_t p = 0; p < pairs_.size(); ++p)
    for (size_t c = pairs_[p].x; c < pairs_[p].x_end && opens_[p]; ++c) {
      if (impulse_W_[c].isZero(0)) continue;
      ++held_of_[c].opened;
      any = true;
      Disturb(held_[c]);
    }
  return any;
}

// [J] of a body, its height counted from where the step began.
double Crowd::EnergyOf(size_t i, bool at_end) const {
  const Body& b = bodies_[i];
  const State& s = begin_[i];
  const Quaternion& rotation = at_end ? b.rotation_WB : s.pose.rotation_WB;
  const Vector3 v = at_end ? b.linear_velocity_W : s.linear_W,
                w = rotation.conjugate() * (at_end ? b.angular_velocity_W : s.angular_W);
  const double height = at_end ? (b.mass * settings_.gravity + b.force_W).dot(b.position_W - s.pose.position_W) : 0;
  return 0.5 * b.mass * v.squaredNorm() + 0.5 * w.dot(b.inertia_B * w) - height;
}

// [m/s] mean velocity of a held contact.
Vector3 Crowd::SlipOf(size_t c) const {
  return MeanVelocity(held_[c].body_b, acted_at_[c]) - MeanVelocity(held_[c].body_a, acted_at_[c]) +
         SurfaceSlip(held_[c]);
}

// [J] of what a contact carried.
double Crowd::WorkOf(size_t c) const { return impulse_W_[c].dot(SlipOf(c)); }

// [J] that moving walls and belts do by an impulse on body_b, halfway or at the end.
double Crowd::WorkOfWalls(const Contact& c, const Vector3& point, const Vector3& impulse_W, bool at_end) const {
  double work = -impulse_W.dot(SurfaceSlip(c));
  for (const auto& [i, sign] : {std::pair{c.body_a, 1.0}, std::pair{c.body_b, -1.0}}) {
    const Body& wall = bodies_[i];
    if (wall.kind != BodyKind::kKinematic) continue;
    work += sign * impulse_W.dot(at_end ? wall.VelocityAt(point) : MeanVelocity(i, point));
  }
  return work;
}

// Whether bodies that press each other gained energy, by contacts whose levers are not those of the step, or by what pushed an overlap
// out; marks the bodies of these contacts.
bool Crowd::Gains() {
  edges_.clear();
  pressing_.clear();
  for (size_t c = 0; c < held_.size(); ++c) {
    if (impulse_W_[c].isZero(0)) continue;
    edges_.emplace_back(held_[c].body_a, held_[c].body_b);
    pressing_.push_back(static_cast<int>(c));
  }
  islands::BuildPartition({cut_, edges_}, &gaining_);
  lost_.assign(bodies_.size(), INFINITY);
  gain_.resize(bodies_.size());
  at_hand_.resize(bodies_.size());
  pool_->ForEachOf(bodies_.size(), [&](size_t i) {
    if (cut_[i]) return;
    const double before = EnergyOf(i, false);
    gain_[i] = EnergyOf(i, true) - before - dt_ * bodies_[i].torque_W.dot(mean_spin_W_[i]);
    at_hand_[i] = before + bodies_[i].mass * least_energy_;
  });
  bool gains = false;
  for (int island = 0; island < gaining_.num_islands(); ++island) {
    double gain = 0, at_hand = 0;
    for (const int i : gaining_.bodies_of(island)) gain += gain_[i], at_hand += at_hand_[i];
    for (const int k : gaining_.contacts_of(island)) {
      const int c = pressing_[k];
      gain -= WorkOfWalls(held_[c], acted_at_[c], impulse_W_[c], false);
    }
    for (const int i : gaining_.bodies_of(island)) lost_[i] = -gain;
    if (gain <= kGain * at_hand) continue;
    for (const int i : gaining_.bodies_of(island)) pushes_[i] = 0, gained_[i] = 1;  // what it costs is not there
    for (const int k : gaining_.contacts_of(island)) {
      const int c = pressing_[k];
      const double push = std::exchange(held_of_[c].push, 0.0);
      held_of_[c].allowed -= push;
      if (push == 0 && WorkOf(c) <= 0.1 * kGain * at_hand) continue;
      gains = true;
      Disturb(held_[c]);
    }
  }
  return gains;
}

// Marks the bodies of an island that impulses join, as far as they have more energy together than carrying left them and took from them.
// Returns whether there are any.
bool Crowd::MarkGains(int island, Worker* worker) const {
  const std::span<const int> contacts = partition_.contacts_of(island), bodies = partition_.bodies_of(island);
  const auto place = [&](int i) {
    return static_cast<int>(std::lower_bound(bodies.begin(), bodies.end(), i) - bodies.begin());
  };
  const auto first_of = [&](int c) {
    return place(cut_[problem_[c].body_a] ? problem_[c].body_b : problem_[c].body_a);
  };
  worker->parents.resize(bodies.size());
  worker->gains.assign(bodies.size(), 0.0);
  worker->works.assign(bodies.size(), 0.0);
  islands::DisjointSets parts(worker->parents);
  for (const int c : contacts) {
    const Contact& contact = problem_[c];
    const bool acts = !worker->taken.empty() || !carried_W_[closed_[c]].isZero(0) ||
                      !(local_[c] + blows_[c] + collisions_[c]).isZero(0);
    if (acts && !cut_[contact.body_a] && !cut_[contact.body_b])
      parts.Union(place(contact.body_a), place(contact.body_b));
  }
  for (size_t k = 0; k < bodies.size(); ++k) {
    const Body& left = bodies_[bodies[k]];
    worker->gains[parts.Find(static_cast<int>(k))] +=
        posed_[bodies[k]].KineticEnergy() - (1 + kGain) * left.KineticEnergy() - kGain * left.mass * least_energy_;
  }
  for (const int c : contacts) {
    const int part = parts.Find(first_of(c));
    const Vector3 change = ChangeAt(c);
    worker->gains[part] -= WorkOfWalls(problem_[c], problem_[c].point_W, change, true);
    worker->works[part] += work_[closed_[c]];
  }
  for (const int c : worker->taken) {
    const Contact taken = WhereTaken(c);
    worker->gains[parts.Find(first_of(problem_at_[follows_[c]]))] -=
        WorkOfWalls(taken, taken.point_W, -impulse_W_[c], true);
  }
  bool any = false;
  worker->gaining.assign(bodies.size(), 0);
  for (size_t k = 0; k < bodies.size(); ++k) {
    const int part = worker->parents[k] = parts.Find(static_cast<int>(k));
    if (part == static_cast<int>(k)) worker->gains[k] += std::min(0.0, worker->works[k]);
    worker->gaining[k] = worker->gains[part] > 0;
    any = any || worker->gaining[k];
  }
  return any;
}

// Takes back of the blows of those who gain by them the least share that leaves no gain. Between the velocities before and after all of a
// blow what it moves changes in proportion, so friction stays within its cones, and what closed is open from the share on that stops it.
// Returns whether that is enough.
bool Crowd::Soften(int island, Worker* worker) {
  const std::span<const int> contacts = partition_.contacts_of(island), bodies = partition_.bodies_of(island);
  const auto part_of = [&](int c) {
    const int i = cut_[problem_[c].body_a] ? problem_[c].body_b : problem_[c].body_a;
    return worker->parents[std::lower_bound(bodies.begin(), bodies.end(), i) - bodies.begin()];
  };
  // Of what is taken back, d = 1 - share: gain = gains - d slope + d^2 square. The share takes the place of the slope.
  std::vector<double>&slope = worker->share, &square = worker->square;
  slope.assign(bodies.size(), 0.0);
  square.assign(bodies.size(), 0.0);
  const auto twist_at = [&](size_t k, double share) -> Twist {
    const Twist &held = worker->held[k], now = TwistOf(posed_[bodies[k]]);
    return {held.linear_W + share * (now.linear_W - held.linear_W),
            held.angular_W + share * (now.angular_W - held.angular_W)};
  };
  for (size_t k = 0; k < bodies.size(); ++k) {
    if (!worker->gaining[k]) continue;
    Body body = posed_[bodies[k]];
    const Twist &held_twist = worker->held[k], after = TwistOf(body);
    const double now = body.KineticEnergy();
    SetTwist(held_twist, &body);
    const double held = body.KineticEnergy();
    SetTwist({after.linear_W - held_twist.linear_W, after.angular_W - held_twist.angular_W}, &body);
    const double change = body.KineticEnergy();
    slope[worker->parents[k]] += now - held + change;
    square[worker->parents[k]] += change;
  }
  for (const int c : contacts)
    slope[part_of(c)] -= WorkOfWalls(problem_[c], problem_[c].point_W, frames_[c] * (blows_[c] + collisions_[c]), true);
  for (size_t k = 0; k < bodies.size(); ++k) {
    if (worker->parents[k] != static_cast<int>(k) || !worker->gaining[k]) continue;
    const double root = slope[k] * slope[k] - 4 * square[k] * worker->gains[k];
    if (!(slope[k] > 0) || root < 0) return false;
    slope[k] = 1 - 2 * worker->gains[k] / (slope[k] + std::sqrt(root));
  }
  const auto velocity = [&](int c, double share) {
    const auto of = [&](int i) -> Vector3 {
      Body body = posed_[i];
      if (!cut_[i])
        SetTwist(twist_at(std::lower_bound(bodies.begin(), bodies.end(), i) - bodies.begin(), share), &body);
      return body.VelocityAt(problem_[c].point_W);
    };
    return problem_[c].normal_W.dot(of(problem_[c].body_b) - of(problem_[c].body_a));
  };
  const auto gains = [&](int c) { return worker->gains[part_of(c)] > 0; };
  for (const int c : contacts) {
    if (!gains(c)) continue;
    const double share = worker->share[part_of(c)];
    if (velocity(c, share) < std::min(0.0, velocity(c, 1)) - threshold_) return false;
  }
  for (const int c : contacts) {
    if (!gains(c)) continue;
    blows_[c] *= worker->share[part_of(c)];
    collisions_[c] *= worker->share[part_of(c)];
  }
  for (size_t k = 0; k < bodies.size(); ++k)
    if (worker->gaining[k]) SetTwist(twist_at(k, worker->share[worker->parents[k]]), &posed_[bodies[k]]);
  return true;
}

}  // namespace islet::motion
