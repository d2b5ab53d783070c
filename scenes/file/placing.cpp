#include "scenes/file/placing.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <string>
#include <unordered_map>

#include "scenes/file/number_format.h"
#include "scenes/random.h"

namespace islet {
namespace {

// Spheres put at random without overlap fill no more than 0.38 of a space, and towards that each costs ever more tries.
constexpr double kMostFilled = 0.25;
constexpr int kMostDraws = 1000;     // for one body
constexpr double kMostCells = 1e12;  // along one axis
constexpr int kMostInOnePlace = 1000;

using Cell = std::array<double, 3>;  // whole numbers

struct CellHash {
  size_t operator()(const Cell& cell) const {
    size_t hash = 0;
    for (const double x : cell) hash = (hash ^ std::hash<double>()(x)) * 0x9e3779b97f4a7c15u;
    return hash ^ (hash >> 32);
  }
};

Cell CellAt(const Vector3& point, double edge) {
  return {std::floor(point.x() / edge) + 0.0, std::floor(point.y() / edge) + 0.0, std::floor(point.z() / edge) + 0.0};
}

// Points that stay a distance from each other.
class ApartPoints {
 public:
  explicit ApartPoints(double distance) : distance_(distance) {}

  bool Add(const Vector3& point) {
    const Cell cell = CellAt(point, distance_);
    for (double x = -1; x <= 1; ++x)
      for (double y = -1; y <= 1; ++y)
        for (double z = -1; z <= 1; ++z) {
          const auto near = cells_.find({cell[0] + x, cell[1] + y, cell[2] + z});
          if (near == cells_.end()) continue;
          for (const Vector3& other : near->second)
            if ((other - point).squaredNorm() < distance_ * distance_) return false;
        }
    cells_[cell].push_back(point);
    return true;
  }

 private:
  double distance_;
  std::unordered_map<Cell, std::vector<Vector3>, CellHash> cells_;
};

// Where the centres of a cloud's bodies may be.
struct CentreRegion {
  const CloudRepetition& cloud;
  double inset;  // [m] the bodies' radius

