#include "engine/shape.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <stdexcept>
#include <string>

#include "engine/geometry/convex_hull.h"
#include "engine/number_text.h"
#include "engine/shape_data.h"
#include "qp/smallness.h"

namespace islet {

namespace {

void RequirePositive(const char* field, double value) {
  if (value > 0 && std::isfinite(value)) return;
  throw std::invalid_argument(std::string(field) + " must be positive and finite, got " + Text(value));
}

// Corner v has the signs of its three bits: bit k set means +half[k]. Face 2k+1 looks along +e_k, face 2k along -e_k.
Polytope BoxPolytope(const Vector3& half) {
  Polytope box;
  for (int v = 0; v < 8; ++v) {
    box.vertices.emplace_back((v & 1) ? half.x() : -half.x(), (v & 2) ? half.y() : -half.y(),
                              (v & 4) ? half.z() : -half.z());
  }
  box.faces = {{0, 4, 6, 2}, {1, 3, 7, 5}, {0, 1, 5, 4}, {2, 6, 7, 3}, {0, 2, 3, 1}, {4, 5, 7, 6}};
  for (int axis = 0; axis < 3; ++axis) {
    box.face_normals.push_back(-Vector3::Unit(axis));
    box.face_normals.push_back(Vector3::Unit(axis));
  }
  for (int axis = 0; axis < 3; ++axis) {
    const int u = (axis + 1) % 3, w = (axis + 2) % 3;
    for (int corner = 0; corner < 4; ++corner) {
      const int bit_u = corner & 1, bit_w = corner >> 1;
      const int from = (bit_u << u) | (bit_w << w);
      const int face_u = 2 * u + bit_u, face_w = 2 * w + bit_w;
      box.edges.push_back({from, from | (1 << axis)});
      box.edge_faces.push_back({std::min(face_u, face_w), std::max(face_u, face_w)});
    }
  }
  return box;
}

struct Solid {
  double volume;
  Vector3 centroid;
  Matrix3 inertia_per_mass;  // about the centroid
};

// Sums signed tetrahedra from an inner point to the triangles of each face. For a tetrahedron with corners 0, a, b, c
// and det = 6 V the integral of x x^T is det / 120 (a a^T + b b^T + c c^T + s s^T), s = a + b + c.
Solid Integrate(const Polytope& polytope) {
  Vector3 origin = Vector3::Zero();
  for (const Vector3& v : polytope.vertices) origin += v / static_cast<double>(polytope.vertices.size());
  double six_volume = 0;
  Vector3 first = Vector3::Zero();
  Matrix3 second = Matrix3::Zero();
  for (const std::vector<int>& face : polytope.faces) {
    const Vector3 a = polytope.vertices[face[0]] - origin;
    for (size_t k = 1; k + 1 < face.size(); ++k) {
      const Vector3 b = polytope.vertices[face[k]] - origin, c = polytope.vertices[face[k + 1]] - origin;
      const double det = a.dot(b.cross(c));
      const Vector3 sum = a + b + c;
      six_volume += det;
      first += det * sum / 24;
      second += det / 120 * (a * a.transpose() + b * b.transpose() + c * c.transpose() + sum * sum.transpose());
    }
  }
  const double volume = six_volume / 6;
  const Vector3 centre = first / volume;
  const Matrix3 covariance = second / volume - centre * centre.transpose();
  const Matrix3 inertia = covariance.trace() * Matrix3::Identity() - covariance;
  return {volume, origin + centre, 0.5 * (inertia + inertia.transpose())};
}

// Whether a direction across an edge points out of the solid between the two faces that meet there.
bool IsOutward(const Polytope& polytope, size_t edge, const Vector3& direction) {
  const Vector3& one = polytope.face_normals[polytope.edge_faces[edge][0]];
  const Vector3& other = polytope.face_normals[polytope.edge_faces[edge][1]];
  const Vector3 turn = one.cross(other);
  return one.cross(direction).dot(turn) >= 0 && direction.cross(other).dot(turn) >= 0;
}

// [m] It lies between a face and a corner, or between two edges.
double SmallestWidth(const Polytope& polytope) {
  double width = INFINITY;
  for (size_t e = 0; e < polytope.edges.size(); ++e) {
    const Vector3& start = polytope.vertices[polytope.edges[e][0]];
    const Vector3 along = polytope.vertices[polytope.edges[e][1]] - start;
    for (size_t k = 0; k < e; ++k) {
      const Vector3& other = polytope.vertices[polytope.edges[k][0]];
      const Vector3 along_other = polytope.vertices[polytope.edges[k][1]] - other, across = along.cross(along_other);
      if (across.squaredNorm() <= kNegligible * along.squaredNorm() * along_other.squaredNorm()) continue;
      const double depth = across.dot(start - other);
      const Vector3 outward = depth < 0 ? Vector3(-across) : across;
      if (depth != 0 && IsOutward(polytope, e, outward) && IsOutward(polytope, k, -outward))
        width = std::min(width, std::abs(depth) / across.norm());
    }
  }
  for (size_t f = 0; f < polytope.faces.size(); ++f) {
    const Vector3& corner = polytope.vertices[polytope.faces[f][0]];
    double depth = 0;
    for (const Vector3& v : polytope.vertices) depth = std::max(depth, polytope.face_normals[f].dot(corner - v));
    width = std::min(width, depth);
  }
  return width;
}

std::shared_ptr<Shape::Data> RoundData(ShapeKind kind, double radius, double half_length) {
  auto data = std::make_shared<Shape::Data>();
  data->kind = kind;
  data->girth = radius;
  data->half_length = half_length;
  return data;
}

}  // namespace

Shape Shape::Sphere(double radius) {
  RequirePositive("Sphere radius", radius);
  auto data = std::make_shared<Data>();
  data->kind = ShapeKind::kSphere;
  data->radius = radius;
  data->girth = radius;
  data->half_extents.setConstant(radius);
  data->size = 2 * radius;
  data->volume = 4.0 / 3.0 * std::numbers::pi * radius * radius * radius;
  data->inertia_per_mass = 0.4 * radius * radius * Matrix3::Identity();
  return Shape(std::move(data));
}

Shape Shape::Box(const Vector3& half_extents) {
  RequirePositive("Box half_extents.x", half_extents.x());
  RequirePositive("Box half_extents.y", half_extents.y());
  RequirePositive("Box half_extents.z", half_extents.z());
  auto data = std::make_shared<Data>();
  data->kind = ShapeKind::kBox;
  data->radius = half_extents.norm();
  data->half_extents = half_extents;
  data->size = 2 * half_extents.minCoeff();
  data->polytope = BoxPolytope(half_extents);
  data->volume = 8 * half_extents.prod();
  const Vector3 squares = half_extents.cwiseAbs2();
  data->inertia_per_mass = ((squares.sum() * Vector3::Ones() - squares) / 3).asDiagonal();
  return Shape(std::move(data));
}

Shape Shape::HalfSpace() {
  auto data = std::make_shared<Data>();
  data->kind = ShapeKind::kHalfSpace;
  data->radius = INFINITY;
  data->half_extents.setConstant(INFINITY);
  data->size = INFINITY;
  data->volume = INFINITY;
  return Shape(std::move(data));
}

Shape Shape::Capsule(double radius, double half_length) {
  RequirePositive("Capsule radius", radius);
  RequirePositive("Capsule half_length", half_length);
  auto data = RoundData(ShapeKind::kCapsule, radius, half_length);
  data->radius = half_length + radius;
  data->half_extents = {radius, radius, half_length + radius};
  data->size = 2 * radius;
  const double r2 = radius * radius, h2 = half_length * half_length;
  const double middle = 2 * std::numbers::pi * r2 * half_length,
               caps = 4.0 / 3.0 * std::numbers::pi * r2 * radius;  // [m^3]
  data->volume = middle + caps;
  // Half a ball has its centre of mass 3/8 of the radius from its flat side.
  const double along = middle * 0.5 * r2 + caps * 0.4 * r2;
  const double across = middle * (0.25 * r2 + h2 / 3) + caps * (0.4 * r2 + h2 + 0.75 * half_length * radius);
  data->inertia_per_mass = Vector3(across, across, along).asDiagonal();
  data->inertia_per_mass /= data->volume;
  return Shape(std::move(data));
}

Shape Shape::Cylinder(double radius, double half_length) {
  RequirePositive("Cylinder radius", radius);
  RequirePositive("Cylinder half_length", half_length);
  auto data = RoundData(ShapeKind::kCylinder, radius, half_length);
  data->radius = std::sqrt(radius * radius + half_length * half_length);
  data->half_extents = {radius, radius, half_length};
  data->size = 2 * std::min(radius, half_length);
  const double r2 = radius * radius, h2 = half_length * half_length;
  data->volume = 2 * std::numbers::pi * r2 * half_length;
  data->inertia_per_mass = Vector3(0.25 * r2 + h2 / 3, 0.25 * r2 + h2 / 3, 0.5 * r2).asDiagonal();
  return Shape(std::move(data));
}

Shape Shape::ConvexHull(std::span<const Vector3> points) {
  auto data = std::make_shared<Data>();
  data->kind = ShapeKind::kConvexHull;
  data->polytope = BuildConvexHull(points);
  const Solid solid = Integrate(data->polytope);
  data->hull_offset = solid.centroid;
  for (Vector3& vertex : data->polytope.vertices) {
    vertex -= solid.centroid;
    data->radius = std::max(data->radius, vertex.norm());
  }
  Vector3 lower = data->polytope.vertices[0], upper = lower;
  for (const Vector3& v : data->polytope.vertices) lower = lower.cwiseMin(v), upper = upper.cwiseMax(v);
  data->half_extents = (upper - lower) / 2;
  data->size = SmallestWidth(data->polytope);
  data->volume = solid.volume;
  data->inertia_per_mass = solid.inertia_per_mass;
  return Shape(std::move(data));
}

Shape Shape::Custom(CustomShape custom) {
  RequirePositive("Custom half_extents.x", custom.half_extents.x());
  RequirePositive("Custom half_extents.y", custom.half_extents.y());
  RequirePositive("Custom half_extents.z", custom.half_extents.z());
  RequirePositive("Custom size", custom.size);
  RequirePositive("Custom volume", custom.volume);
  for (int k = 0; k < 3; ++k)
    RequirePositive("Custom inertia_per_mass, on its diagonal,", custom.inertia_per_mass(k, k));
  if (!custom.collide) throw std::invalid_argument("Custom collide must be a function");
  auto data = std::make_shared<Data>();
  data->kind = ShapeKind::kCustom;
  data->radius = custom.half_extents.norm();
  data->half_extents = custom.half_extents;
  data->size = custom.size;
  data->volume = custom.volume;
  data->inertia_per_mass = custom.inertia_per_mass;
  data->collide = std::move(custom.collide);
  return Shape(std::move(data));
}

Shape::Shape(std::shared_ptr<const Data> data) : data_(std::move(data)), kind_(data_->kind), size_(data_->size) {}

double Shape::radius() const { return data_->radius; }
const Vector3& Shape::half_extents() const { return data_->half_extents; }
const Vector3& Shape::hull_offset() const { return data_->hull_offset; }
const Polytope& Shape::polytope() const { return data_->polytope; }
double Shape::girth() const { return data_->girth; }
double Shape::half_length() const { return data_->half_length; }
double Shape::Volume() const { return data_->volume; }

MassProperties Shape::MassFromDensity(double density) const {
  RequirePositive("density", density);
  if (data_->kind == ShapeKind::kHalfSpace) throw std::invalid_argument("density: a half-space has no mass");
  return MassFromMass(density * data_->volume);
}

MassProperties Shape::MassFromMass(double mass) const {
  RequirePositive("mass", mass);
  if (data_->kind == ShapeKind::kHalfSpace) throw std::invalid_argument("mass: a half-space has no mass");
  return {mass, mass * data_->inertia_per_mass};
}

}  // namespace islet
