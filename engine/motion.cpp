#include "engine/motion.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <utility>

#include "engine/rotation.h"
#include "engine/suite_frame.h"
#include "parallel/worker_pool.h"

namespace islet {
namespace {

// Contacts that are open by more than this share of the deepest overlap are left to the next pass. Measured on cubeglass in
// full flow: 2 joins all cubes in flight into one dense problem and costs nine times as much as 0.05, which adds a quarter
// more passes.
constexpr double kCloseShare = 0.05;

// Restitution above which lifts are paid for. Below it bounces lose more than lifts give, and a correction is known to a tenth of
// the overlap tolerance only: who pays for it has a velocity that depends on the numbers of the bodies (1e-3 m/s in a heap).
constexpr double kElastic = 0.8;

constexpr int kFlightPasses = 8;     // later ones correct flying bodies like others, and keep what they found
constexpr int kPolishingPasses = 4;  // for moments of impacts closer than the overlap tolerance

constexpr int kPerTask = 256;  // bodies or contacts

double ToleranceOf(const Contact& c, std::span<const double> tolerances) {
  return std::min(tolerances[c.body_a], tolerances[c.body_b]);
}

// [m] that nobody corrects.
double SlightOverlap(const Contact& c, std::span<const double> tolerances) { return 0.5 * ToleranceOf(c, tolerances); }

}  // namespace

Mover::Mover(const Settings& settings, parallel::WorkerPool* pool) : settings_(settings), pool_(pool) {
  correctors_.reserve(pool->num_workers());
  for (int i = 0; i < pool->num_workers(); ++i) correctors_.emplace_back(settings.ladder);
}

LadderReport Mover::TakeLadder() {
  LadderReport sum = std::exchange(spared_, {});
  for (Corrector& corrector : correctors_) sum.Include(corrector.TakeReport());
  return sum;
}

void Mover::PlanFreeMotion(const MotionPlan& plan, std::span<const Body> bodies) {
  planned_.assign(bodies.size(), {});
  pool_->ForEachOf(bodies.size(), kPerTask, [&](size_t i) {
    const Body& body = bodies[i];
    if (body.removed) return;
    if (body.kind == BodyKind::kKinematic) {
      planned_[i] = {plan.dt * body.linear_velocity_W, plan.dt * body.angular_velocity_W};
    } else if (body.Moves()) {
      planned_[i].linear = 0.5 * plan.durations[i] * (plan.before[i].linear_W + body.linear_velocity_W);
      planned_[i].angular = FreeRotation(body.inertia_B, body.rotation_WB,
                                         0.5 * (plan.before[i].angular_W + body.angular_velocity_W), plan.durations[i]);
    }
  });
}

std::span<const Vector3> Mover::PlanTravel(const MotionPlan& plan, std::span<const Body> bodies) {
  PlanFreeMotion(plan, bodies);
  travel_.resize(bodies.size());
  for (size_t i = 0; i < bodies.size(); ++i) travel_[i] = planned_[i].linear;
  return travel_;
}

// With the whole turn of the points, not its first order: a cube may turn by a third of a radian in a step.
void Mover::PredictGaps(std::span<const Body> bodies, const std::vector<Contact>& contacts) {
  turns_.resize(bodies.size());
  pool_->ForEachOf(bodies.size(), kPerTask, [&](size_t i) { turns_[i] = TurnLessOne(planned_[i].angular); });
  const auto way = [&](int i, const Contact& c) -> Vector3 {
    return planned_[i].linear + turns_[i] * (c.point_W - bodies[i].position_W);
  };
  gaps_.resize(contacts.size());
  pool_->ForEachOf(contacts.size(), kPerTask, [&](size_t k) {
    const Contact& c = contacts[k];
    gaps_[k] = c.gap + c.normal_W.dot(way(c.body_b, c) - way(c.body_a, c));
  });
}

// Moves the flying bodies to the moments at which they meet walls: planned_ takes them there from where they are now, and
// gaps_ are those that are left.
void Mover::PlanFlights(int pass, std::span<const double> tolerances, std::span<const Body> bodies,
                        const std::vector<Contact>& contacts) {
  PredictGaps(bodies, contacts);
  flights_move_ = flights_.FindMoments(pass, contacts, gaps_, tolerances, bodies, &handled_) || pass == 0;
  flown_.resize(bodies.size());
  if (!flights_move_) return;
  bool any = false;
  for (size_t i = 0; i < bodies.size(); ++i) {
    if (!flights_.flies(static_cast<int>(i))) continue;
    any = true;
    Body there = bodies[i];
    flights_.Place(static_cast<int>(i), &there);
    planned_[i].linear = there.position_W - bodies[i].position_W;
    planned_[i].angular = Log(there.rotation_WB * bodies[i].rotation_WB.conjugate());
    flown_[i] = planned_[i];
  }
  if (any) PredictGaps(bodies, contacts);
}

// Puts the flying bodies where their flights take them. What a correction moves besides is no flight any more: planned_ keeps
// that correction for Apply.
void Mover::GroundFlights(bool all, std::span<Body> bodies) {
  for (size_t i = 0; i < bodies.size(); ++i) {
    const int number = static_cast<int>(i);
    if (!flights_.flies(number)) continue;
    if (flights_move_) {
      flights_.Place(number, &bodies[i]);
      planned_[i].linear -= flown_[i].linear;
      planned_[i].angular -= flown_[i].angular;
    }
    free_turns_[i].setZero();
    if (all || !planned_[i].linear.isZero(0) || !planned_[i].angular.isZero(0)) flights_.Ground(number);
  }
}

// Bodies that turn into a wall go there and no farther.
void Mover::StopShort(const MotionPlan& plan, std::span<const double> tolerances, std::span<const Body> bodies,
                      const std::vector<Contact>& contacts) {
  if (settings_.bounce_law != BounceLaw::kExact)
    return;  // by the paper's all bodies hit at the end of a step, also flying ones
  ways_.resize(bodies.size());
  for (size_t i = 0; i < bodies.size(); ++i)
    ways_[i] = planned_[i].linear.norm() + bodies[i].radius * planned_[i].angular.norm();
  if (!stops_.FindCandidates(contacts, tolerances, plan.flies, ways_, bodies)) return;
  PredictGaps(bodies, contacts);
  stops_.FindMoments(contacts, gaps_, tolerances);
  for (size_t i = 0; i < bodies.size(); ++i) {
    planned_[i].linear *= stops_.share(static_cast<int>(i));
    planned_[i].angular *= stops_.share(static_cast<int>(i));
  }
}

MotionOutcome Mover::Move(const MotionPlan& plan, std::span<const double> tolerances, const DetectContacts& detect,
                          std::span<Body> bodies, std::vector<Contact>* contacts) {
  assert(planned_.size() == bodies.size());
  owes_ = plan.owes;
  StopShort(plan, tolerances, bodies, *contacts);
  flights_.Begin(plan.durations, plan.flies, plan.before, bodies);
  start_.resize(bodies.size());
  for (size_t i = 0; i < bodies.size(); ++i) start_[i] = {bodies[i].position_W, bodies[i].rotation_WB};
  free_turns_.resize(bodies.size());
  for (size_t i = 0; i < bodies.size(); ++i) free_turns_[i] = planned_[i].angular;
  free_way_.resize(bodies.size());
  for (size_t i = 0; i < bodies.size(); ++i) free_way_[i] = planned_[i].linear.norm();
  shifts_.assign(bodies.size(), {});
  shifted_pairs_.clear();
  shifted_contacts_.clear();
  earlier_.Clear();
  MotionOutcome outcome;
  outcome.reached = false;
  const bool asks_all = !settings_.ladder.Has(qp::Rung::kFreeMotion);
  for (outcome.passes = 0;; ++outcome.passes) {
    const std::vector<Contact>& near = outcome.passes <= kFlightPasses ? *contacts : earlier_.With(*contacts, bodies);
    PlanFlights(outcome.passes, tolerances, bodies, near);
    const bool corrected = !outcome.reached && Correct(asks_all && outcome.passes == 0, tolerances, bodies, near);
    if (outcome.passes > 0 && !corrected && !flights_move_) break;
    GroundFlights(outcome.passes >= kFlightPasses, bodies);
    if (corrected) RememberSpins(bodies, near);
    Apply(bodies);
    if (corrected) RestoreSpins(bodies);
    if (corrected) RememberCorrections(near);
    travel_.resize(bodies.size());
    for (size_t i = 0; i < bodies.size(); ++i) {
      travel_[i] = bodies[i].Moves() || bodies[i].kind == BodyKind::kKinematic
                       ? Vector3(plan.dt * bodies[i].linear_velocity_W)
                       : Vector3::Zero();
    }
    detect(travel_, contacts);
    planned_.assign(bodies.size(), {});
    Judge(tolerances, *contacts, &outcome);
    if (outcome.passes >= kFlightPasses) earlier_.Keep(*contacts, tolerances, bodies);
    if (outcome.passes >= settings_.motion_passes) break;
    if (outcome.reached && (!flights_.AnyStopped() || outcome.passes >= kPolishingPasses)) break;
  }
  paid_.clear();
  if (outcome.reached) {
    PayForLifts(bodies);
  } else {
    HoldBack(tolerances, detect, bodies, contacts, &outcome);
  }
  return outcome;
}

MotionOutcome Mover::Stay(const MotionPlan& plan, std::span<const double> tolerances, std::span<const Body> bodies,
                          const std::vector<Contact>& contacts) {
  flights_.Begin(plan.durations, plan.flies, plan.before, bodies);
  paid_.clear();
  MotionOutcome outcome;
  Judge(tolerances, contacts, &outcome);
  return outcome;
}

void Mover::Judge(std::span<const double> tolerances, const std::vector<Contact>& contacts, MotionOutcome* outcome) {
  outcome->penetration_max = 0;
  outcome->reached = true;
  for (const Contact& c : contacts) {
    outcome->penetration_max = std::max(outcome->penetration_max, -c.gap);
    outcome->reached = outcome->reached && -c.gap <= ToleranceOf(c, tolerances);
  }
}

// The passes did not part all bodies: nearly always one turns by more than a radian in the step and ends inside a wall, from
// where no correction finds out. It stays where the step began, as do those that then overlap it, and spins at half the
// speed, so that it does not fail for ever. Undone if that overlaps more: a kinematic body came along.
void Mover::HoldBack(std::span<const double> tolerances, const DetectContacts& detect, std::span<Body> bodies,
                     std::vector<Contact>* contacts, MotionOutcome* outcome) {
  const MotionOutcome before = *outcome;
  end_.resize(bodies.size());
  for (size_t i = 0; i < bodies.size(); ++i) end_[i] = {bodies[i].position_W, bodies[i].rotation_WB};
  held_.assign(bodies.size(), 0);
  for (int round = 0; round < settings_.motion_passes && !outcome->reached; ++round) {
    bool holds = false;
    const auto hold = [&](int i) {
      if (held_[i] || !bodies[i].Moves()) return;
      held_[i] = 1;
      holds = true;
      bodies[i].position_W = start_[i].position_W;
      bodies[i].rotation_WB = start_[i].rotation_WB;
    };
    for (const Contact& c : *contacts) {
      if (-c.gap <= ToleranceOf(c, tolerances)) continue;
      hold(c.body_a);
      hold(c.body_b);
    }
    if (!holds) break;
    detect(travel_, contacts);
    Judge(tolerances, *contacts, outcome);
  }
  if (outcome->penetration_max < before.penetration_max) {
    for (size_t i = 0; i < bodies.size(); ++i) {
      if (!held_[i]) continue;
      bodies[i].angular_velocity_W *= 0.5;
      ++outcome->held_back;
    }
    return;
  }
  for (size_t i = 0; i < bodies.size(); ++i) {
    if (!held_[i]) continue;
    bodies[i].position_W = end_[i].position_W;
    bodies[i].rotation_WB = end_[i].rotation_WB;
  }
  detect(travel_, contacts);
  *outcome = before;
}

// Changes planned_ of the islands in which a contact would overlap by more than half its tolerance. False if none would, or if
// there is no way out. ask_all: the others are asked, too, and stay as they are.
bool Mover::Correct(bool ask_all, std::span<const double> tolerances, std::span<const Body> bodies,
                    const std::vector<Contact>& contacts) {
  double deepest = 0;
  for (size_t c = 0; c < contacts.size(); ++c)
    if (!handled_[c] && -gaps_[c] > SlightOverlap(contacts[c], tolerances)) deepest = std::max(deepest, -gaps_[c]);
  if (deepest == 0 && !ask_all) {
    CountSpared(contacts.size());
    return false;
  }
  FindIslands(deepest, tolerances, bodies, contacts);
  for (int i = 0; i < partition_.num_islands(); ++i) {
    const int first = partition_.contact_start[i], last = partition_.contact_start[i + 1];
    for (int k = first; k < last; ++k) {
      const int c = island_contacts_[k];
      if (-gaps_[c] > SlightOverlap(contacts[c], tolerances)) wanted_[i] = 1;
    }
    if (!wanted_[i] && last > first) CountSpared(last - first);
  }
  pool_->ForEach(partition_.num_islands(), [&](int island, int worker) {
    const int first = partition_.contact_start[island];
    if (first == partition_.contact_start[island + 1] || !(wanted_[island] || ask_all)) return;
    const double scale = deepest > 0 ? deepest : SlightOverlap(contacts[island_contacts_[first]], tolerances);
    CorrectIsland(island, worker, scale, bodies, contacts);
  });
  return std::any_of(corrected_.begin(), corrected_.end(), [](std::uint8_t corrected) { return corrected != 0; });
}

void Mover::CountSpared(size_t contacts) {
  if (settings_.ladder.Has(qp::Rung::kFreeMotion))
    spared_.Add(qp::Rung::kFreeMotion, 1, static_cast<std::int64_t>(contacts));
}

// What is joined by contacts whose predicted gaps are small beside the deepest overlap; where there is none, beside a slight one.
void Mover::FindIslands(double deepest, std::span<const double> tolerances, std::span<const Body> bodies,
                        const std::vector<Contact>& contacts) {
  cut_.resize(bodies.size());
  for (size_t i = 0; i < bodies.size(); ++i) cut_[i] = !bodies[i].Moves();
  pairs_.clear();
  linked_.clear();
  frames_.resize(contacts.size());
  for (size_t c = 0; c < contacts.size(); ++c) {
    const double overlap = deepest > 0 ? deepest : SlightOverlap(contacts[c], tolerances);
    if (gaps_[c] > kCloseShare * overlap || handled_[c]) continue;
    pairs_.emplace_back(contacts[c].body_a, contacts[c].body_b);
    linked_.push_back(static_cast<int>(c));
    frames_[c] = ContactFrame(contacts[c].normal_W);
  }
  islands::BuildPartition({cut_, pairs_}, &partition_);
  island_contacts_.resize(partition_.contacts.size());
  for (size_t k = 0; k < island_contacts_.size(); ++k) island_contacts_[k] = linked_[partition_.contacts[k]];
  for (auto* flags : {&wanted_, &corrected_}) flags->assign(partition_.num_islands(), 0);
  corrections_.assign(bodies.size(), {});
}

void Mover::CorrectIsland(int island, int worker, double scale, std::span<const Body> bodies,
                          const std::vector<Contact>& contacts) {
  Corrector& corrector = correctors_[worker];
  const std::span<const int> members = partition_.bodies_of(island);
  const int first = partition_.contact_start[island], last = partition_.contact_start[island + 1];
  const std::span<const int> numbers = std::span<const int>(island_contacts_).subspan(first, last - first);
  const bool found = corrector.Solve({members, numbers, {contacts, frames_}, gaps_, free_way_, scale}, bodies);
  if (!wanted_[island]) return;
  corrected_[island] = found;
  for (size_t i = 0; found && i < members.size(); ++i) {
    const Displacement correction = corrections_[members[i]] = corrector.CorrectionOf(i);
    planned_[members[i]].linear += correction.linear;
    planned_[members[i]].angular += correction.angular;
  }
}

// Of the islands that this pass corrects and that touch nothing immovable: nobody else could take up their spin.
void Mover::RememberSpins(std::span<const Body> bodies, const std::vector<Contact>& contacts) {
  spins_.assign(partition_.num_islands(), {});
  free_.assign(wanted_.begin(), wanted_.end());
  for (int i = 0; i < partition_.num_islands(); ++i) {
    for (int k = partition_.contact_start[i]; k < partition_.contact_start[i + 1] && free_[i]; ++k) {
      const Contact& contact = contacts[island_contacts_[k]];
      if (cut_[contact.body_a] || cut_[contact.body_b]) free_[i] = 0;
    }
    if (free_[i]) spins_[i] = SpinOf(partition_.bodies_of(i), bodies);
  }
}

void Mover::RestoreSpins(std::span<Body> bodies) {
  for (int i = 0; i < partition_.num_islands(); ++i) {
    if (!free_[i]) continue;
    RestoreSpin(spins_[i], partition_.bodies_of(i), bodies);
    for (const int member : partition_.bodies_of(i)) flights_.Ground(member);
  }
}

// What the passes of this step corrected, one after the other.
void Mover::RememberCorrections(const std::vector<Contact>& contacts) {
  for (size_t i = 0; i < corrections_.size(); ++i) {
    shifts_[i].linear += corrections_[i].linear;
    shifts_[i].angular += corrections_[i].angular;
  }
  for (int i = 0; i < partition_.num_islands(); ++i) {
    for (int k = partition_.contact_start[i]; k < partition_.contact_start[i + 1] && wanted_[i]; ++k) {
      const int c = island_contacts_[k];
      shifted_pairs_.emplace_back(contacts[c].body_a, contacts[c].body_b);
      shifted_contacts_.push_back(contacts[c]);
      shifted_contacts_.back().gap = gaps_[c];
    }
  }
}

// Over all passes: what one pushes down another one lifts again. A centre that leans on nothing stays, and gravity does no work
// on it. A wall that moves does work itself, and what is frozen could not say what it took. Not where bodies are held back: they
// do not keep their height.
void Mover::PayForLifts(std::span<Body> bodies) {
  const auto is_elastic = [](const Contact& contact) { return contact.restitution > kElastic; };
  if (std::none_of(shifted_contacts_.begin(), shifted_contacts_.end(), is_elastic)) return;
  islands::BuildPartition({cut_, shifted_pairs_}, &partition_);
  for (int i = 0; i < partition_.num_islands(); ++i) {
    const Contact* deepest = nullptr;  // of those with fixed bodies
    bool leans = false, driven = false, elastic = false;
    for (const int k : partition_.contacts_of(i)) {
      const Contact& contact = shifted_contacts_[k];
      elastic = elastic || is_elastic(contact);
      if (!cut_[contact.body_a] && !cut_[contact.body_b]) continue;
      const Body& wall = bodies[cut_[contact.body_a] ? contact.body_a : contact.body_b];
      leans = true;
      driven = driven || !StandsStill(wall);
      if (wall.kind != BodyKind::kDynamic && (deepest == nullptr || contact.gap < deepest->gap)) deepest = &contact;
    }
    if (!elastic || driven || (leans && deepest == nullptr)) continue;
    const Lift lift{partition_.bodies_of(i), owes_, shifts_, kTurnWeight, leans};
    const Vector3 taken = PayForLift(settings_.gravity, lift, bodies);
    if (!taken.isZero(0) && leans) paid_.push_back({*deepest, cut_[deepest->body_b] ? Vector3(-taken) : taken});
  }
}

// The free turn keeps the angular momentum. A correction only puts the body elsewhere: it turns the velocity along with the
// body, so that the kinetic energy stays.
void Mover::Apply(std::span<Body> bodies) {
  pool_->ForEachOf(bodies.size(), kPerTask, [&](size_t i) {
    Body& body = bodies[i];
    body.position_W += planned_[i].linear;
    if (planned_[i].angular.isZero(0)) return;
    const Quaternion turned = Quaternion(Exp(planned_[i].angular) * body.rotation_WB).normalized();
    if (body.Moves()) {
      const Quaternion free = Exp(free_turns_[i]) * body.rotation_WB;
      body.angular_velocity_W = AngularVelocityAfter(body.inertia_B, body.rotation_WB, body.angular_velocity_W, free);
      if (!(free_turns_[i] - planned_[i].angular).isZero(0))
        body.angular_velocity_W = turned * (free.conjugate() * body.angular_velocity_W);
    }
    body.rotation_WB = turned;
  });
  for (Vector3& turn : free_turns_) turn.setZero();  // later passes only correct
}

}  // namespace islet
