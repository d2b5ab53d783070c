#include "engine/ledger.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <utility>

#include <Eigen/Eigenvalues>

#include "engine/rotation.h"
#include "parallel/worker_pool.h"
#include "qp/elementary.h"
#include "qp/smallness.h"

namespace islet {
namespace {

constexpr double kTurn =
    0.04;  // [rad] of one step of a rotation's integration, and at most between two looks at what goes through it
constexpr double kCore = 0.9;  // of a shape: what no other body's centre may pass
constexpr int kMostLooks =
    100000;  // at one pair in a step; a way that needs more cannot be judged, and is not taken for a clean one

bool IsOurs(const Body& body) { return body.kind == BodyKind::kDynamic && !body.removed; }

// Whether a body is frozen all the while: it is where it was, and what acts on it over the step must cancel.
bool StandsFrozen(const Body& before, const Body& after) {
  return before.frozen && after.frozen && before.position_W == after.position_W &&
         before.rotation_WB.coeffs() == after.rotation_WB.coeffs();
}

// In the frame of W.
Vector3 SpinOf(const Matrix3& inverse_inertia_B, const Quaternion& rotation, const Vector3& momentum_W) {
  return rotation * Vector3(inverse_inertia_B * (rotation.conjugate() * momentum_W));
}

// The rotation of a free body after a time. Its momentum L stays, and with principal moments A <= B <= C its energy is
//   L^2 / 2B  +  (1/A - 1/B) La^2 / 2  +  (1/C - 1/B) Lc^2 / 2
// Each part alone turns the body evenly, about L, about its axis of A, about that of C. They are composed to fourth order
// [Yos90], none by more than kTurn. However thin, a body whose other two moments are alike turns exactly.
Quaternion Turn(const Body& body, const Quaternion& rotation, const Vector3& momentum_W, double time) {
  if (momentum_W.isZero(0) || time <= 0) return rotation;
  const double inertia = body.inertia_B(0, 0);
  if (body.inertia_B == Matrix3(Vector3::Constant(inertia).asDiagonal()))  // a ball or a cube turns evenly
    return (Exp(time / inertia * momentum_W) * rotation).normalized();
  const Eigen::SelfAdjointEigenSolver<Matrix3> principal(body.inertia_B);
  const Vector3 pace = principal.eigenvalues().cwiseInverse();
  Matrix3 axes = principal.eigenvectors();
  if (axes.determinant() < 0) axes.col(1) *= -1;
  const Quaternion to_principal(axes);
  Quaternion q = rotation * to_principal;
  const auto about = [&](int axis, double h) {
    const double along = (q.conjugate() * momentum_W)[axis];
    q = q * Exp(h * (pace[axis] - pace[1]) * along * Vector3::Unit(axis));
  };
  constexpr double kOuter = 1.3512071919596578;  // 1 / (2 - 2^(1/3)), of Yoshida's triple
  const double spin = pace.cwiseProduct(q.conjugate() * momentum_W).norm();
  const int steps = 1 + static_cast<int>(std::min(1e4, spin * time / kTurn));
  for (int k = 0; k < steps; ++k) {
    for (const double share : {kOuter, 1 - 2 * kOuter, kOuter}) {
      const double h = share * time / steps;
      about(0, 0.5 * h);
      about(2, h);
      about(0, 0.5 * h);
    }
  }
  return (Exp(time * pace[1] * momentum_W) * q * to_principal.conjugate()).normalized();
}

double KineticEnergy(const Body& body, const Vector3& angular_momentum_W) {
  return 0.5 * (body.mass * body.linear_velocity_W.squaredNorm() + body.angular_velocity_W.dot(angular_momentum_W));
}

// [J] of what drives the surfaces that an impulse acts on: each works where friction drags it back.
double WorkOfBelts(const LedgerStep& step, const LedgerImpulse& j) {
  double work = 0;
  for (const auto& [number, sign] : {std::pair{j.contact.body_a, 1.0}, std::pair{j.contact.body_b, -1.0}}) {
    const Body& body = step.before[number];
    if (body.surface_velocity_B.isZero(0)) continue;
    const Quaternion turned = Exp((j.time + 0.5 * j.duration) * body.angular_velocity_W) * body.rotation_WB;
    const Vector3 belt = turned * body.surface_velocity_B;
    work += sign * (j.impulse_W.dot(belt) - j.contact.normal_W.dot(j.impulse_W) * j.contact.normal_W.dot(belt));
  }
  return work;
}

double SignOn(const LedgerImpulse& impulse, int body) { return impulse.contact.body_b == body ? 1 : -1; }

int RootOf(std::vector<int>* parent, int i) {
  while ((*parent)[i] != i) i = (*parent)[i] = (*parent)[(*parent)[i]];
  return i;
}

// The core of a capsule or cylinder: what is within kCore of its girth of its axis, as far as kCore of its length.
bool CrossesRoundCore(const Shape& shape, const Vector3& a, const Vector3& way) {
  double enter = 0, leave = 1;  // of the way, while it is between the ends
  const double length = kCore * shape.half_extents().z(), girth = kCore * shape.girth();
  for (const double sign : {-1.0, 1.0}) {
    const double beyond = sign * a.z() - length, slope = sign * way.z();
    if (slope == 0 && beyond > 0) return false;
    if (slope < 0) enter = std::max(enter, -beyond / slope);
    if (slope > 0) leave = std::min(leave, -beyond / slope);
  }
  if (enter >= leave) return false;
  const Eigen::Vector2d from = (a + enter * way).head<2>(), on = (leave - enter) * way.head<2>();
  const double u = std::clamp(-from.dot(on) / std::max(on.squaredNorm(), 1e-300), 0.0, 1.0);
  return (from + u * on).norm() < girth;
}

// Whether the straight way from a to b, in the frame of a shape, goes through its core.
bool CrossesCore(const Shape& shape, const Vector3& a, const Vector3& b) {
  const Vector3 way = b - a;
  if (shape.kind() == ShapeKind::kSphere) {
    const double u = std::clamp(-a.dot(way) / std::max(way.squaredNorm(), 1e-300), 0.0, 1.0);
    return (a + u * way).norm() < kCore * shape.radius();
  }
  double enter = 0, leave = 1;                           // of the way
  if (shape.kind() == ShapeKind::kCustom) return false;  // only its owner knows
  if (shape.HasAxis()) return CrossesRoundCore(shape, a, way);
  const Polytope& polytope = shape.polytope();
  for (size_t f = 0; f < polytope.faces.size(); ++f) {
    const Vector3& normal = polytope.face_normals[f];
    const double most = kCore * normal.dot(polytope.vertices[polytope.faces[f][0]]);
    const double at = normal.dot(a) - most, slope = normal.dot(way);
    if (slope == 0) {
      if (at > 0) enter = 2;
    } else if (slope < 0) {
      enter = std::max(enter, -at / slope);
    } else {
      leave = std::min(leave, -at / slope);
    }
  }
  return enter < leave;
}

}  // namespace

Ledger LedgerKeeper::Judge(const LedgerStep& step) {
  const size_t n = step.before.size();
  start_.assign(n + 1, 0);
  for (const LedgerImpulse& j : step.impulses) ++start_[j.contact.body_a + 1], ++start_[j.contact.body_b + 1];
  for (size_t i = 0; i < n; ++i) start_[i + 1] += start_[i];
  places_.resize(2 * step.impulses.size());
  std::vector<int>& next = parent_;
  next.assign(start_.begin(), start_.end());
  for (size_t k = 0; k < step.impulses.size(); ++k) {
    const Contact& c = step.impulses[k].contact;
    places_[next[c.body_a]++] = places_[next[c.body_b]++] = static_cast<int>(k);
  }
  accounts_.resize(n);
  pool_->ForEachOf(n, [&](size_t i) { JudgeBody(step, static_cast<int>(i), &accounts_[i]); });
  Ledger ledger;
  for (size_t i = 0; i < n; ++i) {
    if (!IsOurs(step.before[i])) continue;
    const int body = static_cast<int>(i);
    ledger.momentum_unexplained.Include(accounts_[i].momentum, body);
    ledger.angular_momentum_unexplained.Include(accounts_[i].angular, body);
    ledger.displacement_without_velocity.Include(accounts_[i].way, body);
  }
  JudgeIslands(step, &ledger);
  JudgeSides(step, &ledger);
  return ledger;
}

// The centre's way under gravity, external force and the reported impulses: parabolas between moments at which a force
// begins or ends, or a blow falls. What stands frozen stays where it is, and ends with the velocity that all that would give.
void LedgerKeeper::FindCourse(const LedgerStep& step, int number, Account* account) const {
  const Body& body = step.before[number];
  std::vector<Moment>& course = account->course;
  course.clear();
  if (!IsOurs(body)) {
    const Vector3 &v = body.linear_velocity_W, beyond = 0.5 * step.dt * body.arc_W;
    course.push_back({0, body.position_W, v - beyond});
    course.push_back({step.dt, body.position_W + step.dt * v, v + beyond});
    return;
  }
  const Vector3 constant = step.gravity_W + body.force_W / body.mass;
  const std::span<const int> own(places_.data() + start_[number], start_[number + 1] - start_[number]);
  if (StandsFrozen(body, step.after[number])) {
    course.push_back({0, body.position_W, Vector3::Zero()});
    course.push_back({step.dt, body.position_W, step.dt * constant});
    for (const int k : own)
      course.back().velocity_W += SignOn(step.impulses[k], number) / body.mass * step.impulses[k].impulse_W;
    return;
  }
  thread_local std::vector<double> times;
  times.assign({0, step.dt});
  for (const int k : own) {
    times.push_back(step.impulses[k].time);
    times.push_back(step.impulses[k].time + step.impulses[k].duration);
  }
  std::sort(times.begin(), times.end());
  times.erase(std::unique(times.begin(), times.end(), [&](double x, double y) { return y - x < kExact * step.dt; }),
              times.end());
  // Every impulse between the moments that its own fall together with, so that none of it is lost where they do.
  thread_local std::vector<std::pair<size_t, size_t>> when;
  when.clear();
  const auto moment_of = [&](double time) {
    return std::upper_bound(times.begin(), times.end(), time) - times.begin() - 1;
  };
  for (const int k : own) {
    const LedgerImpulse& j = step.impulses[k];
    when.emplace_back(moment_of(j.time), moment_of(j.time + j.duration));
  }
  Moment now{0, body.position_W, body.linear_velocity_W};
  for (size_t s = 0; s < times.size(); ++s) {
    now.time = times[s];
    Vector3 acceleration = constant;
    for (size_t k = 0; k < own.size(); ++k) {
      const auto [begin, end] = when[k];
      if (s < begin || s > end) continue;
      const LedgerImpulse& j = step.impulses[own[k]];
      const Vector3 gain = SignOn(j, number) / body.mass * j.impulse_W;
      if (begin == end && begin == s) now.velocity_W += gain;
      if (s < end) acceleration += gain / (times[end] - times[begin]);
    }
    course.push_back(now);
    if (s + 1 == times.size()) break;
    const double h = times[s + 1] - times[s];
    now.position_W += h * now.velocity_W + 0.5 * h * h * acceleration;
    now.velocity_W += h * acceleration;
  }
}

Vector3 LedgerKeeper::PositionAt(const Account& account, double time) const {
  const std::vector<Moment>& course = account.course;
  size_t s = 0;
  while (s + 2 < course.size() && course[s + 1].time <= time) ++s;
  if (course.size() < 2) return course[0].position_W;
  const Moment &a = course[s], &b = course[s + 1];
  const double h = b.time - a.time;
  if (h <= 0) return a.position_W;
  const double u = std::clamp((time - a.time) / h, 0.0, 1.0);
  return a.position_W + u * h * a.velocity_W + u * u * (b.position_W - a.position_W - h * a.velocity_W);
}

Vector3 LedgerKeeper::CentreAt(const Account& account, const LedgerImpulse& j) const {
  if (j.duration == 0) return PositionAt(account, j.time);
  return 0.5 * (PositionAt(account, j.time) + PositionAt(account, j.time + j.duration));
}

// [m] from the middle of the centre's chord, while an impulse acts, to the mean of its places: of a parabola by Simpson's rule.
Vector3 LedgerKeeper::OffChord(const Account& account, const LedgerImpulse& j) const {
  return 2.0 / 3 * (PositionAt(account, j.time + 0.5 * j.duration) - CentreAt(account, j));
}

// What acts at a wall that turns works beside the velocities at the middle of the chord: the wall goes by under the mean place of the
// centre. What speeds that up along its way, as the wall sees it, does not count.
void LedgerKeeper::JudgeTurningWall(const LedgerImpulse& j, const Body& wall, const Vector3& velocity_W, double sign,
                                    Account* account) const {
  if (wall.angular_velocity_W.isZero(0) || j.duration == 0) return;
  const Vector3 off = OffChord(*account, j) + 1.0 / 12 * j.duration * j.duration * wall.arc_W,
                way =
                    PositionAt(*account, j.time + j.duration) - PositionAt(*account, j.time) - j.duration * velocity_W,
                friction_W = j.impulse_W - j.contact.normal_W.dot(j.impulse_W) * j.contact.normal_W;
  const double square = way.squaredNorm();
  const Vector3 across = square > 0 ? Vector3(off - off.dot(way) / square * way) : off;
  account->gain -= sign * j.impulse_W.dot(wall.angular_velocity_W.cross(across));
  // A first look foresees what friction does there, and may be wrong by as much.
  account->allowed += 2 * friction_W.norm() * wall.angular_velocity_W.cross(OffChord(*account, j)).norm();
}

Quaternion LedgerKeeper::RotationAt(const LedgerStep& step, int number, double time, Spin* last) const {
  const Body& body = step.before[number];
  const std::vector<Spin>& spins = accounts_[number].spins;
  if (spins.empty()) return Exp(time * body.angular_velocity_W) * body.rotation_WB;
  for (const Spin& spin : spins)
    if (spin.time >= last->time && spin.time <= time) *last = spin;
  last->rotation_WB = Turn(body, last->rotation_WB, last->momentum_W, time - last->time);
  last->time = time;
  return last->rotation_WB;
}

void LedgerKeeper::JudgeBody(const LedgerStep& step, int number, Account* account) {
  const Body &before = step.before[number], &after = step.after[number];
  account->gain = account->at_hand = account->allowed = account->momentum = account->angular = account->way = 0;
  account->spins.clear();
  FindCourse(step, number, account);
  if (!IsOurs(before)) return;
  const std::span<const int> own(places_.data() + start_[number], start_[number + 1] - start_[number]);
  const Moment& end = account->course.back();
  double pushed = 0, turned = 0;
  // The angular momentum about the centre; an impulse that is spread acts as a kick halfway.
  struct Kick {
    double time;
    Vector3 moment;
    bool of_torque = false;
  };
  thread_local std::vector<Kick> kicks;
  kicks.clear();
  for (const int k : own) {
    const LedgerImpulse& j = step.impulses[k];
    const Vector3 centre = CentreAt(*account, j);
    kicks.push_back({j.time + 0.5 * j.duration, SignOn(j, number) * (j.contact.point_W - centre).cross(j.impulse_W)});
    pushed += j.impulse_W.norm();
    turned += kicks.back().moment.norm();
    account->allowed += 0.5 * j.impulse_W.norm() * j.accuracy;
    account->gain -=
        WorkOfBelts(step, j) / (IsOurs(step.before[j.contact.body_a]) && IsOurs(step.before[j.contact.body_b]) ? 2 : 1);
    for (const int wall : {j.contact.body_a, j.contact.body_b}) {
      const Body& w = step.before[wall];
      if (w.kind != BodyKind::kKinematic) continue;
      // The middle of its chord while the impulse acts, and its mean velocity.
      const double middle = j.time + 0.5 * j.duration;
      const Vector3 at = w.position_W + middle * w.linear_velocity_W +
                         0.5 * (middle * (middle - step.dt) + 0.25 * j.duration * j.duration) * w.arc_W,
                    velocity_W = w.linear_velocity_W + (middle - 0.5 * step.dt) * w.arc_W;
      account->gain -=
          SignOn(j, number) * j.impulse_W.dot(velocity_W + w.angular_velocity_W.cross(j.contact.point_W - at));
      JudgeTurningWall(j, w, velocity_W, SignOn(j, number), account);
    }
  }
  // So does a torque, between any two moments at which something begins or ends.
  for (size_t s = 1; s < account->course.size() && !before.torque_W.isZero(0); ++s) {
    const double from = account->course[s - 1].time, to = account->course[s].time;
    kicks.push_back({0.5 * (from + to), (to - from) * before.torque_W, true});
  }
  for (size_t k = 1; k < kicks.size(); ++k)  // few, and nearly in order
    for (size_t i = k; i > 0 && kicks[i].time < kicks[i - 1].time; --i) std::swap(kicks[i], kicks[i - 1]);
  const Vector3 momentum_before = before.AngularMomentumW(), momentum_after = after.AngularMomentumW();
  const double energy_before = KineticEnergy(before, momentum_before),
               energy_after = KineticEnergy(after, momentum_after);
  Vector3 momentum = momentum_before;
  Quaternion rotation = before.rotation_WB;
  double t = 0, worked = 0;  // [s]; [J] of the torque, as kicks
  const bool stands = StandsFrozen(before, after);
  const auto turn_until = [&](double time) {
    if (!stands) rotation = Turn(before, rotation, momentum, time - t);
  };
  account->spins.push_back({0, rotation, momentum});
  for (size_t k = 0; k < kicks.size();) {
    const double time = kicks[k].time;
    turn_until(time);
    Vector3 together = Vector3::Zero(), of_torque = Vector3::Zero();
    for (; k < kicks.size() && kicks[k].time - time <= kExact * step.dt; ++k) {
      together += kicks[k].moment;
      if (kicks[k].of_torque) of_torque += kicks[k].moment;
    }
    if (!of_torque.isZero(0))
      worked += of_torque.dot(SpinOf(before.inertia_B.inverse(), rotation, momentum + 0.5 * together));
    momentum += together;
    if (time <= t) account->spins.pop_back();  // with the one before, and no turn between
    t = std::max(t, time);
    account->spins.push_back({t, rotation, momentum});
  }
  turn_until(step.dt);
  if (stands) account->spins.clear();  // what pushes it turns it nowhere
  const double fall = step.dt * (before.mass * step.gravity_W.norm() + before.force_W.norm() +
                                 before.torque_W.norm() / before.radius);  // [N s] what all that pulls would give
  const double rounding = 4 * std::numeric_limits<double>::epsilon() *
                          std::max(before.position_W.norm(), after.position_W.norm());  // [m] of positions
  account->momentum = before.mass * (end.velocity_W - after.linear_velocity_W).norm() /
                      std::max({before.mass * before.linear_velocity_W.norm(),
                                before.mass * after.linear_velocity_W.norm(), pushed, fall, 1e-300});
  account->angular =
      Worse(0.0, (momentum - momentum_after).norm() - rounding * pushed) /
      std::max({momentum_before.norm(), momentum_after.norm(), turned, (pushed + fall) * before.radius, 1e-300});
  const Quaternion off = rotation.conjugate() * after.rotation_WB;
  const double angle = 2 * ArcTangent(off.vec().norm(), std::abs(off.w()));
  account->way = (end.position_W - after.position_W).norm() +
                 (step.shapes[number].kind() == ShapeKind::kSphere ? 0 : angle * before.radius);
  account->allowed += rounding * (before.mass * step.gravity_W + before.force_W).norm();
  account->gain += energy_after - energy_before -
                   (before.mass * step.gravity_W + before.force_W).dot(after.position_W - before.position_W);
  if (!before.torque_W.isZero(0)) {
    const Quaternion turn = after.rotation_WB * before.rotation_WB.conjugate();
    const double sign = turn.w() < 0 ? -1 : 1, sine = turn.vec().norm();
    const double work =
        sine > 0 ? 2 * ArcTangent(sine, sign * turn.w()) / sine * sign * before.torque_W.dot(turn.vec()) : 0;
    account->gain -= work;
    account->allowed += std::abs(work - worked);  // a step knows no more of when the torque acted on what
  }
  account->at_hand = energy_before + energy_after + 0.5 * fall * fall / before.mass * (step.whole_dt / step.dt);
}

void LedgerKeeper::JudgeIslands(const LedgerStep& step, Ledger* ledger) {
  const size_t n = step.before.size();
  parent_.resize(n);
  for (size_t i = 0; i < n; ++i) parent_[i] = static_cast<int>(i);
  for (const LedgerImpulse& j : step.impulses) {
    const int a = j.contact.body_a, b = j.contact.body_b;
    if (!IsOurs(step.before[a]) || !IsOurs(step.before[b])) continue;
    const int x = RootOf(&parent_, a), y = RootOf(&parent_, b);
    parent_[std::max(x, y)] = std::min(x, y);
  }
  for (size_t i = 0; i < n; ++i) {
    const int root = RootOf(&parent_, static_cast<int>(i));
    if (root == static_cast<int>(i)) continue;
    accounts_[root].gain += accounts_[i].gain;
    accounts_[root].at_hand += accounts_[i].at_hand;
    accounts_[root].allowed += accounts_[i].allowed;
  }
  energy_gain_ = 0;
  for (size_t i = 0; i < n; ++i) {
    if (parent_[i] != static_cast<int>(i) || !IsOurs(step.before[i])) continue;
    const Account& island = accounts_[i];
    const double scale = std::max(island.at_hand, 1e-300);
    energy_gain_ += Worse(0.0, island.gain);
    ledger->energy_created.Include(Worse(0.0, island.gain - island.allowed) / scale, static_cast<int>(i));
  }
}

// A body that goes through another takes its centre through it. Asked of those whose ways meet, by a sweep along x, where any way is
// long enough to get through the thinnest, as the other body sees it: one that turns passes by.
void LedgerKeeper::JudgeSides(const LedgerStep& step, Ledger* ledger) const {
  struct Way {
    size_t body;
    double length, turn;  // [m], [rad] in the step
    Vector3 low, high;    // [m] of its centre, with its radius around
  };
  thread_local std::vector<Way> ways;
  ways.clear();
  thread_local std::vector<size_t> planes, order;
  planes.clear();
  double thinnest = INFINITY, longest = 0, largest = 0, turns = 0;
  for (size_t i = 0; i < step.before.size(); ++i) {
    if (step.before[i].removed) continue;
    if (step.shapes[i].kind() == ShapeKind::kHalfSpace) {
      planes.push_back(i);
      continue;
    }
    const double rate = std::max(step.before[i].angular_velocity_W.norm(), step.after[i].angular_velocity_W.norm());
    Way way{i, 0, step.shapes[i].kind() == ShapeKind::kSphere ? 0 : rate * step.dt, accounts_[i].course[0].position_W,
            accounts_[i].course[0].position_W};
    for (size_t s = 1; s < accounts_[i].course.size(); ++s) {
      const Vector3& to = accounts_[i].course[s].position_W;
      way.length += (to - accounts_[i].course[s - 1].position_W).norm();
      way.low = way.low.cwiseMin(to);
      way.high = way.high.cwiseMax(to);
    }
    way.low.array() -= step.before[i].radius;
    way.high.array() += step.before[i].radius;
    ways.push_back(way);
    thinnest = std::min(thinnest, step.shapes[i].size());
    longest = std::max(longest, way.length);
    largest = std::max(largest, step.before[i].radius);
    turns = std::max(turns, way.turn);
  }
  // Whether its centre went through the other one.
  const auto judge = [&](const Way& way, size_t other, double length) {
    const bool plane = step.shapes[other].kind() == ShapeKind::kHalfSpace;
    const int body = static_cast<int>(way.body), through = static_cast<int>(other);
    if (!IsOurs(step.before[way.body]) && (plane || !IsOurs(step.before[other]))) return false;
    if (!plane && kCore * step.shapes[other].size() > length) return false;
    if (!(plane ? Sinks(step, way.body, other) : GoesThrough(step, body, through))) return false;
    if (step.filter && !step.filter->Allows(step.before, body, through)) return false;  // last: users may be asked
    ++ledger->sides_changed;
    ledger->side_changer = IsOurs(step.before[way.body]) ? body : through;
    return true;
  };
  for (const Way& way : ways)
    for (const size_t plane : planes) judge(way, plane, 0);
  if (kCore * thinnest > 2 * (longest + turns * largest)) return;
  order.resize(ways.size());
  std::iota(order.begin(), order.end(), size_t{0});
  std::sort(order.begin(), order.end(),
            [&](size_t x, size_t y) { return std::pair(ways[x].low.x(), x) < std::pair(ways[y].low.x(), y); });
  for (size_t i = 0; i < order.size(); ++i) {
    const Way& a = ways[order[i]];
    for (size_t k = i + 1; k < order.size() && ways[order[k]].low.x() <= a.high.x(); ++k) {
      const Way& b = ways[order[k]];
      if ((a.low.array() > b.high.array()).any() || (b.low.array() > a.high.array()).any()) continue;
      const double length = a.length + b.length, radii = step.before[a.body].radius + step.before[b.body].radius;
      if (!judge(a, b.body, length + b.turn * radii)) judge(b, a.body, length + a.turn * radii);
    }
  }
}

// Whether the body's centre, above the plane at first, is below it at the end.
bool LedgerKeeper::Sinks(const LedgerStep& step, size_t body, size_t plane) {
  const auto height = [](const Body& p, const Body& b) {
    return (p.rotation_WB * Vector3::UnitZ()).dot(b.position_W - p.position_W);
  };
  return height(step.before[plane], step.before[body]) > 0 && height(step.after[plane], step.after[body]) < 0;
}

// Whether a centre stays outside of the sphere around another body all that time, in which both go along parabolas.
bool LedgerKeeper::Misses(const Account& account, const Account& partner, double begin, double end,
                          double radius) const {
  const auto apart = [&](double time) -> Vector3 { return PositionAt(account, time) - PositionAt(partner, time); };
  const Vector3 a = apart(begin), way = apart(end) - a, sag = apart(0.5 * (begin + end)) - a - 0.5 * way;
  const double u = std::clamp(-a.dot(way) / std::max(way.squaredNorm(), 1e-300), 0.0, 1.0);
  return (a + u * way).norm() > radius + sag.norm();
}

bool LedgerKeeper::GoesThrough(const LedgerStep& step, int body, int other) const {
  const Account &account = accounts_[body], &partner = accounts_[other];
  const Shape& shape = step.shapes[other];
  const bool round = shape.kind() == ShapeKind::kSphere;
  Spin last = partner.spins.empty() ? Spin{} : partner.spins.front();
  const auto inside =
      [&](double time,
          Spin* before) -> Vector3 {  // the centre as the other body sees it; a sphere's turn does not matter
    const Vector3 apart = PositionAt(account, time) - PositionAt(partner, time);
    return round ? apart : RotationAt(step, other, time, before).conjugate() * apart;
  };
  const double allowed =
      0.5 * (1 - kCore) * shape.size();  // [m] by which the way may bend off its chord: between core and surface
  double rate = 0;                       // [rad/s] fastest turn that matters
  if (!round) {
    rate = step.before[other].angular_velocity_W.norm();
    const Matrix3 inverse = step.before[other].inertia_B.inverse();
    for (const Spin& spin : partner.spins)
      rate = std::max(rate, SpinOf(inverse, spin.rotation_WB, spin.momentum_W).norm());
  }
  thread_local std::vector<double> times;  // at which either changes its velocity
  times.clear();
  for (const Moment& moment : account.course) times.push_back(moment.time);
  for (const Moment& moment : partner.course) times.push_back(moment.time);
  std::sort(times.begin(), times.end());
  int looks = 0;
  for (size_t s = 0; s + 1 < times.size(); ++s) {
    const double begin = times[s], end = times[s + 1];
    if (end <= begin || Misses(account, partner, begin, end, shape.radius())) continue;
    const double longest = (end - begin) / (1 + std::floor(std::min<double>(kMostLooks, rate * (end - begin) / kTurn)));
    Vector3 a = inside(begin, &last);
    for (double t = begin, h = longest; t < end; h = std::min(2 * h, longest)) {
      if (++looks > kMostLooks) return true;
      h = std::min(h, end - t);
      Spin then = last;
      const Vector3 middle = inside(t + 0.5 * h, &then), b = inside(t + h, &then), chord = 0.5 * (a + b);
      const double sag = (middle - chord).norm();
      if (sag > allowed && chord.norm() < shape.radius() + 0.5 * (b - a).norm() + sag && h > kExact * step.dt) {
        h *= 0.25;  // a half, once doubled
        continue;
      }
      if (CrossesCore(shape, a, b)) return true;
      t += h;
      a = b;
      last = then;
    }
  }
  return false;
}

}  // namespace islet
