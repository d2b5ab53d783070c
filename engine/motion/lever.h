// Levers of contacts in a piece of a step: what the law (engine/motion/README.md) asks of groups and of crowds alike.
//
//   in:      how two bodies go through the piece (Course), and a contact between them
//   out:     the point and the normal at which its impulse acts, halfway
//   frames: W    units: SI    threads: pure functions
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <span>
#include <vector>

#include "engine/body.h"
#include "engine/contact.h"
#include "engine/motion/path.h"
#include "engine/shape.h"

namespace islet::motion {

// A body in a piece.
struct Course {
  Pose begin, middle, end;      // middle: halfway on the chord
  Vector3 mean_W, mean_spin_W;  // [m/s], [rad/s]
  bool turns_in_itself;         // a sphere
  Vector3 axis_W;               // of symmetry, where the impulse acts, of a body that the contact faces; else zero
  Vector3 MeanVelocity(const Vector3& point_W) const { return mean_W + mean_spin_W.cross(point_W - middle.position_W); }
};

// [rad/s] that an angular momentum [N m s] gives.
Vector3 SpinOf(const Body& body, const Quaternion& rotation_WB, const Vector3& momentum_W);
// turn: [rad] rotation vector.
Quaternion Turned(const Vector3& turn, const Quaternion& rotation_WB);

// Where a body that turned freely for a time [s] is, and its spin [rad/s] there.
struct FreeTurn {
  Quaternion rotation_WB = Quaternion::Identity();
  Vector3 spin_W = Vector3::Zero();
};
FreeTurn TurnFreely(const Body& body, const Quaternion& rotation_WB, const Vector3& spin_W, double time);

// What of an impulse the contact's law allows: its press along the normal, friction up to the cone.
Vector3 WithinCone(const Contact& contact, const Vector3& impulse_W);
// [N s] what friction is beyond the most that there can be.
Vector3 Beyond(double most, const Vector3& friction_W);
// [N s] the impulse of a contact that slid all the way, as it lies at the end: its normal has turned since halfway, and so has its slip. Of
// one that sticks, and where the normal is another feature's, it stays as it is.
// velocity_W: [m/s] of the contact now. mass: [kg] of its lighter body: a slip that its friction may have begun or ended within the piece is
// none all the way.
Vector3 TurnedAlong(const Contact& halfway, const Contact& now, const Vector3& impulse_W, const Vector3& velocity_W,
                    double mass);

// Of a size: how far from where it is looked for a contact is found again, and what a lever may be moved by for the sake of energy.
inline constexpr double kSamePlace = 1e-2;

// Of a pair's contacts the place of the one with that feature, if it is within `moved` of a point [m], else of the nearest within `far`;
// -1: none. (Farther away the same feature is another place: of level faces detection names now this corner so and now that.)
int FindAgain(std::span<const Contact> of_pair, std::uint32_t feature, const Vector3& point_W, double moved,
              double far);

// The forces [N] that held contacts of a step before, at the same contacts now, or at the nearest of the same bodies. Contacts ascend by pair.
// size_of(contact): [m] of its pair.
template <typename SizeOf>
void RecallForces(std::span<const Contact> before, std::span<const Vector3> forces_W, std::span<const Contact> now,
                  const SizeOf& size_of, std::vector<Vector3>* recalled_W) {
  recalled_W->assign(now.size(), Vector3::Zero());
  for (size_t k = 0; k < before.size(); ++k) {
    if (forces_W[k].isZero(0)) continue;
    const auto [first, last] = std::equal_range(now.begin(), now.end(), before[k], EarlierPair);
    const int heir =
        FindAgain({first, last}, before[k].feature, before[k].point_W, kSamePlace * size_of(before[k]), INFINITY);
    if (heir >= 0) (*recalled_W)[static_cast<size_t>(first - now.begin() + heir)] += forces_W[k];
  }
}

// Of a pair's contacts the place of the nearest to a point that faces the same way; -1: none. It takes back at the end what one gave too much
// that is not found again, since faces have slid on.
int FindHeir(std::span<const Contact> of_pair, const Vector3& normal_W, const Vector3& point_W);

// [m] radius of the round side on which a shape takes a contact with that normal: of a sphere, a capsule, a cylinder that lies on its
// side; infinite elsewhere, and of a rim.
double RoundRadius(const Shape& shape, const Quaternion& rotation_WB, const Vector3& normal_W);

// [m] by which the arm from a body's centre to a contact changes in a turn [rad] of what of the body shows. What rolls takes a contact where its
// round side faces the other body, not where its point went. arm_W: [m] before. outward_W: the contact's normal, out of the body.
Vector3 ArmChange(const Shape& shape, const Quaternion& rotation_WB, const Vector3& turn_W, const Vector3& arm_W,
                  const Vector3& outward_W);

// A body as a contact sees it.
struct Side {
  double mass;         // [kg] infinite for what stands still
  double radius;       // [m] of its round side
  Vector3 straight_W;  // along which that is straight: the axis of what lies on its side, zero of spheres and caps
};
Side SideOf(const Shape& shape, const Quaternion& rotation_WB, double mass, const Vector3& normal_W);

// How far a contact goes with body a; the rest with b. Along each direction as their sides are curved there: between two round ones it stays
// between their centres, on a flat one it goes with the centre of the round one alone. So the normal impulse passes through it, and spins it
// not. Where neither is curved the lighter one has the more of it: where two that slide on each other take an impulse at one point, the lever
// of one or the other is off, and a heavy body does not feel it.
Matrix3 ShareOfA(const Side& a, const Side& b, const Vector3& normal_W);

// The normal of a contact whose bodies turn on by what shows of their turn [rad], while the surfaces slip over each other [m]. It turns with
// either body as far as the point goes with the other, and where both sides are round also with the slip: the line of the centres of two
// spheres turns as these move, however they spin.                                                                              [Mon88]
Vector3 NormalAhead(const Contact& contact, const Side& a, const Side& b, const Vector3& turn_a, const Vector3& turn_b,
                    const Vector3& slip_W);

// Whether a contact's normal passes through the body's axis of symmetry, as on round sides and rims. Not of discs, and of what stands: there
// the point runs around the rim with every tilt, and gaps need it where it is.
bool FacesAxis(const Shape& shape, const Pose& pose, const Contact& contact);

// Moves the contact's point in its plane to where the normal passes through the axes of both bodies (zero: there is none): a normal
// impulse must not spin what is round about its own axis. Where axes lie beside each other it passes as near to one as to the other.
void FaceAxes(const Vector3& centre_a, const Vector3& axis_a, const Vector3& centre_b, const Vector3& axis_b,
              Contact* contact);
// The same, and where axes lie beside each other the normal turns to where it passes through both.
void TurnToAxes(const Vector3& centre_a, const Vector3& axis_a, const Vector3& centre_b, const Vector3& axis_b,
                Contact* contact);

// Of the points at which a contact begins and ends, the one on the arc about the body's axis halfway.
Vector3 OnArc(const Course& body, const Vector3& start_W, const Vector3& end_W);

// How a body's centre goes through a piece.
struct Going {
  Vector3 acceleration_W = Vector3::Zero(), mean_W = Vector3::Zero();  // [m/s^2], [m/s]
};

// How bodies go on if forces [N] do. Those of a wall that turns go along with it. ways: in: mean_W as the piece begins; out: halfway.
void Foresee(double h, const Vector3& gravity, std::span<const Body> bodies, std::span<const Contact> contacts,
             std::span<const Vector3> forces_W, std::span<Going> ways);

// [s^2] By so many accelerations the mean place of a centre lies off the middle of its chord, and off where its first velocity alone takes
// it in half of the piece.
inline double OffChord(double h) { return -h * h / 12; }
inline double OffAhead(double h) { return h * h / 6; }

bool IsTurningWall(const Body& body);

// [m/s] what friction sees of walls that turn beside their velocities: they go by under the mean place of a body's centre. Without it what
// sticks on a turntable falls behind. What speeds a body up along its way, as the wall sees it, bends nothing. off: one of the two above.
Vector3 WallSlip(const Contact& contact, std::span<const Body> bodies, double off, std::span<const Going> ways);

// Makes a contact one whose normal impulse works on the bodies what its gap says, and where that stays closed, nothing (a discrete
// gradient [Gonz96]): its point is moved in its plane to where the mean velocity opens it as fast as its gap did change. That of a sphere
// is moved around it with its normal, no farther than that turned, since its normal impulse must not spin it; one that faces an axis along that
// alone.
// opening: [m/s]. turn: [rad] by which its normal does in the piece. size: [m] of the smaller body. Returns whether there is such a point near.
bool TurnLever(double opening, double turn, const Course& a, const Course& b, double size, Contact* contact);
// The same by a normal that leans against the slip, by 1e-3 at most. Where an edge slides over the edge of a face they press across both, and
// the face's normal is off by the slope of the one. Between bodies with faces that spin alike no point would do.
void LeanNormal(double opening, const Course& a, const Course& b, Contact* contact);

}  // namespace islet::motion
