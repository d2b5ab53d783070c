// The shapes a body can have, with exact mass properties. Immutable after construction; copying is cheap (shared data).
//
// The body frame B has its origin at the centre of mass. A half-space is { x : x . e_z <= 0 } in B: its surface passes
// through the body's position and its outward normal is the body's z axis; it has no mass and must be fixed or
// kinematic.
//   errors: a factory throws std::invalid_argument that names the field and the value
//   threads: const use from any thread
#pragma once

#include <array>
#include <functional>
#include <memory>
#include <span>
#include <vector>

#include "engine/linear_algebra.h"

namespace islet {

// Which factory of Shape made it.
enum class ShapeKind {
  kSphere,      // Shape::Sphere()
  kBox,         // Shape::Box()
  kHalfSpace,   // Shape::HalfSpace()
  kConvexHull,  // Shape::ConvexHull()
  kCapsule,     // Shape::Capsule()
  kCylinder,    // Shape::Cylinder()
  kCustom       // Shape::Custom()
};

// How a body resists forces.
struct MassProperties {
  double mass = 0;                      // [kg]
  Matrix3 inertia_B = Matrix3::Zero();  // [kg m^2] about the centre of mass
};

// Faces of a convex polytope in B; a box is one too.
struct Polytope {
  std::vector<Vector3> vertices;               // [m]
  std::vector<std::vector<int>> faces;         // vertex numbers, counter-clockwise seen from outside
  std::vector<Vector3> face_normals;           // unit, outward, one per face
  std::vector<std::array<int, 2>> edges;       // vertex numbers, each edge once, smaller first
  std::vector<std::array<int, 2>> edge_faces;  // the two faces that meet at each edge, smaller first
};

struct Contact;  // contact.h
class Shape;

// Where two shapes are when one of them, a custom one, is asked for its contacts with the other.
struct CustomQuery {
  Vector3 position_W;         // [m] of the custom shape
  Matrix3 rotation_WB;        // of the custom shape
  const Shape* other;         // what it may meet
  Vector3 other_position_W;   // [m] of the other shape
  Matrix3 other_rotation_WB;  // of the other shape
  double reach;               // [m] up to which points are wanted
};

// A convex body whose geometry the caller knows. It is detected, moved and certified as any other.
struct CustomShape {
  // [m] > 0, of a box about the centre of mass, along the axes of B, that holds it.
  Vector3 half_extents = Vector3::Zero();
  double size = 0;                             // [m] > 0, smallest extent: tolerances are shares of it
  double volume = 0;                           // [m^3] > 0
  Matrix3 inertia_per_mass = Matrix3::Zero();  // [m^2] about the centre of mass
  // Appends the points of contact with the other shape, at most `reach` apart: point_W, normal_W, unit, out of the custom shape, gap, below
  // zero where they overlap, and a number `feature` that the same point keeps; the rest is ignored. The least gap must be the distance of
  // the two bodies, or what separates them along the normal. Called from many threads; must depend on the query alone. It may throw.
  std::function<void(const CustomQuery& query, std::vector<Contact>* contacts)> collide;
};

// The shape of a body; see the head of this file.
class Shape {
 public:
  static Shape Sphere(double radius);             // [m] > 0
  static Shape Box(const Vector3& half_extents);  // [m] each > 0
  static Shape HalfSpace();                       // all that lies below its surface
  // All that is within `radius` of a segment of 2 half_length on the z axis of B.
  static Shape Capsule(double radius, double half_length);   // [m] each > 0
  static Shape Cylinder(double radius, double half_length);  // [m] each > 0; about the z axis of B, with flat ends
  // What the caller knows: see CustomShape. Rays do not see it, bytes of a snapshot cannot hold it, and the ledger does not tell who went
  // through it.
  static Shape Custom(CustomShape custom);
  // Hull of at least four points that are not coplanar. The points may be given in any frame: the shape moves its
  // origin to the centre of mass and tells by how much, in hull_offset().
  static Shape ConvexHull(std::span<const Vector3> points);

  ShapeKind kind() const { return kind_; }  // which it is
  double radius() const;                    // [m] farthest point from the centre of mass (half-space: infinity)
  const Vector3& half_extents() const;      // of a box; of the others: of the bounding box in B
  double girth() const;                     // [m] radius of a sphere, capsule or cylinder; of the others 0
  double half_length() const;               // [m] of a cylinder, of a capsule without its caps; of the others 0
  double size() const { return size_; }     // [m] smallest extent, scales contact tolerances (half-space: infinity)
  const Vector3& hull_offset() const;       // centre of mass in the frame the hull's points were given in
  const Polytope& polytope() const;         // box and hull; empty for the others
  // Whether a turn about the z axis of B leaves it as it is: capsules and cylinders. (Any turn leaves a sphere.)
  bool HasAxis() const { return kind_ == ShapeKind::kCapsule || kind_ == ShapeKind::kCylinder; }
  double Volume() const;                                 // [m^3], of a half-space infinity
  MassProperties MassFromDensity(double density) const;  // [kg/m^3] > 0
  // Inertia of the shape filled evenly with this mass.
  MassProperties MassFromMass(double mass) const;  // [kg] > 0

  // Internal.
  struct Data;
  const Data& data() const { return *data_; }
  explicit Shape(std::shared_ptr<const Data> data);

 private:
  std::shared_ptr<const Data> data_;
  ShapeKind kind_;  // of data_: every contact asks for these
  double size_;
};

}  // namespace islet
