#include "engine/motion/lever.h"

#include <algorithm>
#include <cmath>

#include "engine/geometry/round_contact.h"
#include "engine/rotation.h"
#include "qp/slip.h"
#include "qp/smallness.h"

namespace islet::motion {
namespace {

constexpr double kStands = 0.7;  // sine between normal and axis: a cylinder stands there, it does not lie
constexpr double kTilts = 1e-3;  // sine: less is none, of a spin across the normal, of a cylinder that lies on its side

// Whether two axes lie beside each other (zero: there is none); others cross.
bool LieBeside(const Vector3& a, const Vector3& b) {
  return !a.isZero(0) && !b.isZero(0) && a.cross(b).norm() < kLevel;
}

Vector3 MeanAxis(const Vector3& a, const Vector3& b) {
  return (a.dot(b) < 0 ? Vector3(a - b) : Vector3(a + b)).normalized();
}

// Across a normal and an axis. None where the axis stands on the contact's plane, or rounding would choose it: it may have faced the contact at
// another time of the piece.
Vector3 Across(const Vector3& normal_W, const Vector3& axis_W) {
  const Vector3 across = normal_W.cross(axis_W);
  return across.norm() > kTilts ? Vector3(across.normalized()) : Vector3(Vector3::Zero());
}

// [m/s] at which the mean velocities open a contact between two axes.
double Opening(const Course& a, const Course& b, const Contact& contact) {
  return contact.normal_W.dot(b.MeanVelocity(contact.point_W) - a.MeanVelocity(contact.point_W));
}

// Turns the normal of a sphere about its centre to where mean velocities open the contact as fast as its gap changes. Where the other body has
// an axis the normal first turns to that, and then along it: off its axis a normal impulse would spin that body in itself.
void RollLever(const Course& sphere, const Course& a, const Course& b, double opening, double turn, Contact* contact) {
  const Course& other = &sphere == &a ? b : a;
  const Vector3 &centre = sphere.middle.position_W, &n = contact->normal_W;
  const double depth = n.dot(contact->point_W - centre);
  Vector3 rest = contact->point_W - centre - depth * n;
  Vector3 aside = (centre - other.middle.position_W).cross(other.axis_W);
  if (aside.norm() > kTilts * (centre - other.middle.position_W).norm()) {
    aside.normalize();
    contact->normal_W = (n - aside.dot(n) * aside).normalized();
    rest.setZero();
    contact->point_W = centre + depth * n;
  } else {
    aside.setZero();
  }
  const double off = opening - Opening(a, b, *contact);
  Vector3 rolls = b.MeanVelocity(centre) - a.MeanVelocity(centre);
  rolls -= n.dot(rolls) * n;
  rolls -= aside.dot(rolls) * aside;
  if (std::abs(off) >= turn * rolls.norm()) return;
  contact->normal_W = (n + off / rolls.squaredNorm() * rolls).normalized();
  contact->point_W = centre + depth * n + rest;
}

// The contact with that normal, its point on it between both axes.
Contact Between(const Course& a, const Course& b, Contact contact, const Vector3& normal_W) {
  contact.normal_W = normal_W.normalized();
  FaceAxes(a.middle.position_W, a.axis_W, b.middle.position_W, b.axis_W, &contact);
  return contact;
}

// Turns the normal between two axes to where mean velocities open the contact as fast as its gap changes: Newton's method, in both
// directions, since the points on the axes move on with it. No farther than the normal turned in the piece. Where a step does not halve what is
// off, the method has ended: between axes that are all but parallel it would creep.
void RollBetween(const Course& a, const Course& b, double opening, double turn, Contact* contact) {
  if (turn == 0) return;
  for (double left = INFINITY;;) {
    const double off = opening - Opening(a, b, *contact);
    if (!(std::abs(off) < 0.5 * left)) return;
    left = std::abs(off);
    const Matrix3 frame = ContactFrame(contact->normal_W);
    Vector3 slope = Vector3::Zero();
    for (int k = 1; k < 3; ++k) {
      const Contact turned = Between(a, b, *contact, contact->normal_W + kTilts * turn * frame.col(k));
      slope += (Opening(a, b, turned) - Opening(a, b, *contact)) / (kTilts * turn) * frame.col(k);
    }
    if (std::abs(off) >= turn * slope.norm()) return;
    *contact = Between(a, b, *contact, contact->normal_W + off / slope.squaredNorm() * slope);
  }
}

}  // namespace

Vector3 SpinOf(const Body& body, const Quaternion& rotation_WB, const Vector3& momentum_W) {
  return rotation_WB * Vector3(body.inertia_B.ldlt().solve(rotation_WB.conjugate() * momentum_W));
}

Quaternion Turned(const Vector3& turn, const Quaternion& rotation_WB) {
  if (turn.isZero(0)) return rotation_WB;
  return (Exp(turn) * rotation_WB).normalized();
}

FreeTurn TurnFreely(const Body& body, const Quaternion& rotation_WB, const Vector3& spin_W, double time) {
  const Quaternion turned_WB = Turned(FreeRotation(body.inertia_B, rotation_WB, spin_W, time), rotation_WB);
  return {turned_WB, AngularVelocityAfter(body.inertia_B, rotation_WB, spin_W, turned_WB)};
}

Vector3 Beyond(double most, const Vector3& friction_W) {
  const double rubs = friction_W.norm();
  return rubs > (1 + kNegligible) * most ? Vector3((1 - most / rubs) * friction_W) : Vector3(Vector3::Zero());
}

Vector3 WithinCone(const Contact& contact, const Vector3& impulse_W) {
  const double press = std::max(0.0, contact.normal_W.dot(impulse_W));
  const Vector3 friction = impulse_W - contact.normal_W.dot(impulse_W) * contact.normal_W;
  const double share = friction.norm() > contact.friction * press ? contact.friction * press / friction.norm() : 1;
  return press * contact.normal_W + share * friction;
}

Vector3 TurnedAlong(const Contact& halfway, const Contact& now, const Vector3& impulse_W, const Vector3& velocity_W,
                    double mass) {
  const Vector3 &n = halfway.normal_W, &turned = now.normal_W;
  const double press = n.dot(impulse_W);
  const Vector3 friction = impulse_W - press * n, slip = velocity_W - turned.dot(velocity_W) * turned;
  if (n.cross(turned).norm() > kLevel || slip.norm() * mass <= friction.norm() || friction.dot(slip) > 0 ||
      friction.cross(slip).norm() > kLevel * friction.norm() * slip.norm() ||
      !qp::OnCone(friction.norm(), now.friction * press))
    return impulse_W;
  return press * turned - now.friction * press / slip.norm() * slip;
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

int FindHeir(std::span<const Contact> of_pair, const Vector3& normal_W, const Vector3& point_W) {
  int heir = -1;
  double nearest = INFINITY;
  for (size_t k = 0; k < of_pair.size(); ++k) {
    const double apart = (of_pair[k].point_W - point_W).norm();
    if (of_pair[k].normal_W.dot(normal_W) > 0 && apart < nearest) nearest = apart, heir = static_cast<int>(k);
  }
  return heir;
}

double RoundRadius(const Shape& shape, const Quaternion& rotation_WB, const Vector3& normal_W) {
  const double along = normal_W.dot(rotation_WB * Vector3::UnitZ());
  const bool round = shape.kind() == ShapeKind::kSphere || shape.kind() == ShapeKind::kCapsule ||
                     (shape.kind() == ShapeKind::kCylinder && std::abs(along) < kTilts);
  return round ? shape.girth() : INFINITY;
}

Vector3 ArmChange(const Shape& shape, const Quaternion& rotation_WB, const Vector3& turn_W, const Vector3& arm_W,
                  const Vector3& outward_W) {
  if (turn_W.isZero(0)) return Vector3::Zero();
  const Matrix3 more = TurnLessOne(turn_W);
  const double radius = RoundRadius(shape, rotation_WB, outward_W);
  if (std::isinf(radius)) return more * arm_W;
  if (shape.kind() != ShapeKind::kCylinder) return more * (arm_W - radius * outward_W);
  const Vector3 axis = rotation_WB * Vector3::UnitZ(), after = axis + more * axis;
  return axis.dot(arm_W) * after + radius * (outward_W - outward_W.dot(after) * after).normalized() - arm_W;
}

Side SideOf(const Shape& shape, const Quaternion& rotation_WB, double mass, const Vector3& normal_W) {
  const Vector3 axis = rotation_WB * Vector3::UnitZ();
  const bool lies = shape.HasAxis() && std::abs(normal_W.dot(axis)) < kTilts;  // not on a cap
  return {mass, RoundRadius(shape, rotation_WB, normal_W), lies ? axis : Vector3(Vector3::Zero())};
}

Matrix3 ShareOfA(const Side& a, const Side& b, const Vector3& normal_W) {
  const double by_mass = std::isinf(a.mass) ? 0 : std::isinf(b.mass) ? 1 : b.mass / (a.mass + b.mass);
  const bool round = std::isfinite(a.radius) || std::isfinite(b.radius);
  const double by_radius = std::isinf(a.radius) ? 0 : std::isinf(b.radius) ? 1 : b.radius / (a.radius + b.radius);
  if (!round || (a.straight_W.isZero(0) && b.straight_W.isZero(0)))  // the same in all directions
    return (round ? by_radius : by_mass) * Matrix3::Identity();
  const Matrix3 frame = ContactFrame(normal_W);
  const double least = kExact / std::min(a.radius, b.radius);  // a curvature that decides where there is no other
  const auto flat = [&](const Vector3& straight_W) -> Eigen::Vector2d {
    return (frame.rightCols<2>().transpose() * straight_W).normalized();
  };
  Eigen::Vector2d straight_a = flat(a.straight_W), straight_b = flat(b.straight_W);
  // Where sides that are all but parallel cross is no place of theirs.
  if (LieBeside(a.straight_W, b.straight_W)) straight_a = straight_b = flat(MeanAxis(a.straight_W, b.straight_W));
  const auto curvature = [&](double radius, const Eigen::Vector2d& straight, double share) -> Eigen::Matrix2d {
    const Eigen::Matrix2d one = Eigen::Matrix2d::Identity();
    return share * least * one + 1 / radius * (one - straight * straight.transpose());
  };
  const Eigen::Matrix2d of_a = curvature(a.radius, straight_a, by_mass),
                        of_b = curvature(b.radius, straight_b, 1 - by_mass);
  Matrix3 share = Matrix3::Zero();
  share(0, 0) = by_radius;
  share.bottomRightCorner<2, 2>() = of_a * (of_a + of_b).inverse();
  return frame * share * frame.transpose();
}

Vector3 NormalAhead(const Contact& contact, const Side& a, const Side& b, const Vector3& turn_a, const Vector3& turn_b,
                    const Vector3& slip_W) {
  const Vector3& n = contact.normal_W;
  const Vector3 by_a = turn_a.cross(n);
  Vector3 by_b = turn_b.cross(n);
  const Matrix3 share_of_a = ShareOfA(a, b, n);
  if (std::isfinite(a.radius) && std::isfinite(b.radius)) {
    Vector3 slip = slip_W - n.dot(slip_W) * n;
    if (!b.straight_W.isZero(0)) {
      const Vector3 along = (b.straight_W - n.dot(b.straight_W) * n).normalized();
      slip -= along.dot(slip) * along;
    }
    by_b += slip / b.radius;
  }
  return (n + by_a - share_of_a * by_a + share_of_a * by_b).normalized();
}

void Foresee(double h, const Vector3& gravity, std::span<const Body> bodies, std::span<const Contact> contacts,
             std::span<const Vector3> forces_W, std::span<Going> ways) {
  for (size_t i = 0; i < bodies.size(); ++i) {
    const Body& b = bodies[i];
    ways[i].acceleration_W = b.Moves() ? Vector3(gravity + b.force_W / b.mass) : b.arc_W;
  }
  for (size_t c = 0; c < contacts.size(); ++c) {
    const Body &a = bodies[contacts[c].body_a], &b = bodies[contacts[c].body_b];
    const Body& wall = IsTurningWall(a) ? a : b;
    const Vector3 force = IsTurningWall(wall) ? Exp(h * wall.angular_velocity_W) * forces_W[c] : forces_W[c];
    if (a.Moves()) ways[contacts[c].body_a].acceleration_W -= force / a.mass;
    if (b.Moves()) ways[contacts[c].body_b].acceleration_W += force / b.mass;
  }
  for (Going& way : ways) way.mean_W += 0.5 * h * way.acceleration_W;
}

bool IsTurningWall(const Body& b) { return b.kind == BodyKind::kKinematic && !b.angular_velocity_W.isZero(0); }

Vector3 WallSlip(const Contact& contact, std::span<const Body> bodies, double off, std::span<const Going> ways) {
  const auto slip = [&](int number, int other) -> Vector3 {
    const Body& wall = bodies[number];
    if (!IsTurningWall(wall)) return Vector3::Zero();
    const Vector3 along = ways[other].mean_W - ways[number].mean_W;
    const double square = along.squaredNorm();
    Vector3 across = ways[other].acceleration_W - ways[number].acceleration_W;
    if (square > 0) across -= across.dot(along) / square * along;
    return wall.angular_velocity_W.cross(off * across);
  };
  return slip(contact.body_b, contact.body_a) - slip(contact.body_a, contact.body_b);
}

bool FacesAxis(const Shape& shape, const Pose& pose, const Contact& contact) {
  if (!shape.HasAxis() || shape.half_extents().z() < shape.girth()) return false;
  const Vector3 across = contact.normal_W.cross(pose.rotation_WB * Vector3::UnitZ());
  const double stands = shape.kind() == ShapeKind::kCylinder ? kStands : kTilts;
  return across.norm() > stands &&
         std::abs((contact.point_W - pose.position_W).dot(across)) < kSamePoint * shape.size() * across.norm();
}

void FaceAxes(const Vector3& centre_a, const Vector3& axis_a, const Vector3& centre_b, const Vector3& axis_b,
              Contact* contact) {
  if (axis_a.isZero(0) && axis_b.isZero(0)) return;
  const Vector3& n = contact->normal_W;
  const Vector3 across_a = Across(n, axis_a), across_b = Across(n, axis_b);
  const double off_a = (contact->point_W - centre_a).dot(across_a), off_b = (contact->point_W - centre_b).dot(across_b);
  Vector3 off = off_a * across_a + off_b * across_b;
  if (!across_a.isZero(0) && !across_b.isZero(0)) {
    const double cosine = across_a.dot(across_b), square = 1 - cosine * cosine;
    const Vector3 to_both = ((off_a - cosine * off_b) * across_a + (off_b - cosine * off_a) * across_b) / square;
    // Where axes are all but parallel only a place far away is on both.
    off = kLevel * to_both.norm() < std::abs(off_a) + std::abs(off_b) ? to_both : Vector3(0.5 * off);
  }
  contact->point_W -= off;
}

void TurnToAxes(const Vector3& centre_a, const Vector3& axis_a, const Vector3& centre_b, const Vector3& axis_b,
                Contact* contact) {
  const Vector3 &n = contact->normal_W, &p = contact->point_W;
  if (LieBeside(axis_a, axis_b)) {
    // Where the contact's line comes nearest to an axis: on it, in a contact as it is found.
    const auto nearest = [&](const Vector3& centre, const Vector3& axis) -> Vector3 {
      const Vector3 foot = centre + axis.dot(p - centre) * axis, across = n - axis.dot(n) * axis;
      return foot + axis.dot(n) * across.dot(foot - p) / across.squaredNorm() * axis;
    };
    const Vector3 mean = MeanAxis(axis_a, axis_b), across = n - mean.dot(n) * mean;
    if (across.norm() > kStands) {
      Vector3 between = nearest(centre_b, axis_b) - nearest(centre_a, axis_a);
      between -= mean.dot(between) * mean;
      if (across.dot(between) > kStands * across.norm() * between.norm())
        contact->normal_W = n - across + across.norm() * between.normalized();
    }
  }
  FaceAxes(centre_a, axis_a, centre_b, axis_b, contact);
}

Vector3 OnArc(const Course& body, const Vector3& start_W, const Vector3& end_W) {
  const Vector3 before = start_W - body.begin.position_W, after = end_W - body.end.position_W,
                mean = 0.5 * (before + after);
  const Vector3 turn = (body.end.rotation_WB * body.begin.rotation_WB.conjugate()).vec();
  if (body.turns_in_itself || turn.norm() < kNegligible) return body.middle.position_W + mean;
  const Vector3 axis = turn.normalized(), across = mean - axis.dot(mean) * axis;
  const double radius = 0.5 * ((before - axis.dot(before) * axis).norm() + (after - axis.dot(after) * axis).norm());
  const double chord = across.norm();
  return body.middle.position_W + mean + (chord > 0 ? radius / chord - 1 : 0) * across;
}

bool TurnLever(double opening, double turn, const Course& a, const Course& b, double size, Contact* contact) {
  if (a.turns_in_itself || b.turns_in_itself) {
    RollLever(a.turns_in_itself ? a : b, a, b, opening, turn, contact);
    return true;
  }
  if (!a.axis_W.isZero(0) && !b.axis_W.isZero(0) && !LieBeside(a.axis_W, b.axis_W)) {
    RollBetween(a, b, opening, turn, contact);
    return true;
  }
  const Vector3& n = contact->normal_W;
  const double off = opening - Opening(a, b, *contact);
  const Vector3 spin = b.mean_spin_W - a.mean_spin_W;
  Vector3 along = n.cross(spin);
  for (const Vector3& axis : {a.axis_W, b.axis_W}) {
    const Vector3 across = Across(n, axis);
    along -= along.dot(across) * across;
  }
  if (along.norm() <= kTilts * spin.norm() || std::abs(off) >= kSamePlace * size * along.norm()) return false;
  contact->point_W += off / along.squaredNorm() * along;
  return true;
}

void LeanNormal(double opening, const Course& a, const Course& b, Contact* contact) {
  const Vector3& n = contact->normal_W;
  const double off = opening - Opening(a, b, *contact);
  Vector3 slip = b.MeanVelocity(contact->point_W) - a.MeanVelocity(contact->point_W);
  slip -= n.dot(slip) * n;
  if (std::abs(off) < kTilts * slip.norm()) contact->normal_W = (n + off / slip.squaredNorm() * slip).normalized();
}

}  // namespace islet::motion
