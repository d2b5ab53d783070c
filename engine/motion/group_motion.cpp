#include "engine/motion/group_motion.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <utility>

#include "engine/freezing/certified_freezing.h"
#include "engine/motion/visible_turn.h"
#include "engine/response/suite_frame.h"

namespace islet::motion {
namespace {

constexpr double kCrowded = 40;  // steps for which a group that needs more goes with the crowd

constexpr std::uint8_t kBefore = 1, kNow = 2;  // when a group gave up; who is alone since tries again

std::uint64_t Mixed(std::uint64_t hash, std::uint64_t bits) {
  hash ^= bits;
  hash *= 0x9e3779b97f4a7c15ULL;
  return hash ^ (hash >> 29);
}
std::uint64_t Mixed(std::uint64_t hash, double number) {
  std::uint64_t bits;
  std::memcpy(&bits, &number, sizeof bits);
  return Mixed(hash, bits);
}
std::uint64_t Mixed(std::uint64_t hash, const Vector3& v) { return Mixed(Mixed(Mixed(hash, v.x()), v.y()), v.z()); }

// Of a spin, how fast it is seen to move a point of the body, at most: [m/s], or [m/s^2] of what a torque gives.
double Whirl(const Body& body, const Shape& shape, const Vector3& spin_W) {
  return TurnsInItself(shape) ? 0 : body.radius * VisibleSpin(shape, body.rotation_WB, spin_W).norm();
}

// [m/s] fastest that a point of a body moves, as another one sees it. What turns in itself is not seen to turn.
double SpeedSeen(const Body& body, const Shape& shape, const Body& from, const Shape& of_from) {
  const Vector3 turn = TurnsInItself(of_from) ? Vector3(Vector3::Zero()) : from.angular_velocity_W;
  return (body.linear_velocity_W - from.linear_velocity_W - turn.cross(body.position_W - from.position_W)).norm() +
         Whirl(body, shape, body.angular_velocity_W - turn);
}

// [m/s] of the smaller of two bodies, as the larger one sees it; of two alike the faster.
double SpeedBetween(const Body& x, const Shape& of_x, const Body& y, const Shape& of_y) {
  return std::max(x.radius <= y.radius ? SpeedSeen(x, of_x, y, of_y) : 0.0,
                  y.radius <= x.radius ? SpeedSeen(y, of_y, x, of_x) : 0.0);
}

// [m/s^2] by how much the user's forces and torques bend the way of a point of one body, as the other one sees it, more than weight alone
// bends it in front of a wall.
double PullBetween(const Body& x, const Shape& of_x, const Body& y, const Shape& of_y, const Vector3& gravity_W) {
  const auto pull = [&](const Body& b) -> Vector3 {
    return CanMove(b) ? Vector3(gravity_W + b.force_W / b.mass) : Vector3::Zero();
  };
  const auto twist = [](const Body& b, const Shape& shape) {
    return CanMove(b) && !b.torque_W.isZero(0) ? Whirl(b, shape, SpinOf(b, b.rotation_WB, b.torque_W)) : 0.0;
  };
  return std::max(0.0, (pull(x) - pull(y)).norm() - gravity_W.norm()) + twist(x, of_x) + twist(y, of_y);
}

// [m/s] of a wall, at most, where another body is.
double SpeedAt(const Body& wall, const Body& other) {
  const Vector3 arm = other.position_W - wall.position_W;
  return (wall.linear_velocity_W + wall.angular_velocity_W.cross(arm)).norm() +
         wall.angular_velocity_W.norm() * other.radius;
}

// [m] farthest that a point of the body has moved from there, at most.
double Strayed(const Body& body, const Pose& from) {
  const Quaternion turn = body.rotation_WB * from.rotation_WB.conjugate();
  return (body.position_W - from.position_W).norm() + 2 * std::min(1.0, turn.vec().norm()) * body.radius;
}

}  // namespace

void GroupMemory::Resize(size_t bodies) {
  still.resize(bodies, 0);
  anchor.resize(bodies);
  load.resize(bodies, 0);
  crowded.resize(bodies, 0);
  mark.resize(bodies, kAwake);
}

GroupMotion::GroupMotion(const Settings& settings, parallel::WorkerPool* pool)
    : settings_(settings), pool_(pool), groups_(pool) {
  workers_.resize(pool->num_workers());
}

bool GroupMotion::IsCrowd(std::span<const int> members) const {
  return members.size() > static_cast<size_t>(settings_.group_bodies) ||
         std::any_of(members.begin(), members.end(),
                     [&](int i) { return gave_up_[i] > (members.size() > 1 ? 0 : kBefore); });
}

std::ptrdiff_t GroupMotion::CountCrowd() const { return std::count(crowd_.begin(), crowd_.end(), 1); }

// A body of a crowd may become as fast as the fastest point of it, or a wall that pushes.
void GroupMotion::WidenCrowds(double dt, std::span<const Body> bodies) {
  for (int g = 0; g < groups_.size(); ++g) {
    const std::span<const int> members = groups_.bodies_of(g);
    if (!IsCrowd(members)) continue;
    double fastest = 0;
    for (const int i : members) {
      const Body& b = bodies[i];
      if (!CanMove(b)) continue;
      const Vector3 turned_W = b.torque_W.isZero(0) ? Vector3::Zero() : SpinOf(b, b.rotation_WB, b.torque_W);
      fastest = std::max(fastest, b.linear_velocity_W.norm() + dt * b.force_W.norm() / b.mass +
                                      b.radius * (b.angular_velocity_W.norm() + dt * turned_W.norm()));
    }
    for (int k = 0; k < groups_.num_pairs(g); ++k) {
      const auto [a, b] = groups_.pair(g, k);
      for (const auto& [wall, other] : {std::pair(a, b), std::pair(b, a)})
        if (bodies[wall].kind == BodyKind::kKinematic)
          fastest = std::max(fastest, SpeedAt(bodies[wall], bodies[other]));
    }
    for (const int i : members) rooms_[i] = std::max(rooms_[i], dt * fastest);
  }
}

void GroupMotion::FillGroup(int g, std::span<const Body> bodies, std::span<const Shape> shapes,
                            const GroupMemory& memory, Job* job) const {
  Group& group = job->group;
  const std::span<const int> members = groups_.bodies_of(g);
  job->members.assign(members.begin(), members.end());
  group.numbers.assign(members.begin(), members.end());
  for (int k = 0; k < groups_.num_pairs(g); ++k) {
    const auto [a, b] = groups_.pair(g, k);
    for (const int i : {a, b})
      if (!std::binary_search(members.begin(), members.end(), i)) group.numbers.push_back(i);
  }
  std::sort(group.numbers.begin(), group.numbers.end());
  group.numbers.erase(std::unique(group.numbers.begin(), group.numbers.end()), group.numbers.end());
  const auto place = [&](int number) {
    return static_cast<int>(std::lower_bound(group.numbers.begin(), group.numbers.end(), number) -
                            group.numbers.begin());
  };
  group.bodies.clear();
  group.shapes.clear();
  for (const int i : group.numbers) {
    group.bodies.push_back(bodies[i]);
    group.shapes.push_back(&shapes[i]);
  }
  group.pairs.clear();
  group.remembered.clear();
  group.remembered_force_W.clear();
  for (int k = 0; k < groups_.num_pairs(g); ++k) {
    const auto [a, b] = groups_.pair(g, k);
    group.pairs.push_back({place(a), place(b)});
    Contact first;
    first.body_a = a, first.body_b = b;
    auto c = std::lower_bound(memory.contacts.begin(), memory.contacts.end(), first, EarlierPair);
    for (; c != memory.contacts.end() && c->body_a == a && c->body_b == b; ++c) {
      Contact local = *c;
      local.body_a = place(a), local.body_b = place(b);
      group.remembered.push_back(local);
      group.remembered_force_W.push_back(memory.forces_W[c - memory.contacts.begin()]);
    }
  }
}

// Everything that a step of the group depends on but its length.
std::uint64_t GroupMotion::MarkOf(const Group& group) const {
  std::uint64_t hash = Mixed(0x243f6a8885a308d3ULL, settings_.gravity);
  for (size_t i = 0; i < group.bodies.size(); ++i) {
    const Body& b = group.bodies[i];
    hash = Mixed(hash, static_cast<std::uint64_t>(group.numbers[i]));
    hash = Mixed(hash, static_cast<std::uint64_t>(b.kind));
    hash = Mixed(hash, b.position_W);
    hash = Mixed(Mixed(hash, Vector3(b.rotation_WB.vec())), b.rotation_WB.w());
    hash = Mixed(Mixed(hash, b.linear_velocity_W), b.angular_velocity_W);
    hash = Mixed(Mixed(Mixed(hash, b.force_W), b.torque_W), b.arc_W);
    hash = Mixed(Mixed(Mixed(Mixed(hash, b.mass), b.friction), b.restitution), b.surface_velocity_B);
  }
  for (const GroupPair& pair : group.pairs)
    hash = Mixed(hash, static_cast<std::uint64_t>(pair.a) << 32 | static_cast<std::uint64_t>(pair.b));
  return hash | 1;
}

// A group as it is now, and whether it rests.
void GroupMotion::FillJob(double dt, int g, std::span<const Body> bodies, std::span<const Shape> shapes,
                          const GroupMemory& memory, Job* job) const {
  FillGroup(g, bodies, shapes, memory, job);
  job->mark = MarkOf(job->group);
  job->rests = settings_.freezing == Freezing::kCertified &&
               std::all_of(job->members.begin(), job->members.end(),
                           [&](int i) { return bodies[i].frozen && memory.mark[i] == job->mark; });
  job->done = job->rests;
  if (job->rests) job->outcome.records.clear();
  int spent = 0;
  for (const int i : job->members) spent = std::max(spent, spent_[i]);
  const int most = MostWork(static_cast<int>(job->members.size()));
  job->group.most_work = races_ == Races::kRefused ? static_cast<int>(most * dt / whole_dt_) : most - spent;
}

void GroupMotion::MakeJobs(double dt, std::span<const Body> bodies, std::span<const Shape> shapes,
                           const GroupMemory& memory) {
  std::swap(jobs_, before_);
  num_before_ = num_jobs_;
  crowd_.assign(bodies.size(), 0);
  any_crowd_ = false;
  small_.clear();
  for (int g = 0; g < groups_.size(); ++g) {
    const std::span<const int> members = groups_.bodies_of(g);
    if (!IsCrowd(members)) {
      small_.push_back(g);
      continue;
    }
    for (const int i : members) crowd_[i] = 1;
    any_crowd_ = true;
  }
  num_jobs_ = small_.size();
  if (jobs_.size() < num_jobs_) jobs_.resize(num_jobs_);
  pool_->ForEachOf(num_jobs_, [&](size_t k) { FillJob(dt, small_[k], bodies, shapes, memory, &jobs_[k]); });
  // A group of the round before that is the same has its answer. Both are in order of their first bodies.
  Job* old = before_.data();
  Job* const end = old + num_before_;
  for (Job& job : std::span(jobs_).first(num_jobs_)) {
    while (old != end && old->members[0] < job.members[0]) ++old;
    if (job.done || old == end || !old->done) continue;
    if (old->members == job.members && old->group.numbers == job.group.numbers &&
        old->group.pairs.size() == job.group.pairs.size() && old->mark == job.mark)
      std::swap(job, *old);
  }
}

void GroupMotion::RunJobs(double dt, const MixMaterial& mix, bool record, std::span<const Body> bodies,
                          std::span<const Shape> shapes) {
  pool_->ForEach(static_cast<int>(num_jobs_), [&](int k, int worker) {
    Job& job = jobs_[k];
    if (!job.done) {
      for (Body& b : job.group.bodies) b.frozen = false;
      job.outcome.Clear();
      job.outcome.record = record;
      workers_[worker].stepper.Step(dt, settings_, mix, &job.group, &job.outcome);
      for (const int i : job.members) spent_[i] += races_ == Races::kRefused ? 0 : job.outcome.work;
      job.done = true;
    }
    job.kept = job.rests || KeptToRooms(job, bodies, shapes);
  });
}

// Whether all bodies of a group did; those that did not get more room.
bool GroupMotion::KeptToRooms(const Job& job, std::span<const Body> bodies, std::span<const Shape> shapes) {
  const size_t count = job.group.bodies.size();
  bool kept = true;
  for (size_t k = 0; k < count; ++k) {
    const Body& b = job.group.bodies[k];
    const int i = job.group.numbers[k];
    if (!b.Moves()) continue;
    double begin = 0, farthest = 0;
    bool stays = true;
    for (size_t piece = 0; piece < job.outcome.ends.size(); ++piece) {
      const Path& path = job.outcome.paths[piece * count + k];
      const double duration = job.outcome.ends[piece] - std::exchange(begin, job.outcome.ends[piece]);
      stays = stays && groups_.StaysInRoom(path, duration, shapes[i], i);
      farthest = std::max(farthest, (path.At(duration).position_W - bodies[i].position_W).norm());
    }
    if (!stays) rooms_[i] = std::max(rooms_[i], farthest + b.radius);
    kept = kept && stays;
  }
  return kept;
}

// Whether two bodies of different jobs met on their ways.
bool GroupMotion::Met(double dt, int i, int k) {
  struct Way {
    const Job& job;
    size_t place, piece = 0;
    double begin = 0;
    Way(const Job& of, int number)
        : job(of),
          place(std::lower_bound(of.group.numbers.begin(), of.group.numbers.end(), number) - of.group.numbers.begin()) {
    }
    const Body& body() const { return job.group.bodies[place]; }
    const Shape* shape() const { return job.group.shapes[place]; }
    bool Ended() const { return job.rests || piece >= job.outcome.ends.size(); }  // it stays where it is
    double End(double dt) const { return Ended() ? dt : job.outcome.ends[piece]; }
    Path From(double t) const {
      if (Ended())
        return {{body().position_W, body().rotation_WB},
                Vector3::Zero(),
                Vector3::Zero(),
                Vector3::Zero(),
                Vector3::Zero(),
                0};
      return job.outcome.paths[piece * job.group.bodies.size() + place].From(t - begin);
    }
    void MoveOn(double t) {
      while (!Ended() && job.outcome.ends[piece] <= t) begin = job.outcome.ends[piece++];
    }
  };
  Way a(jobs_[job_of_[i]], i), b(jobs_[job_of_[k]], k);
  const double size = std::min(a.shape()->size(), b.shape()->size());
  for (double t = 0; t < dt;) {
    const double end = std::min(a.End(dt), b.End(dt));
    if (ComeNear({a.shape(), b.shape(), a.From(t), b.From(t), end - t, 0, kTouching * size}, &meeting_)) return true;
    a.MoveOn(end);
    b.MoveOn(end);
    if (a.Ended() && b.Ended()) break;
    t = end;
  }
  return false;
}

// Joins parts whose bodies came near each other. Returns whether there were any.
bool GroupMotion::JoinStrays(double dt) {
  const std::span<const std::pair<int, int>> parted = groups_.parted();
  if (parted.empty()) return false;
  job_of_.assign(crowd_.size(), -1);
  for (size_t k = 0; k < num_jobs_; ++k)
    for (const int i : jobs_[k].members) job_of_[i] = static_cast<int>(k);
  return JoinParted([&](int i, int k) { return Met(dt, i, k); });
}

// Joins those parted pairs of which that holds. Returns whether there were any.
template <typename Holds>
bool GroupMotion::JoinParted(const Holds& holds) {
  const size_t before = joined_.size();
  for (const auto& [i, k] : groups_.parted())
    if (holds(i, k)) joined_.emplace_back(i, k);
  std::sort(joined_.begin(), joined_.end());
  return joined_.size() > before;
}

// What groups could not step for want of work goes with the crowd, for a while, or stays where it is. Returns whether any goes.
bool GroupMotion::LeaveToCrowd(GroupMemory* memory) {
  bool any = false;
  for (const Job& job : std::span(jobs_).first(num_jobs_)) {
    if (job.rests || job.outcome.unstepped == 0 || races_ == Races::kHalted) continue;
    for (const int i : job.members) gave_up_[i] = kNow, memory->crowded[i] = kCrowded;
    any = true;
  }
  return any;
}

void GroupMotion::Begin(Races races, std::span<const Body> bodies, GroupMemory* memory) {
  const size_t n = bodies.size();
  memory->Resize(n);
  rooms_.assign(n, 0.0);
  was_frozen_.resize(n);
  gave_up_.resize(n);
  spent_.resize(n);
  races_ = races;
  if (races == Races::kHalted) spent_ = spent_before_;
  spent_before_ = spent_;
  for (size_t i = 0; i < n; ++i) {
    was_frozen_[i] = bodies[i].frozen;
    gave_up_[i] = memory->crowded[i] > 0 && races == Races::kRefused ? kBefore : 0;
  }
  num_before_ = num_jobs_ = 0;
  joined_.clear();
}

// Groups and crowds, by rooms and by who was met so far. Whom a crowd may meet or push goes with it.
void GroupMotion::FindGroups(double dt, std::span<const Body> bodies, std::span<const Shape> shapes,
                             const ContactFilter& filter, const GroupMemory& memory) {
  const auto find = [&] {
    do {
      groups_.Find(dt, settings_.gravity, bodies, shapes, rooms_, filter);
      groups_.Part(settings_.group_bodies, dt, bodies, shapes, joined_);
      MakeJobs(dt, bodies, shapes, memory);
    } while (any_crowd_ && JoinParted([&](int i, int k) { return crowd_[i] || crowd_[k]; }));
  };
  find();
  if (!any_crowd_) return;
  for (std::ptrdiff_t known = 0, crowd = CountCrowd(); known < crowd; known = crowd, crowd = CountCrowd()) {
    WidenCrowds(dt, bodies);
    find();
  }
}

bool GroupMotion::Step(double dt, Races races, std::span<Body> bodies, std::span<const Shape> shapes,
                       const ContactFilter& filter, const MixMaterial& mix, const ProblemObserver& observer,
                       GroupMemory* memory, StepReport* report) {
  Begin(races, bodies, memory);
  bool kept = false;
  // A round in which somebody leaves its room joins somebody to others, so there are no more rounds than bodies.
  for (size_t round = 0; round <= bodies.size() && !kept; ++round) {
    FindGroups(dt, bodies, shapes, filter, *memory);
    if (any_crowd_ && races == Races::kRefused &&
        (HasRace(dt, bodies, shapes) || groups_.PartsInHalf(settings_.group_bodies, dt, bodies, shapes, gave_up_)))
      return false;
    RunJobs(dt, mix, static_cast<bool>(observer), bodies, shapes);
    kept = std::all_of(jobs_.begin(), jobs_.begin() + static_cast<std::ptrdiff_t>(num_jobs_),
                       [](const Job& job) { return job.kept; });
    kept = !JoinStrays(dt) && kept;
    if (LeaveToCrowd(memory)) kept = false;
  }
  if (!kept && races == Races::kRefused) return false;
  report->motion_failures += !kept;
  CommitAll(dt, bodies, memory, report);
  for (const Job& job : std::span(jobs_).first(num_jobs_))
    for (size_t r = 0; observer && r < job.outcome.records.size(); ++r) observer(job.outcome.records[r]);
  return true;
}

// Poses, velocities and what is remembered, of all groups; who gave up is told.
void GroupMotion::CommitAll(double dt, std::span<Body> bodies, GroupMemory* memory, StepReport* report) {
  for (int g = 0; g < groups_.size(); ++g) {
    const std::span<const int> members = groups_.bodies_of(g);
    if (IsCrowd(members) && members.size() <= static_cast<size_t>(settings_.group_bodies))
      report->gave_up += static_cast<int>(members.size());
  }
  for (double& steps : memory->crowded) steps = std::max(0.0, steps - dt / whole_dt_);
  for (size_t i = 0; i < bodies.size(); ++i)
    if (crowd_[i]) memory->mark[i] = GroupMemory::kAwake;  // a crowd forgets what held it
  impulses_.clear();
  contacts_.clear();
  forces_W_.clear();
  for (Job& job : std::span(jobs_).first(num_jobs_)) Commit(dt, &job, bodies, memory, report);
  // By pair; groups hold pairs of their own.
  order_.resize(contacts_.size());
  for (size_t c = 0; c < order_.size(); ++c) order_[c] = static_cast<int>(c);
  std::sort(order_.begin(), order_.end(), [&](int x, int y) {
    return EarlierPair(contacts_[x], contacts_[y]) || (!EarlierPair(contacts_[y], contacts_[x]) && x < y);
  });
  memory->contacts.resize(order_.size());
  memory->forces_W.resize(order_.size());
  for (size_t c = 0; c < order_.size(); ++c) {
    memory->contacts[c] = contacts_[order_[c]];
    memory->forces_W[c] = forces_W_[order_[c]];
  }
}

// Whether two bodies of a crowd may go through each other within a step, or in and out again: where they move against each other by more than
// they are thick, or the user's forces bend a way by more than what is no contact any more.
bool GroupMotion::HasRace(double dt, std::span<const Body> bodies, std::span<const Shape> shapes) const {
  for (int g = 0; g < groups_.size(); ++g) {
    if (!IsCrowd(groups_.bodies_of(g))) continue;
    for (int k = 0; k < groups_.num_pairs(g); ++k) {
      const auto [a, b] = groups_.pair(g, k);
      const bool thin = shapes[a].kind() != ShapeKind::kHalfSpace && shapes[b].kind() != ShapeKind::kHalfSpace;
      const double way = dt * SpeedBetween(bodies[a], shapes[a], bodies[b], shapes[b]),
                   bend = 0.5 * dt * dt * PullBetween(bodies[a], shapes[a], bodies[b], shapes[b], settings_.gravity),
                   size_a = shapes[a].size(), size_b = shapes[b].size();
      const double apart = (bodies[a].position_W - bodies[b].position_W).norm() - bodies[a].radius - bodies[b].radius;
      const bool races =
          (thin && way + bend > 0.5 * (size_a + size_b)) || std::min(way, bend) > kInside * std::min(size_a, size_b);
      if (races && way + bend > apart) return true;
    }
  }
  return false;
}

void GroupMotion::Commit(double dt, Job* job, std::span<Body> bodies, GroupMemory* memory, StepReport* report) {
  const Group& group = job->group;
  const auto world = [&](Contact c) {
    c.body_a = group.numbers[c.body_a];
    c.body_b = group.numbers[c.body_b];
    return c;
  };
  const std::vector<Contact>& now = job->rests ? group.remembered : job->outcome.touching;
  const std::vector<Vector3>& held = job->rests ? group.remembered_force_W : job->outcome.touching_force_W;
  for (const Contact& c : now) contacts_.push_back(world(c));
  forces_W_.insert(forces_W_.end(), held.begin(), held.end());
  if (job->rests) {
    for (const int i : job->members) memory->mark[i] = job->mark;
    for (size_t c = 0; c < group.remembered.size(); ++c)
      if (!group.remembered_force_W[c].isZero(0))
        impulses_.push_back({world(group.remembered[c]), dt * group.remembered_force_W[c], 0, dt});
    report->frozen += static_cast<int>(job->members.size());
    for (const Contact& c : group.remembered) report->penetration_max = std::max(report->penetration_max, -c.gap);
    report->overlapping += CountOverlapping(group.remembered, [&](const Contact& c) {
      return std::min(group.shapes[c.body_a]->size(), group.shapes[c.body_b]->size());
    });
    return;
  }
  GroupOutcome& outcome = job->outcome;
  for (size_t k = 0; k < group.bodies.size(); ++k) {
    Body& body = bodies[group.numbers[k]];
    if (body.kind != BodyKind::kDynamic || body.removed) continue;
    body = group.bodies[k];
  }
  Rest(dt, job, bodies, memory);
  for (const int i : job->members) {
    (bodies[i].frozen ? report->frozen : report->awake) += 1;
    report->kinetic_energy += bodies[i].KineticEnergy();
  }
  report->pieces += outcome.pieces;
  report->bounces += outcome.bounces;
  report->restitution_lowered += outcome.restitution_lowered;
  report->penetration_max = std::max(report->penetration_max, outcome.overlap);
  report->overlapping += outcome.overlapping;
  report->unstepped = std::max(report->unstepped, outcome.unstepped);
  report->motion_passes = std::max(report->motion_passes, outcome.passes);
  report->motion_failures += outcome.unstepped > 0;
  IslandReport island{.first_body = job->members[0],
                      .bodies = static_cast<int>(job->members.size()),
                      .contacts = static_cast<int>(outcome.touching.size())};
  for (const ResponseOutcome& o : outcome.struck) {
    o.AddTo(&report->collision_qp, &report->ladder);
    report->seconds.collision_qp += o.seconds;
    o.AddTo(Stage::kCollision, &island);
  }
  for (const auto* answers : {&outcome.carried, &outcome.settled}) {
    for (const ResponseOutcome& o : *answers) {
      o.AddTo(&report->static_qp, &report->ladder);
      report->seconds.static_qp += o.seconds;
      o.AddTo(Stage::kStatic, &island);
      island.contacts = std::max(island.contacts, o.contacts);
    }
  }
  report->certificate.Include(island.certificate);
  if (!outcome.touching.empty()) report->Add(island);
  const int first = static_cast<int>(impulses_.size());
  for (LedgerImpulse j : outcome.impulses) {
    j.contact = world(j.contact);
    if (j.corrects >= 0) j.corrects += first;
    j.accuracy = island.certificate.coulomb_map_max;
    impulses_.push_back(j);
  }
}

// What is remembered of the contacts holds every body, while it rests, and what it still moves by the ledger does not miss. No wall that
// is near one of them moves.
bool GroupMotion::IsBalanced(double dt, const Job& job) const {
  const GroupOutcome& outcome = job.outcome;
  const auto stands = [&](int i) { return job.group.bodies[i].Moves() || StandsStill(job.group.bodies[i]); };
  for (const Contact& c : outcome.touching)
    if (!stands(c.body_a) || !stands(c.body_b)) return false;
  for (size_t i = 0; i < job.group.bodies.size(); ++i) {
    const Body& b = job.group.bodies[i];
    if (!b.Moves()) continue;
    Vector3 force = b.mass * settings_.gravity + b.force_W, torque = b.torque_W;
    double loads = force.norm();
    for (size_t c = 0; c < outcome.touching.size(); ++c) {
      const Contact& contact = outcome.touching[c];
      const double sign = contact.body_b == static_cast<int>(i) ? 1 : contact.body_a == static_cast<int>(i) ? -1 : 0;
      if (sign == 0) continue;
      force += sign * outcome.touching_force_W[c];
      torque += sign * (contact.point_W - b.position_W).cross(outcome.touching_force_W[c]);
      loads += outcome.touching_force_W[c].norm();
    }
    const double most = CertifiedFreezing::kCalm * loads;
    if (force.norm() > most || torque.norm() > most * b.radius) return false;
    const Vector3 spin_W = b.InertiaW() * b.angular_velocity_W;
    if (b.mass * b.linear_velocity_W.norm() > most * dt || spin_W.norm() > most * dt * b.radius) return false;
  }
  return true;
}

// A group whose bodies all stand still, and whose step gave them no velocity, would do the same again. Who is near is known from the second
// such step on: rooms of what moves are wider.
void GroupMotion::Rest(double dt, Job* job, std::span<Body> bodies, GroupMemory* memory) const {
  bool rests =
      settings_.freezing == Freezing::kCertified && !job->outcome.touching.empty() && job->outcome.unstepped == 0;
  bool rested = true;
  for (const int i : job->members) {
    Body& body = bodies[i];
    memory->mark[i] = GroupMemory::kAwake;
    const std::uint64_t load = Mixed(Mixed(Mixed(std::uint64_t{1}, settings_.gravity), body.force_W), body.torque_W);
    if (Strayed(body, memory->anchor[i]) > settings_.freeze_travel * body.radius || load != memory->load[i]) {
      memory->anchor[i] = {body.position_W, body.rotation_WB};
      memory->load[i] = load;
      memory->still[i] = 0;
    } else {
      memory->still[i] += dt;
    }
    // What was at rest, and is left so under what has changed, need not wait.
    rests = rests && (memory->still[i] >= settings_.freeze_seconds || was_frozen_[i]);
    rested = rested && was_frozen_[i];
  }
  if (!rests || !IsBalanced(dt, *job)) return;
  for (const int i : job->members) {
    SetTwist({}, &bodies[i]);
    bodies[i].frozen = true;
  }
  if (!rested) return;
  for (size_t k = 0; k < job->group.bodies.size(); ++k) job->group.bodies[k] = bodies[job->group.numbers[k]];
  const std::uint64_t mark = MarkOf(job->group);
  for (const int i : job->members) memory->mark[i] = mark;
}

}  // namespace islet::motion
