#include "engine/midstep.h"

#include <algorithm>
#include <cmath>
#include <tuple>

namespace islet {
namespace {

// Two ends of a step are one contact if its normal turned by less than this cosine says.
constexpr double kSameNormal = 0.5;
// Share of what friction can bear, from which on the contact slides.
constexpr double kSlides = 0.999;

bool EarlierPair(const Contact& x, const Contact& y) {
  return std::tie(x.body_a, x.body_b) < std::tie(y.body_a, y.body_b);
}

Twist AtStart(const StepStart& start, std::span<const Body> bodies, int i) {
  if (bodies[i].Moves()) return start.velocities[i];
  if (bodies[i].kind != BodyKind::kKinematic) return {};
  return {bodies[i].linear_velocity_W, bodies[i].angular_velocity_W};
}

// [m] that any point of the body's surface may have gone; walls turn about anything, so theirs counts at the contact.
double Reach(const StepStart& start, const Twist& twist, const Body& body, const Vector3& from, const Vector3& point) {
  const double lever = std::isfinite(body.radius) ? body.radius : (point - from).norm();
  const double speed = twist.linear_W.norm() + body.linear_velocity_W.norm();
  return start.dt * (speed + (twist.angular_W.norm() + body.angular_velocity_W.norm()) * lever);
}

// Where bodies stick, the points move together and the force keeps its direction, whatever the normal does (that of an edge on
// an edge is one of many). Where they slide it turns with the normal, and friction follows the slip: a cube that spins on its
// corners turns far in a step.
Vector3 AtEnd(const Contact& before, const Contact& after, const Vector3& impulse_W, const Body& a, const Body& b) {
  const double across = impulse_W.dot(before.normal_W);
  if ((impulse_W - across * before.normal_W).norm() < kSlides * before.friction * across) return impulse_W;
  const Vector3 turned = Quaternion::FromTwoVectors(before.normal_W, after.normal_W) * impulse_W;
  const Vector3 normal = turned.dot(after.normal_W) * after.normal_W, friction = turned - normal;
  const double size = friction.norm();
  if (size == 0) return turned;
  const Vector3 velocity = b.VelocityAt(after.point_W) - a.VelocityAt(after.point_W);
  const Vector3 slip = velocity - velocity.dot(after.normal_W) * after.normal_W;
  const double speed = slip.norm(), brake = size * ((a.Moves() ? 1 / a.mass : 0) + (b.Moves() ? 1 / b.mass : 0));
  if (speed < brake || -slip.dot(friction) < 0.5 * speed * size) return turned;
  return normal - size / speed * slip;
}

// Bodies whose velocity counts from the start of the step (SettleCaughtBodies) took their impulses there.
bool TookThemAtOnce(const StepStart& start, const Body& body, int i) {
  return body.Moves() && body.linear_velocity_W == start.velocities[i].linear_W &&
         body.angular_velocity_W == start.velocities[i].angular_W;
}

}  // namespace

// The pair's contact nearest to where the bodies took this one on average; features may be numbered anew when faces change
// roles. If there is none, the contact is taken to have travelled with its bodies.
MidstepImpulses::Acting MidstepImpulses::EndOf(const StepStart& start, const Contact& before, const Vector3& impulse_W,
                                               std::span<const Contact> after, std::span<const Body> bodies) const {
  const int a = before.body_a, b = before.body_b;
  const Twist twist_a = AtStart(start, bodies, a), twist_b = AtStart(start, bodies, b);
  const auto travel = [&](const Twist& t, int i) -> Vector3 {
    return bodies[i].position_W - start.positions_W[i] +
           start.dt * t.angular_W.cross(before.point_W - start.positions_W[i]);
  };
  const Vector3 expected = before.point_W + 0.5 * (travel(twist_a, a) + travel(twist_b, b));
  const double reach = Reach(start, twist_a, bodies[a], start.positions_W[a], before.point_W) +
                       Reach(start, twist_b, bodies[b], start.positions_W[b], before.point_W);
  const Contact* nearest = nullptr;
  double distance = reach;
  for (const Contact& c : after) {
    const double d = (c.point_W - expected).norm();
    if (d > distance || before.normal_W.dot(c.normal_W) < kSameNormal) continue;
    distance = d;
    nearest = &c;
  }
  if (nearest == nullptr) return {expected, impulse_W};
  return {nearest->point_W, AtEnd(before, *nearest, impulse_W, bodies[a], bodies[b])};
}

void MidstepImpulses::Move(const StepStart& start, std::span<const Contact> before, std::span<const Vector3> impulses,
                           std::span<const Contact> after, std::span<const std::uint8_t> stopped,
                           std::span<Body> bodies) {
  changes_.assign(before.size(), Vector3::Zero());
  sums_.assign(bodies.size(), {});
  size_t first = 0, last = 0;  // of the pair's contacts in `after`
  for (size_t c = 0; c < before.size(); ++c) {
    const Contact& contact = before[c];
    while (first < after.size() && EarlierPair(after[first], contact)) ++first;
    for (last = std::max(first, last); last < after.size() && !EarlierPair(contact, after[last]);) ++last;
    const int a = contact.body_a, b = contact.body_b;
    if (impulses[c].isZero(0) || (!bodies[a].Moves() && !bodies[b].Moves()) || stopped[a] || stopped[b] ||
        TookThemAtOnce(start, bodies[a], a) || TookThemAtOnce(start, bodies[b], b))
      continue;
    const Vector3 impulse = ContactFrame(contact.normal_W) * impulses[c];
    const Acting end = EndOf(start, contact, impulse, after.subspan(first, last - first), bodies);
    changes_[c] = 0.5 * (end.impulse_W - impulse);
    for (const auto& [i, sign] : {std::pair{a, -1.0}, {b, 1.0}}) {
      sums_[i].linear += sign * changes_[c];
      sums_[i].angular += 0.5 * sign *
                          ((end.point_W - bodies[i].position_W).cross(end.impulse_W) -
                           (contact.point_W - start.positions_W[i]).cross(impulse));
    }
  }
  // Also what is frozen: the next step finds it as momentum that its supports have to take.
  for (size_t i = 0; i < bodies.size(); ++i) {
    Body& body = bodies[i];
    if (body.kind != BodyKind::kDynamic || body.removed || (sums_[i].linear.isZero(0) && sums_[i].angular.isZero(0)))
      continue;
    body.linear_velocity_W += sums_[i].linear / body.mass;
    body.angular_velocity_W += body.InverseInertiaW() * sums_[i].angular;
  }
}

}  // namespace islet
