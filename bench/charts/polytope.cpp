#include "bench/charts/polytope.h"

#include <algorithm>
#include <cmath>

namespace islet::charts {
namespace {

using peers::BodyPlan;
using peers::State;

constexpr double kParallel = 1e-6;  // sine of the angle between edges that count as parallel: the faces say it

// Corner k of a box has the signs of its bits: x, y, z.
const std::vector<std::vector<int>>& BoxFaces() {
  static const std::vector<std::vector<int>> faces = {{1, 3, 7, 5}, {0, 4, 6, 2}, {2, 6, 7, 3},
                                                      {0, 1, 5, 4}, {4, 5, 7, 6}, {0, 2, 3, 1}};
  return faces;
}

Vector3 NormalOf(const std::vector<Vector3>& corners, const std::vector<int>& face) {
  Vector3 area = Vector3::Zero();  // Newell
  for (size_t i = 0; i < face.size(); ++i) area += corners[face[i]].cross(corners[face[(i + 1) % face.size()]]);
  return area.normalized();
}

struct Extent {
  double low, high;
};
Extent Along(const Polytope& p, const Vector3& axis) {
  Extent extent{1e300, -1e300};
  for (const Vector3& corner : p.corners) {
    const double s = corner.dot(axis);
    extent.low = std::min(extent.low, s);
    extent.high = std::max(extent.high, s);
  }
  return extent;
}

}  // namespace

Polytope PolytopeOf(const BodyPlan& body, const State& at) {
  Polytope result;
  result.centre = at.position_W;
  const Matrix3 rotation = at.rotation_WB.toRotationMatrix();
  if (body.form == BodyPlan::Form::kBox) {
    for (int k = 0; k < 8; ++k) {
      const Vector3 signs((k & 1) != 0 ? 1 : -1, (k & 2) != 0 ? 1 : -1, (k & 4) != 0 ? 1 : -1);
      result.corners.push_back(at.position_W + rotation * signs.cwiseProduct(body.half_extents));
    }
    result.faces = BoxFaces();
  } else {
    for (const Vector3& corner : body.corners) result.corners.push_back(at.position_W + rotation * corner);
    result.faces = body.faces;
  }
  for (const std::vector<int>& face : result.faces) {
    result.normals.push_back(NormalOf(result.corners, face));
    for (size_t i = 0; i < face.size(); ++i) {
      const int from = face[i], to = face[(i + 1) % face.size()];
      if (from > to) continue;  // the other face has it the other way round
      result.edges.push_back({from, to});
      const Vector3 direction = (result.corners[to] - result.corners[from]).normalized();
      const bool known = std::ranges::any_of(result.directions,
                                             [&](const Vector3& d) { return d.cross(direction).norm() < kParallel; });
      if (!known) result.directions.push_back(direction);
    }
  }
  return result;
}

LeastOverlap FindLeastOverlap(const Polytope& a, const Polytope& b, double prefer_faces) {
  LeastOverlap best{.depth = 1e300};
  const auto try_axis = [&](Vector3 axis, bool outwards_of_a, bool outwards_of_b, double handicap) {
    const Extent in_a = Along(a, axis), in_b = Along(b, axis);
    double depth = in_a.high - in_b.low;                       // b lies on the positive side
    const double other = in_b.high - in_a.low;                 // or on the negative one
    if (outwards_of_b || (!outwards_of_a && other < depth)) {  // a face looks one way alone
      depth = other;
      axis = -axis;
    }
    if (depth + handicap >= best.depth) return false;
    best = {.depth = depth + handicap, .normal_W = axis};
    return true;
  };
  for (int i = 0; i < static_cast<int>(a.normals.size()); ++i) {
    if (try_axis(a.normals[i], true, false, 0)) best.face_a = i;
  }
  for (int i = 0; i < static_cast<int>(b.normals.size()); ++i) {
    if (try_axis(b.normals[i], false, true, 0)) best.face_b = i;
  }
  for (int i = 0; i < static_cast<int>(a.directions.size()); ++i) {
    for (int k = 0; k < static_cast<int>(b.directions.size()); ++k) {
      const Vector3 cross = a.directions[i].cross(b.directions[k]);
      const double length = cross.norm();
      if (length < kParallel) continue;
      if (!try_axis(cross / length, false, false, prefer_faces)) continue;
      best.direction_a = i;
      best.direction_b = k;
    }
  }
  if (best.direction_a >= 0) best.depth -= prefer_faces;
  return best;
}

Filling FillingOf(std::span<const Vector3> corners, std::span<const std::vector<int>> faces) {
  double volume = 0;
  Vector3 first = Vector3::Zero();
  Matrix3 second = Matrix3::Zero();  // integral of x x^T
  for (const std::vector<int>& face : faces) {
    for (size_t i = 1; i + 1 < face.size(); ++i) {  // tetrahedra with the origin
      Matrix3 t;
      t << corners[face[0]], corners[face[i]], corners[face[i + 1]];
      const double part = t.determinant() / 6;
      const Vector3 sum = t.rowwise().sum();
      volume += part;
      first += part / 4 * sum;
      second += part / 20 * (t * t.transpose() + sum * sum.transpose());
    }
  }
  const Vector3 centre = first / volume;
  const Matrix3 about_centre = second / volume - centre * centre.transpose();
  return {volume, centre, about_centre.trace() * Matrix3::Identity() - about_centre};
}

}  // namespace islet::charts
