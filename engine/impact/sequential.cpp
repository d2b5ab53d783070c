#include "engine/impact/sequential.h"

#include <algorithm>
#include <climits>
#include <cmath>
#include <numeric>
#include <utility>

#include <Eigen/LU>

#include "qp/natural_map.h"
#include "qp/smallness.h"

namespace islet {
namespace {

constexpr double kTie = 1e-4;       // of the fastest approach: contacts that differ by less bounce at once
constexpr int kMostSweeps = 400;    // for a tie of more than 32 bodies, before Newton's method
constexpr double kMostBlows = 2;    // that a body takes from the queue, by the automatic limit
constexpr double kPassedOn = 1e-3;  // of one: an elastic one

// What a bounce uses up of that. Inelastic ones share a blow among bodies, which the QP does better. Elastic ones pass it on, which only
// the queue can do: n in a stack on a floor take about n^2 of them. All that bounces at once is one.
double BounceCost(double restitution) { return 1 - restitution + kPassedOn * restitution; }

// A member moves by the blows; all others are walls, what is frozen among them, too.
BounceBody MakeBounceBody(const Body& body, bool member) {
  BounceBody out;
  out.position_W = body.position_W;
  out.linear_velocity_W = body.linear_velocity_W;
  out.angular_velocity_W = body.angular_velocity_W;
  if (member) {
    out.inverse_mass = 1 / body.mass;
    out.inverse_inertia_W = body.InverseInertiaW();
  }
  return out;
}

}  // namespace

int BounceLimit(int setting, int num_bodies, int num_contacts) {
  if (setting != kAutoBounceLimit) return setting;
  return num_bodies < 50 ? num_bodies : num_contacts / 10;
}

void SequentialResolver::Load(std::span<const int> group_bodies, std::span<const int> group_contacts,
                              const ContactFrames& contacts, std::span<const Body> bodies) {
  if (local_.size() < bodies.size()) local_.resize(bodies.size(), -1);
  locals_.clear();
  for (const int number : group_bodies) {
    local_[number] = static_cast<int>(locals_.size());
    locals_.push_back(MakeBounceBody(bodies[number], true));
  }
  const auto place = [&](int number) {
    if (local_[number] >= 0) return local_[number];
    locals_.push_back(MakeBounceBody(bodies[number], false));  // a wall: one copy per contact, it never changes
    return static_cast<int>(locals_.size()) - 1;
  };
  sides_.clear();
  for (const int number : group_contacts) {
    const Contact& contact = contacts.contacts[number];
    const int a = place(contact.body_a);
    sides_.emplace_back(a, place(contact.body_b));
  }
  touch_start_.assign(locals_.size() + 1, 0);
  for (const auto& [a, b] : sides_) ++touch_start_[a + 1], ++touch_start_[b + 1];
  std::partial_sum(touch_start_.begin(), touch_start_.end(), touch_start_.begin());
  touches_.resize(2 * sides_.size());
  for (size_t c = sides_.size();
       c-- > 0;) {  // filled from the back; touch_start_ ends one step early and is shifted below
    touches_[--touch_start_[sides_[c].first + 1]] = static_cast<int>(c);
    touches_[--touch_start_[sides_[c].second + 1]] = static_cast<int>(c);
  }
  touch_start_.erase(touch_start_.begin());
  touch_start_.push_back(static_cast<int>(touches_.size()));
  for (const int number : group_bodies) local_[number] = -1;
}

double SequentialResolver::NormalVelocityOf(int c, const Contact& contact) const {
  const auto& [a, b] = sides_[c];
  return contact.normal_W.dot(locals_[b].VelocityAt(contact.point_W) - locals_[a].VelocityAt(contact.point_W));
}

void SequentialResolver::ApplyAt(int c, const Contact& contact, const Vector3& impulse_W) {
  const auto [a, b] = sides_[c];
  locals_[a].ApplyImpulse(-impulse_W, contact.point_W);
  locals_[b].ApplyImpulse(impulse_W, contact.point_W);
}

// Whether it rests on an immovable body, which takes the blow with it.
bool SequentialResolver::Answers(int c, int number, double velocity) const {
  const bool wall = !locals_[sides_[c].first].moves() || !locals_[sides_[c].second].moves();
  return walls_answer_ && wall && std::abs(velocity) <= (resting_.empty() ? threshold_ : resting_[number]);
}

// All that are as fast as the fastest, wherever they are, or it would depend on the bounce limit who has bounced; of their bodies all that
// are nearly as fast, or a flat landing were one of corners; and what answers to them.
void SequentialResolver::FindTies(std::span<const int> group_contacts, std::span<const Contact> contacts) {
  const double nearly = (1 - std::max(kTie, tie_)) * queue_.top_key();
  queue_.UpTo((1 - kTie) * queue_.top_key(), &tied_);
  tied_bodies_.clear();
  is_tied_.assign(locals_.size(), 0);
  in_tie_.assign(sides_.size(), 0);
  const auto tie_bodies_of = [&](int c) {
    in_tie_[c] = 1;
    for (const int side : {sides_[c].first, sides_[c].second})
      if (locals_[side].moves() && !std::exchange(is_tied_[side], 1)) tied_bodies_.push_back(side);
  };
  const auto add_where = [&](size_t bodies, const auto& takes_part) {
    for (size_t k = 0; k < bodies; ++k) {
      const int side = tied_bodies_[k];
      for (int t = touch_start_[side]; t < touch_start_[side + 1]; ++t) {  // a wall is nobody else's
        const int c = touches_[t];
        if (in_tie_[c] || !takes_part(c, NormalVelocityOf(c, contacts[group_contacts[c]]))) continue;
        tied_.push_back(c);
        tie_bodies_of(c);
      }
    }
  };
  for (size_t k = 0, fastest = tied_.size(); k < fastest; ++k) tie_bodies_of(tied_[k]);
  add_where(tied_bodies_.size(), [&](int c, double velocity) { return velocity <= nearly && !IsSpent(c); });
  add_where(tied_bodies_.size(), [&](int c, double velocity) { return Answers(c, group_contacts[c], velocity); });
}

// The tied contacts and the bodies that move in them, as a problem of their own; walls' velocities as drift.
void SequentialResolver::GatherTies(std::span<const int> group_contacts, const ContactFrames& contacts) {
  tied_problem_.Clear();
  place_.resize(locals_.size());
  for (const int side : tied_bodies_) {
    place_[side] = tied_problem_.num_bodies();
    const BounceBody& body = locals_[side];
    qp::BodyTerm term;
    term.mass = 1 / body.inverse_mass;
    term.inverse_inertia = body.inverse_inertia_W;
    term.inertia = body.inverse_inertia_W.inverse();
    term.velocity << body.linear_velocity_W, body.angular_velocity_W;
    tied_problem_.bodies.push_back(term);
  }
  for (const int c : tied_) {
    const Contact& contact = contacts.contacts[group_contacts[c]];
    const Matrix3& frame = contacts.frames[group_contacts[c]];
    const auto [a, b] = sides_[c];
    qp::ContactTerm term;
    const auto add = [&](int side, double sign, int* body, qp::Jacobian* jacobian) {
      if (!is_tied_[side]) {
        term.drift += sign * frame.transpose() * locals_[side].VelocityAt(contact.point_W);
      } else {
        *body = place_[side];
        *jacobian = PointJacobian(locals_[side].position_W, contact, frame, sign);
      }
    };
    add(a, -1, &term.body_a, &term.jacobian_a);
    add(b, 1, &term.body_b, &term.jacobian_b);
    term.drift += frame.transpose() * SurfaceSlip(contact);
    term.friction = contact.friction;
    term.target = Rebound(group_contacts[c], contact, -NormalVelocityOf(c, contact));
    if (term.target == 0) term.target = -ClosingSpeed(contact, time_);
    tied_problem_.contacts.push_back(term);
  }
}

// Coulomb contacts with Newton's rebounds, all at once, at this share of their friction. [J] energy that the answer makes; infinite if
// there is none. Sweeps in some order would favour who comes first: where friction leaves several answers, what is symmetric would not stay so.
double SequentialResolver::SolveTies(std::span<const int> group_contacts, std::span<const Contact> contacts,
                                     double friction_share) {
  const auto before_of = [&](const qp::ContactTerm& contact) {
    Vector3 before = contact.drift;
    if (contact.body_a >= 0) before += contact.jacobian_a * tied_problem_.bodies[contact.body_a].velocity;
    if (contact.body_b >= 0) before += contact.jacobian_b * tied_problem_.bodies[contact.body_b].velocity;
    return before;
  };
  double fastest = 0;  // [m/s] slips included: what slides fast is no more exact than its slip
  for (size_t k = 0; k < tied_.size(); ++k) {
    tied_problem_.contacts[k].friction = friction_share * contacts[group_contacts[tied_[k]]].friction;
    fastest = std::max(fastest, before_of(tied_problem_.contacts[k]).norm());
  }
  const qp::Problem& problem = tied_problem_;
  qp::Solution& solution = tied_solution_;
  qp::Settings settings;
  settings.tolerance = kNegligible;
  settings.effort = {kMostSweeps, true};
  settings.velocity_scale = fastest;
  tie_solver_.Solve(problem, settings, &solution);
  // What misses by less than an approach that is none is an answer, too: no friction at all is a worse one.
  if (solution.status != qp::Status::kSolved &&
      !(solution.status == qp::Status::kInaccurate &&
        qp::CoulombMap(problem, solution.velocities, solution.impulses).max <= threshold_))
    return INFINITY;
  double gain = 0, work = 0, left = 0;  // [J]; left: of what rested no better than that
  for (size_t k = 0; k < tied_.size(); ++k) {
    const qp::ContactTerm& contact = tied_problem_.contacts[k];
    const Vector3 before = before_of(contact), after = qp::ContactVelocity(contact, tied_solution_.velocities.data()),
                  &j = tied_solution_.impulses[k];
    gain += 0.5 * j.dot(before + after);
    work += std::abs(j.dot(before));
    if (Answers(tied_[k], group_contacts[tied_[k]], before[0])) left += std::abs(j[0] * before[0]);
  }
  return gain - kExact * work - left;
}

// Where all of its friction would make energy, the share of it that leaves least: without friction Newton's rebounds make none. Returns
// whether there is an answer.
bool SequentialResolver::LowerFriction(std::span<const int> group_contacts, std::span<const Contact> contacts) {
  const double golden = 0.5 * (std::sqrt(5.0) - 1);
  const auto gain_at = [&](double share) { return SolveTies(group_contacts, contacts, share); };
  double low = 0, high = 1, left = 1 - golden, right = golden, at_left = gain_at(left), at_right = gain_at(right);
  // Where neither is solved, no search finds its way. Without friction nothing is made: who makes some is past the least. (What sticks makes as
  // much at any larger share.)
  while (high - low > kSamePoint && std::min(at_left, at_right) < INFINITY) {
    if (at_left == INFINITY ? at_right > 0 : at_left > 0 || at_left <= at_right) {
      high = right, right = left, at_right = at_left;
      at_left = gain_at(left = high - golden * (high - low));
    } else {
      low = left, left = right, at_left = at_right;
      at_right = gain_at(right = low + golden * (high - low));
    }
  }
  const double least = std::min(at_left, at_right);
  return (least < INFINITY && gain_at(at_left == least ? left : right) <= 0) || gain_at(0) <= 0;
}

// False, and nothing has changed, if there is no answer.
bool SequentialResolver::BounceTogether(std::span<const int> group_contacts, const ContactFrames& contacts,
                                        std::span<Vector3> impulses) {
  GatherTies(group_contacts, contacts);
  const double gain = SolveTies(group_contacts, contacts.contacts, 1);
  if (gain == INFINITY) return false;
  if (gain > 0 && !LowerFriction(group_contacts, contacts.contacts)) return false;
  for (size_t k = 0; k < tied_.size(); ++k) {
    const int number = group_contacts[tied_[k]];
    impulses[number] += tied_solution_.impulses[k];
    ApplyAt(tied_[k], contacts.contacts[number], contacts.frames[number] * tied_solution_.impulses[k]);
  }
  return true;
}

// Whether one of its bodies has had its blows; what comes then is left to the collision problem.
bool SequentialResolver::IsSpent(int c) const {
  return by_body_ && std::max(spent_[sides_[c].first], spent_[sides_[c].second]) >= kMostBlows * (1 - 1e-12);
}

// After a bounce: all contacts of the bodies that it moved.
void SequentialResolver::Requeue(std::span<const int> group_contacts, std::span<const Contact> contacts) {
  for (const int side : tied_bodies_)
    for (int t = touch_start_[side]; t < touch_start_[side + 1]; ++t)
      queue_.Update(touches_[t], IsSpent(touches_[t])
                                     ? INFINITY
                                     : NormalVelocityOf(touches_[t], contacts[group_contacts[touches_[t]]]));
}

double SequentialResolver::Rebound(int number, const Contact& contact, double approach) const {
  return ReboundSpeed(contact, approach, least_rebound_.empty() ? 0 : least_rebound_[number]);
}

int SequentialResolver::Resolve(std::span<const int> group_bodies, std::span<const int> group_contacts,
                                const ContactFrames& contacts, BounceLaw law, const BounceRule& rule,
                                std::span<Body> bodies, std::span<Vector3> impulses) {
  const int num_bodies = static_cast<int>(group_bodies.size());
  const bool exact = law == BounceLaw::kExact;
  by_body_ = exact && rule.limit == kAutoBounceLimit;
  const int limit = by_body_ ? INT_MAX : BounceLimit(rule.limit, num_bodies, static_cast<int>(group_contacts.size()));
  if (limit == 0 || group_contacts.empty()) return 0;
  Load(group_bodies, group_contacts, contacts, bodies);
  threshold_ = rule.threshold;
  walls_answer_ = rule.walls_answer;
  resting_ = rule.resting;
  least_rebound_ = rule.least_rebound;
  tie_ = rule.tie;
  time_ = rule.time;
  spent_.assign(locals_.size(), 0.0);
  keys_.resize(group_contacts.size());
  for (size_t c = 0; c < keys_.size(); ++c)
    keys_[c] = NormalVelocityOf(static_cast<int>(c), contacts.contacts[group_contacts[c]]);
  queue_.Assign(keys_);
  int bounces = 0;
  while (bounces < limit && queue_.top_key() < -rule.threshold) {
    FindTies(group_contacts, contacts.contacts);
    const int c = queue_.top(), number = group_contacts[c];
    const Contact& contact = contacts.contacts[number];
    const bool together = exact && tied_.size() > 1 && BounceTogether(group_contacts, contacts, impulses);
    if (!together) {
      const auto [a, b] = sides_[c];
      tied_bodies_.clear();
      for (const int side : {a, b})
        if (locals_[side].moves()) tied_bodies_.push_back(side);
      Contact as_it_bounces = contact;
      if (Rebound(number, contact, -queue_.top_key()) == 0) as_it_bounces.restitution = 0;
      const Vector3 impulse = BounceImpulse(locals_[a], locals_[b], as_it_bounces, contacts.frames[number], law);
      impulses[number] += impulse;
      ApplyAt(c, contact, contacts.frames[number] * impulse);
    }
    bounces += together ? static_cast<int>(tied_.size()) : 1;
    for (const int side : tied_bodies_) spent_[side] += BounceCost(contact.restitution);
    Requeue(group_contacts, contacts.contacts);
  }
  for (size_t i = 0; i < group_bodies.size() && bounces > 0; ++i) {
    bodies[group_bodies[i]].linear_velocity_W = locals_[i].linear_velocity_W;
    bodies[group_bodies[i]].angular_velocity_W = locals_[i].angular_velocity_W;
  }
  return bounces;
}

}  // namespace islet