  double Volume() const {  // [m^3] of the region itself
    if (cloud.box) return (cloud.box->upper - cloud.box->lower).prod();
    return 4.0 / 3 * std::numbers::pi * cloud.radius * cloud.radius * cloud.radius;
  }
  bool HasRoom() const {
    if (cloud.box) return (cloud.box->upper - cloud.box->lower).minCoeff() >= 2 * inset;
    return cloud.radius >= inset;
  }
  double Farthest() const {  // [m] coordinate
    if (cloud.box) return std::max(cloud.box->lower.cwiseAbs().maxCoeff(), cloud.box->upper.cwiseAbs().maxCoeff());
    return cloud.centre.cwiseAbs().maxCoeff() + cloud.radius;
  }
  Vector3 Draw(SplitMix64* random) const {
    if (cloud.box) {
      Vector3 point;
      for (int k = 0; k < 3; ++k)  // one by one: the order of the draws is part of the scene
        point[k] = random->Uniform(cloud.box->lower[k] + inset, cloud.box->upper[k] - inset);
      return point;
    }
    for (;;) {
      Vector3 point;
      for (int k = 0; k < 3; ++k) point[k] = random->Uniform(-1, 1);
      if (point.squaredNorm() <= 1) return cloud.centre + (cloud.radius - inset) * point;
    }
  }
};

std::vector<Pose> CloudPoses(const BodyEntry& entry, const CloudRepetition& cloud, std::uint64_t seed) {
  const double radius = entry.definition.shape.radius();
  const CentreRegion region{cloud, radius};
  const auto refuse = [&](const std::string& why) {
    entry.place.Refuse("a cloud of " + std::to_string(cloud.count) + " bodies of radius " + ShortNumber(radius) +
                       " m does not fit into its region: " + why);
  };
  if (!region.HasRoom()) refuse("not even one does");
  const double filled = cloud.count * 4.0 / 3 * std::numbers::pi * radius * radius * radius / region.Volume();
  if (!(filled <= kMostFilled))
    refuse("their bounding spheres would fill " + ShortNumber(filled) + " of it; at random they fill at most " +
           ShortNumber(kMostFilled));
  if (region.Farthest() / radius > kMostCells) refuse("the region is too large for bodies that small");
  SplitMix64 random(cloud.seed.value_or(seed));
  ApartPoints centres(2 * radius);
  std::vector<Pose> poses;
  for (int i = 0; i < cloud.count; ++i) {
    Vector3 centre = region.Draw(&random);
    for (int draw = 1; !centres.Add(centre); ++draw) {
      if (draw == kMostDraws) refuse("there was no room left after " + std::to_string(i));
      centre = region.Draw(&random);
    }
    poses.push_back({centre, cloud.turn ? random.Rotation(std::numbers::pi) : entry.definition.rotation_WB});
  }
  return poses;
}

std::vector<Pose> GridPoses(const BodyDefinition& first, const GridRepetition& grid) {
  std::vector<Pose> poses;
  for (int k = 0; k < grid.counts[2]; ++k)
    for (int j = 0; j < grid.counts[1]; ++j)
      for (int i = 0; i < grid.counts[0]; ++i)
        poses.push_back({first.position_W + Vector3(i, j, k).cwiseProduct(grid.spacing), first.rotation_WB});
  return poses;
}

std::vector<Pose> StackPoses(const BodyDefinition& first, const StackRepetition& stack) {
  std::vector<Pose> poses;
  Pose pose{first.position_W, first.rotation_WB};
  for (int i = 0; i < stack.count; ++i) {
    poses.push_back(pose);
    if (stack.about) pose.position_W = *stack.about + stack.turn * (pose.position_W - *stack.about);
    pose.position_W += stack.step;
    pose.rotation_WB = (stack.turn * pose.rotation_WB).normalized();
  }
  return poses;
}

// [m] of the largest ball about the centre of mass that is inside of the shape.
double InnerRadius(const Shape& shape) {
  if (shape.kind() != ShapeKind::kConvexHull) return 0.5 * shape.size();
  double radius = std::numeric_limits<double>::infinity();
  const Polytope& hull = shape.polytope();
  for (size_t f = 0; f < hull.faces.size(); ++f)
    radius = std::min(radius, hull.face_normals[f].dot(hull.vertices[hull.faces[f][0]]));
  return radius;
}

}  // namespace

bool Collide(const BodyDefinition& a, const BodyDefinition& b) {
  return !a.sensor && !b.sensor && (a.kind == BodyKind::kDynamic || b.kind == BodyKind::kDynamic) &&
         (a.layers & b.collides_with) && (b.layers & a.collides_with);
}

std::vector<Pose> PosesOf(const BodyEntry& entry, std::uint64_t seed) {
  if (const auto* grid = std::get_if<GridRepetition>(&entry.repetition)) return GridPoses(entry.definition, *grid);
  if (const auto* stack = std::get_if<StackRepetition>(&entry.repetition)) return StackPoses(entry.definition, *stack);
  if (const auto* cloud = std::get_if<CloudRepetition>(&entry.repetition)) return CloudPoses(entry, *cloud, seed);
  return {{entry.definition.position_W, entry.definition.rotation_WB}};
}

// Bodies are sorted by the power of two of their inner radius r. In cells of a diagonal of r, two of a cell overlap.
void RequireRoom(std::span<const BodyDefinition> bodies, std::span<const int> entry_of,
                 std::span<const BodyEntry> entries) {
  std::unordered_map<const Shape::Data*, double> inner;
  std::array<std::unordered_map<Cell, std::vector<int>, CellHash>, 256> by_size;
  for (size_t i = 0; i < bodies.size(); ++i) {
    const BodyDefinition& body = bodies[i];
    if (!std::isfinite(body.shape.radius())) continue;
    const auto [known, fresh] = inner.try_emplace(&body.shape.data(), 0.0);
    if (fresh) known->second = InnerRadius(body.shape);
    const int power = std::ilogb(known->second);
    std::vector<int>& here =
        by_size[std::clamp(power + 128, 0, 255)][CellAt(body.position_W, std::ldexp(1 / std::numbers::sqrt3, power))];
    const Field& place = entries[entry_of[i]].place;
    for (const int other : here) {
      if (!Collide(body, bodies[other])) continue;
      place.Refuse("body " + std::to_string(i) + " of the scene would be inside of body " + std::to_string(other) +
                   ", at (" + Text(body.position_W).substr(1));
    }
    here.push_back(static_cast<int>(i));
    if (here.size() > kMostInOnePlace)
      place.Refuse("more than " + std::to_string(kMostInOnePlace) + " bodies in one place, at " +
                   Text(body.position_W));
  }
}

}  // namespace islet
