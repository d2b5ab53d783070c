#include "engine/geometry/box_distance.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace islet {
namespace {

constexpr int kCorners = 8, kEdges = 12;

Vector3 NearestOnBox(const Vector3& half, const Vector3& query) { return query.cwiseMax(-half).cwiseMin(half); }

// Nearest points inside both edges, from their ends; false if they lie at an end of one, where a corner does as well.
bool NearestOfEdges(const Vector3& from_a, const Vector3& to_a, const Vector3& from_b, const Vector3& to_b,
                    Vector3* on_a, Vector3* on_b) {
  const Vector3 u = to_a - from_a, v = to_b - from_b, d = from_b - from_a;
  const double uu = u.squaredNorm(), vv = v.squaredNorm(), uv = u.dot(v), du = d.dot(u), dv = d.dot(v);
  const double square = uu * vv - uv * uv;
  if (square < 1e-12 * uu * vv) return false;
  const double s = du * vv - dv * uv, t = du * uv - dv * uu;
  if (s < 0 || s > square || t < 0 || t > square) return false;
  *on_a = from_a + (s / square) * u;
  *on_b = from_b + (t / square) * v;
  return true;
}

}  // namespace

// As there, a feature that lies deeper than (best - separation) under a's top, or as high over b's bottom, is passed over.
ClosestPoints ClosestOfBoxes(const Shape& a, const Shape& b, const Matrix3& rotation_ab, const Vector3& position_ab,
                             const Vector3& n, double separation, double limit) {
  const Polytope &polytope_a = a.polytope(), &polytope_b = b.polytope();
  std::array<Vector3, kCorners> corners_b;
  std::array<double, kCorners> depth_a, height_b;  // [m] under a's top, over b's bottom
  double top = -INFINITY, bottom = INFINITY;
  for (int v = 0; v < kCorners; ++v) {
    corners_b[v] = position_ab + rotation_ab * polytope_b.vertices[v];
    depth_a[v] = n.dot(polytope_a.vertices[v]);
    height_b[v] = n.dot(corners_b[v]);
    top = std::max(top, depth_a[v]);
    bottom = std::min(bottom, height_b[v]);
  }
  for (int v = 0; v < kCorners; ++v) {
    depth_a[v] = top - depth_a[v];
    height_b[v] -= bottom;
  }
  ClosestPoints best{Vector3::Zero(), Vector3::Zero(), INFINITY, 0};
  double best_distance = limit;
  const auto consider = [&](const Vector3& on_a, const Vector3& on_b, int feature) {
    const double square = (on_b - on_a).squaredNorm();
    if (square > best_distance * best_distance) return;
    const double distance = std::sqrt(square);
    if (distance >= best.distance * (1 - 1e-12)) return;  // a corner that meets a corner is found twice
    best = {on_a, on_b, distance, feature};
    best_distance = distance;
  };
  for (int v = 0; v < kCorners; ++v) {
    if (height_b[v] > best_distance - separation) continue;
    consider(NearestOnBox(a.half_extents(), corners_b[v]), corners_b[v], kCorners + v);
  }
  for (int v = 0; v < kCorners; ++v) {
    if (depth_a[v] > best_distance - separation) continue;
    const Vector3& corner = polytope_a.vertices[v];
    const Vector3 seen_from_b = rotation_ab.transpose() * (corner - position_ab);
    consider(corner, position_ab + rotation_ab * NearestOnBox(b.half_extents(), seen_from_b), v);
  }
  for (int e = 0; e < kEdges; ++e) {
    const auto& [a0, a1] = polytope_a.edges[e];
    if (std::min(depth_a[a0], depth_a[a1]) > best_distance - separation) continue;
    for (int f = 0; f < kEdges; ++f) {
      const auto& [b0, b1] = polytope_b.edges[f];
      if (std::min(height_b[b0], height_b[b1]) > best_distance - separation) continue;
      Vector3 on_a, on_b;
      if (NearestOfEdges(polytope_a.vertices[a0], polytope_a.vertices[a1], corners_b[b0], corners_b[b1], &on_a, &on_b))
        consider(on_a, on_b, 2 * kCorners + e * kEdges + f);
    }
  }
  // So near that the way between the points is round-off.
  if (best.distance <= 1e-9 * std::min(a.size(), b.size()))
    return ClosestOfApart(polytope_a, a.size(), polytope_b, b.size(), rotation_ab, position_ab, n, separation);
  return best;
}

}  // namespace islet
