#include "scenes/picture.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <limits>
#include <numbers>
#include <set>

#include "scenes/camera.h"

namespace islet {
namespace {

constexpr double kHeight = 1000;  // [px] of the larger side of the picture
constexpr double kMargin = 24;    // [px]
constexpr double kBodyShadow = 0.5, kWallShadow = 0.8;
constexpr double kTranslucent = 0.4;  // opacity of tilted walls
constexpr double kReach = 2;          // [m] how much of floor and walls is seen around the bodies

using Polygon = std::vector<Vector3>;

struct Face {
  Polygon corners_W;
  Vector3 normal_W;
};

struct Item {    // what is painted at once
  double depth;  // [m] Camera::Nearness
  std::vector<Mark> marks;
};

Colour Palette(double t) {
  static const std::array<Colour, 6> kStops{Colour(0.98, 0.80, 0.42), Colour(0.95, 0.56, 0.33),
                                            Colour(0.84, 0.32, 0.38), Colour(0.53, 0.33, 0.60),
                                            Colour(0.23, 0.42, 0.68), Colour(0.20, 0.64, 0.60)};
  const double at = std::clamp(t, 0.0, 1.0) * (kStops.size() - 1);
  const size_t low = std::min(static_cast<size_t>(at), kStops.size() - 2);
  const double mix = at - static_cast<double>(low);
  return kStops[low] * (1 - mix) + kStops[low + 1] * mix;
}

// Soft light from above and from the camera's left; `shadow` is what a face gets that is turned away from it.
Colour Lit(const Colour& colour, const Vector3& normal, const Camera& camera, double shadow) {
  const Vector3 sun = (0.75 * Vector3::UnitZ() - 0.45 * camera.right + 0.5 * camera.back).normalized();
  const double light = shadow + 0.1 * normal.z() + (1 - shadow) * std::max(0.0, normal.dot(sun));
  return colour * light + 0.05 * std::max(0.0, normal.z());
}

// Of a capsule or cylinder: rings of points along its axis, and what lies between two of them.
std::vector<Face> RoundFaces(const Shape& shape, const Body& body) {
  constexpr int kSides = 24, kBands = 6;         // kBands: of the cap of a capsule
  std::vector<std::pair<double, double>> rings;  // radius, height
  const double r = shape.girth(), h = shape.half_length();
  if (shape.kind() == ShapeKind::kCylinder) {
    rings = {{0, -h}, {r, -h}, {r, h}, {0, h}};
  } else {
    for (int k = -kBands; k <= kBands; ++k) {
      const double angle = 0.5 * std::numbers::pi * k / kBands;
      if (k == 0) rings.emplace_back(r, -h);
      rings.emplace_back(r * std::cos(angle), r * std::sin(angle) + (k < 0 ? -h : h));
    }
  }
  const auto point = [&](const std::pair<double, double>& ring, int side) -> Vector3 {
    const double angle = 2 * std::numbers::pi * side / kSides;
    return body.position_W +
           body.rotation_WB * Vector3(ring.first * std::cos(angle), ring.first * std::sin(angle), ring.second);
  };
  std::vector<Face> faces;
  for (size_t k = 0; k + 1 < rings.size(); ++k) {
    for (int side = 0; side < kSides; ++side) {
      Face face{
          {point(rings[k], side), point(rings[k], side + 1), point(rings[k + 1], side + 1), point(rings[k + 1], side)},
          Vector3::Zero()};
      const Polygon& p = face.corners_W;
      face.normal_W = (p[2] - p[0]).cross(p[3] - p[1]).normalized();
      faces.push_back(std::move(face));
    }
  }
  return faces;
}

std::vector<Face> Faces(const Shape& shape, const Body& body) {
  if (shape.HasAxis()) return RoundFaces(shape, body);
  std::vector<Face> faces;
  const Matrix3 R = body.rotation_WB.toRotationMatrix();
  const Polytope& polytope = shape.polytope();
  for (size_t f = 0; f < polytope.faces.size(); ++f) {
    Face face{{}, R * polytope.face_normals[f]};
    for (const int vertex : polytope.faces[f]) {
      face.corners_W.push_back(body.position_W + R * polytope.vertices[static_cast<size_t>(vertex)]);
    }
    faces.push_back(std::move(face));
  }
  return faces;
}

bool FacesCamera(const Face& face, const Camera& camera) {
  return face.normal_W.dot(camera.eye - face.corners_W[0]) > 0;
}

// Cuts away what is outside of the region [Sutherland and Hodgman 1974]; may leave nothing.
Polygon Clip(Polygon polygon, const Region& region) {
  for (int side = 0; side < 6 && !polygon.empty(); ++side) {
    const int axis = side / 2;
    const double sign = side % 2 ? -1 : 1;
    const double limit = side % 2 ? region.upper[axis] : region.lower[axis];
    const auto inside = [&](const Vector3& p) { return sign * (p[axis] - limit) + 1e-9; };
    Polygon kept;
    for (size_t i = 0; i < polygon.size(); ++i) {
      const Vector3& here = polygon[i];
      const Vector3& next = polygon[(i + 1) % polygon.size()];
      const double a = inside(here), b = inside(next);
      if (a >= 0) kept.push_back(here);
      if ((a >= 0) != (b >= 0)) kept.push_back(here + (next - here) * (a / (a - b)));
    }
    polygon = std::move(kept);
  }
  return polygon;
}

Mark Flat(const Polygon& polygon, const Colour& colour, double opacity, const Camera& camera) {
  Mark mark{{}, colour, opacity, 0};
  for (const Vector3& corner : polygon) mark.outline.push_back(camera.Project(corner));
  return mark;
}

Item DrawSphere(const Shape& shape, const Body& body, const Colour& colour, const Camera& camera) {
  const Eigen::Vector2d centre = camera.Project(body.position_W);
  const double radius = (camera.Project(body.position_W + shape.radius() * camera.right) - centre).norm();
  return {camera.Nearness(body.position_W), {{{centre}, colour, 1, radius}}};
}

Item DrawSolid(const Shape& shape, const Body& body, const Colour& colour, const Camera& camera) {
  Item item{camera.Nearness(body.position_W), {}};
  for (const Face& face : Faces(shape, body)) {
    if (!FacesCamera(face, camera)) continue;
    item.marks.push_back(Flat(face.corners_W, Lit(colour, face.normal_W, camera, kBodyShadow), 1, camera));
  }
  return item;
}

// When a fixed body is painted: walls and floor first, then the tilted ones at the far side, at the near side last, and
// those in the middle among the moving bodies.
double FixedDepth(const Body& body, bool upright, const Region& visible, const Camera& camera) {
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  if (upright) return -kInfinity;
  Vector3 aside = body.position_W - 0.5 * (visible.lower + visible.upper);
  aside.z() = 0;
  const double nearness = camera.Nearness(aside);
  const double half_width = 0.5 * (visible.upper - visible.lower).head<2>().minCoeff();
  if (std::abs(nearness) > 0.3 * half_width) return nearness > 0 ? kInfinity : -kInfinity;
  return camera.Nearness(body.position_W);
}

// Of a half-space what may be seen: a square that reaches past the region.
Face PlaneFace(const Body& body, const Region& visible) {
  const Matrix3 R = body.rotation_WB.toRotationMatrix();
  const Vector3 normal = R.col(2), middle = 0.5 * (visible.lower + visible.upper),
                foot = middle - normal.dot(middle - body.position_W) * normal;
  const double reach = (visible.upper - visible.lower).norm() + (middle - foot).norm();
  Face face{{}, normal};
  for (const auto& [x, y] : {std::pair(-1, -1), std::pair(1, -1), std::pair(1, 1), std::pair(-1, 1)})
    face.corners_W.push_back(foot + reach * (x * R.col(0) + y * R.col(1)));
  return face;
}

Item DrawFixed(const Shape& shape, const Body& body, const Region& visible, const Camera& camera) {
  const bool upright = body.rotation_WB.vec().norm() < 1e-9;
  const Colour colour = upright ? Colour(0.90, 0.89, 0.86) : Colour(0.62, 0.66, 0.70);
  Item item{FixedDepth(body, upright, visible, camera), {}};
  const bool plane = shape.kind() == ShapeKind::kHalfSpace;
  for (const Face& face : plane ? std::vector{PlaneFace(body, visible)} : Faces(shape, body)) {
    if (!FacesCamera(face, camera)) continue;
    const Polygon seen = Clip(face.corners_W, visible);
    if (seen.size() < 3) continue;
    item.marks.push_back(
        Flat(seen, Lit(colour, face.normal_W, camera, kWallShadow), upright ? 1 : kTranslucent, camera));
  }
  return item;
}

Region Around(const World& world) {
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  Region region{Vector3::Constant(kInfinity), Vector3::Constant(-kInfinity)};
  for (const Body& body : world.bodies()) {
    if (body.kind != BodyKind::kDynamic || body.removed) continue;
    region.lower = region.lower.cwiseMin(body.position_W - Vector3::Constant(body.radius));
    region.upper = region.upper.cwiseMax(body.position_W + Vector3::Constant(body.radius));
  }
  if (region.lower.x() > region.upper.x()) return {Vector3::Constant(-1), Vector3::Constant(1)};  // nobody: the origin
  return region;
}

Region Join(const Region& a, const Region& b) { return {a.lower.cwiseMin(b.lower), a.upper.cwiseMax(b.upper)}; }

}  // namespace

Picture::Picture(const World& start, const SceneInfo& info) : info_(info), start_(Around(start)) {
  const auto layer = [](const Body& body) { return std::lround(10 * body.position_W.z()); };
  std::set<long> layers;
  for (const Body& body : start.bodies()) {
    if (body.kind == BodyKind::kDynamic) layers.insert(layer(body));
  }
  const double last = std::max(1.0, static_cast<double>(layers.size()) - 1);
  for (const Body& body : start.bodies()) {
    const auto found = layers.find(layer(body));
    const bool known = body.kind == BodyKind::kDynamic && found != layers.end();
    shade_.push_back(known ? static_cast<double>(std::distance(layers.begin(), found)) / last : 0);
  }
}

// The bodies and what is near them. The start counts sideways only, so that a picture does not grow with the fall.
Region Picture::Visible(const World& world) const {
  const Region now = Around(world);
  Region region = Join(now, start_);
  region.lower -= Vector3::Constant(kReach);
  region.upper += Vector3::Constant(kReach);
  region.upper.z() = now.upper.z();
  for (size_t i = 0; i < world.bodies().size(); ++i) {
    const Body& body = world.bodies()[i];
    if (body.kind == BodyKind::kDynamic || body.rotation_WB.vec().norm() < 1e-9) continue;
    for (const Face& face : Faces(world.shape(static_cast<int>(i)), body)) {
      for (const Vector3& corner : face.corners_W) region.upper.z() = std::max(region.upper.z(), corner.z());
    }
  }
  if (info_.bounds) {
    region.upper = region.upper.cwiseMin(info_.bounds->upper);
    region.lower = region.lower.cwiseMax(info_.bounds->lower);
    region.lower.z() = info_.bounds->lower.z();  // the floor is always seen
  }
  return region;
}

Drawing Picture::Draw(const World& world) const {
  const Region visible = Visible(world);
  const Camera camera = AimAt(visible, kHeight, kMargin);
  std::vector<Item> items;
  for (size_t i = 0; i < world.bodies().size(); ++i) {
    const Body& body = world.bodies()[i];
    const Shape& shape = world.shape(static_cast<int>(i));
    if (body.removed) continue;
    const bool moves = body.kind == BodyKind::kDynamic;
    const Colour colour = moves ? Palette(i < shade_.size() ? shade_[i] : 0) : Colour(0.62, 0.66, 0.70);
    if (shape.kind() == ShapeKind::kSphere) {
      items.push_back(DrawSphere(shape, body, colour, camera));
    } else {
      items.push_back(moves ? DrawSolid(shape, body, colour, camera) : DrawFixed(shape, body, visible, camera));
    }
  }
  std::stable_sort(items.begin(), items.end(), [](const Item& a, const Item& b) { return a.depth < b.depth; });

  Drawing drawing{camera.size, {}};
  for (Item& item : items) std::move(item.marks.begin(), item.marks.end(), std::back_inserter(drawing.marks));
  return drawing;
}

}  // namespace islet
