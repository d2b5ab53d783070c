#include "engine/motion/lever.h"

#include <algorithm>
#include <cmath>

namespace islet::motion {
namespace {

constexpr double kTurns = 1e-7;  // sine of half a turn: less is none
constexpr double kTilts = 1e-3;  // sine: less is none, of a spin across the normal, of a cylinder that lies on its side
constexpr double kFarthestLever = 1e-2;  // of a size: what a lever may be moved by for the sake of energy

void RollLever(const Course& sphere, const Course& a, const Course& b, double off, double turn, Contact* contact) {
  const Vector3 &centre = sphere.middle.position_W, &n = contact->normal_W;
  Vector3 rolls = b.MeanVelocity(centre) - a.MeanVelocity(centre);
  rolls -= n.dot(rolls) * n;
  if (std::abs(off) >= turn * rolls.norm()) return;
  const double depth = n.dot(contact->point_W - centre);
  const Vector3 across = contact->point_W - centre - depth * n;
  contact->normal_W = (n + off / rolls.squaredNorm() * rolls).normalized();
  contact->point_W = centre + depth * contact->normal_W + across;
}

}  // namespace

Vector3 SpinOf(const Body& body, const Quaternion& rotation_WB, const Vector3& momentum_W) {
  return rotation_WB * Vector3(body.inertia_B.ldlt().solve(rotation_WB.conjugate() * momentum_W));
}

Quaternion Turned(const Vector3& turn, const Quaternion& rotation_WB) {
  if (turn.isZero(0)) return rotation_WB;
  return (Exp(turn) * rotation_WB).normalized();
}

Vector3 WithinCone(const Contact& contact, const Vector3& impulse_W) {
  const double press = std::max(0.0, contact.normal_W.dot(impulse_W));
  const Vector3 friction = impulse_W - contact.normal_W.dot(impulse_W) * contact.normal_W;
  const double share = friction.norm() > contact.friction * press ? contact.friction * press / friction.norm() : 1;
  return press * contact.normal_W + share * friction;
}

int FindAgain(std::span<const Contact> of_pair, std::uint32_t feature, const Vector3& point_W, double moved,
              double far) {
  int found = -1;
  double nearest = far;
  for (size_t k = 0; k < of_pair.size(); ++k) {
    const double apart = (of_pair[k].point_W - point_W).norm();
    if (of_pair[k].feature == feature && apart <= moved) return static_cast<int>(k);
    if (apart < nearest) nearest = apart, found = static_cast<int>(k);
  }
  return found;
}

double RoundRadius(const Shape& shape, const Quaternion& rotation_WB, const Vector3& normal_W) {
  const double along = normal_W.dot(rotation_WB * Vector3::UnitZ());
  const bool round = shape.kind() == ShapeKind::kSphere || shape.kind() == ShapeKind::kCapsule ||
                     (shape.kind() == ShapeKind::kCylinder && std::abs(along) < kTilts);
  return round ? shape.girth() : INFINITY;
}

Vector3 ArmAfter(const Shape& shape, const Quaternion& rotation_WB, const Vector3& turn_W, const Vector3& arm_W,
                 const Vector3& outward_W) {
  if (turn_W.isZero(0)) return arm_W;
  const Quaternion turn = Exp(turn_W);
  const double radius = RoundRadius(shape, rotation_WB, outward_W);
  if (std::isinf(radius)) return turn * arm_W;
  if (shape.kind() != ShapeKind::kCylinder) return turn * Vector3(arm_W - radius * outward_W) + radius * outward_W;
  const Vector3 axis = rotation_WB * Vector3::UnitZ(), after = turn * axis;
  return axis.dot(arm_W) * after + radius * (outward_W - outward_W.dot(after) * after).normalized();
}

double ShareOfA(const Side& a, const Side& b) {
  const auto share = [](double of_a, double of_b) {
    return std::isinf(of_a) ? 0 : std::isinf(of_b) ? 1 : of_b / (of_a + of_b);
  };
  return std::isinf(a.radius) && std::isinf(b.radius) ? share(a.mass, b.mass) : share(a.radius, b.radius);
}

Vector3 OnArc(const Course& body, const Vector3& start_W, const Vector3& end_W) {
  const Vector3 before = start_W - body.begin.position_W, after = end_W - body.end.position_W,
                mean = 0.5 * (before + after);
  const Vector3 turn = (body.end.rotation_WB * body.begin.rotation_WB.conjugate()).vec();
  if (body.turns_in_itself || turn.norm() < kTurns) return body.middle.position_W + mean;
  const Vector3 axis = turn.normalized(), across = mean - axis.dot(mean) * axis;
  const double radius = 0.5 * ((before - axis.dot(before) * axis).norm() + (after - axis.dot(after) * axis).norm());
  const double chord = across.norm();
  return body.middle.position_W + mean + (chord > 0 ? radius / chord - 1 : 0) * across;
}

void TurnLever(double opening, double turn, const Course& a, const Course& b, double size, Contact* contact) {
  const Vector3& n = contact->normal_W;
  const double off = opening - n.dot(b.MeanVelocity(contact->point_W) - a.MeanVelocity(contact->point_W));
  if (a.sphere || b.sphere) return RollLever(a.sphere ? a : b, a, b, off, turn, contact);
  const Vector3 spin = b.mean_spin_W - a.mean_spin_W, along = n.cross(spin);
  if (along.norm() > kTilts * spin.norm() && std::abs(off) < kFarthestLever * size * along.norm())
    contact->point_W += off / along.squaredNorm() * along;
}

}  // namespace islet::motion
