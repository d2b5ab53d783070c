#include "engine/geometry/polytope_distance.h"

#include <algorithm>
#include <cmath>
#include <vector>

namespace islet {
namespace {

Vector3 NearestOnSegment(const Vector3& from, const Vector3& to, const Vector3& query) {
  const Vector3 along = to - from;
  const double t = (query - from).dot(along) / along.squaredNorm();
  return t <= 0 ? from : (t >= 1 ? to : Vector3(from + t * along));
}

// The point of a face nearest to a query whose height over the face is known.
Vector3 NearestOnFace(const Polytope& polytope, int face, double height, const Vector3& query) {
  const std::vector<int>& loop = polytope.faces[face];
  const Vector3& normal = polytope.face_normals[face];
  bool inside = true;
  Vector3 best = Vector3::Zero();
  double best_square = INFINITY;
  for (size_t k = 0; k < loop.size(); ++k) {
    const Vector3& from = polytope.vertices[loop[k]];
    const Vector3& to = polytope.vertices[loop[(k + 1) % loop.size()]];
    if ((to - from).cross(normal).dot(query - from) <= 0) continue;  // on the inner side of this edge
    inside = false;
    const Vector3 candidate = NearestOnSegment(from, to, query);
    const double square = (query - candidate).squaredNorm();
    if (square < best_square) best_square = square, best = candidate;
  }
  return inside ? Vector3(query - height * normal) : best;
}

struct Segment {
  Vector3 from, to;
  int edge;
};

// Nearest points inside both segments; false if they lie at an end of one, where a corner does as well.
bool NearestOfSegments(const Segment& p, const Segment& q, Vector3* on_p, Vector3* on_q) {
  const Vector3 u = p.to - p.from, v = q.to - q.from, d = q.from - p.from;
  const Vector3 cross = u.cross(v);
  const double square = cross.squaredNorm();
  if (square < 1e-12 * u.squaredNorm() * v.squaredNorm()) return false;
  const double s = d.cross(v).dot(cross) / square, t = d.cross(u).dot(cross) / square;
  if (s < 0 || s > 1 || t < 0 || t > 1) return false;
  *on_p = p.from + s * u;
  *on_q = q.from + t * v;
  return true;
}

}  // namespace

NearestPoint NearestOnPolytope(const Polytope& polytope, double size, const Vector3& query_B) {
  const int num_faces = static_cast<int>(polytope.faces.size());
  NearestPoint nearest{Vector3::Zero(), Vector3::Zero(), INFINITY};
  int top = 0;
  double top_height = -INFINITY;
  for (int f = 0; f < num_faces; ++f) {
    const double height = polytope.face_normals[f].dot(query_B - polytope.vertices[polytope.faces[f][0]]);
    if (height > top_height) top_height = height, top = f;
    if (height <= 0) continue;
    const Vector3 point = NearestOnFace(polytope, f, height, query_B);
    const double distance = (query_B - point).norm();
    if (distance < nearest.distance) nearest = {point, (query_B - point) / distance, distance};
  }
  // On the surface the direction to the nearest point is round-off; the face's normal is not.
  if (top_height <= 0 || nearest.distance <= 1e-9 * size) {
    const Vector3& normal = polytope.face_normals[top];
    return {query_B - top_height * normal, normal, top_height};
  }
  return nearest;
}

// A corner or an edge of a that lies deeper than (best - separation) under a's top, or of b as high over b's bottom,
// cannot be nearer than the best found so far: few features are left to look at.
ClosestPoints ClosestOfApart(const Polytope& a, double size_a, const Polytope& b, double size_b,
                             const Matrix3& rotation_ab, const Vector3& position_ab, const Vector3& n,
                             double separation) {
  static thread_local std::vector<Vector3> vertices_b;  // in a's frame
  static thread_local std::vector<Segment> edges_b;
  vertices_b.clear();
  double top = -INFINITY, bottom = INFINITY;
  for (const Vector3& v : a.vertices) top = std::max(top, n.dot(v));
  for (const Vector3& v : b.vertices) {
    vertices_b.push_back(position_ab + rotation_ab * v);
    bottom = std::min(bottom, n.dot(vertices_b.back()));
  }
  ClosestPoints best{Vector3::Zero(), Vector3::Zero(), INFINITY, 0};
  auto near_top = [&](double height) { return top - height <= best.distance - separation; };
  auto near_bottom = [&](double height) { return height - bottom <= best.distance - separation; };
  const int num_a = static_cast<int>(a.vertices.size()), num_b = static_cast<int>(b.vertices.size());
  for (int v = 0; v < num_b; ++v) {
    if (!near_bottom(n.dot(vertices_b[v]))) continue;
    const NearestPoint nearest = NearestOnPolytope(a, size_a, vertices_b[v]);
    if (nearest.distance < best.distance) best = {nearest.point_B, vertices_b[v], nearest.distance, num_a + v};
  }
  for (int v = 0; v < num_a; ++v) {
    if (!near_top(n.dot(a.vertices[v]))) continue;
    const NearestPoint nearest = NearestOnPolytope(b, size_b, rotation_ab.transpose() * (a.vertices[v] - position_ab));
    if (nearest.distance < best.distance) {
      best = {a.vertices[v], position_ab + rotation_ab * nearest.point_B, nearest.distance, v};
    }
  }
  edges_b.clear();
  for (int e = 0; e < static_cast<int>(b.edges.size()); ++e) {
    const Segment segment{vertices_b[b.edges[e][0]], vertices_b[b.edges[e][1]], e};
    if (near_bottom(std::min(n.dot(segment.from), n.dot(segment.to)))) edges_b.push_back(segment);
  }
  for (int e = 0; e < static_cast<int>(a.edges.size()); ++e) {
    const Segment segment{a.vertices[a.edges[e][0]], a.vertices[a.edges[e][1]], e};
    if (!near_top(std::max(n.dot(segment.from), n.dot(segment.to)))) continue;
    for (const Segment& other : edges_b) {
      Vector3 on_a, on_b;
      if (!NearestOfSegments(segment, other, &on_a, &on_b)) continue;
      const double distance = (on_b - on_a).norm();
      if (distance < best.distance) {
        best = {on_a, on_b, distance, num_a + num_b + e * static_cast<int>(b.edges.size()) + other.edge};
      }
    }
  }
  return best;
}

}  // namespace islet
