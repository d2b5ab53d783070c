#include "engine/geometry/convex_hull.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <sstream>
#include <stdexcept>
#include <string>

#include "engine/number_text.h"

namespace islet {
namespace {

struct Face {
  std::vector<int> loop;  // counter-clockwise seen from outside
  Vector3 normal;
};

[[noreturn]] void Reject(const std::string& what) { throw std::invalid_argument("ConvexHull points: " + what); }

std::string ToText(const Vector3& v) {
  std::ostringstream text;
  text << '(' << v.x() << ", " << v.y() << ", " << v.z() << ')';
  return text.str();
}

void CheckPoints(std::span<const Vector3> points) {
  if (points.size() < 4) Reject("at least 4 are needed, got " + std::to_string(points.size()));
  for (size_t i = 0; i < points.size(); ++i) {
    if (!points[i].allFinite()) Reject("point " + std::to_string(i) + " is not finite: " + ToText(points[i]));
  }
}

// Each point once; of points closer than the tolerance to each other the first is kept.
std::vector<Vector3> DropDuplicates(std::span<const Vector3> points, double tolerance) {
  std::vector<Vector3> kept;
  for (const Vector3& point : points) {
    const bool known = std::any_of(kept.begin(), kept.end(), [&](const Vector3& other) {
      return (point - other).squaredNorm() <= tolerance * tolerance;
    });
    if (!known) kept.push_back(point);
  }
  return kept;
}

// Returns how far they lie from a plane through three of them.
double CheckSpread(const std::vector<Vector3>& points, double tolerance) {
  if (points.size() < 4) Reject("only " + std::to_string(points.size()) + " of them differ, at least 4 are needed");
  auto farthest = [&](auto&& distance) {
    return *std::max_element(points.begin(), points.end(),
                             [&](const Vector3& p, const Vector3& q) { return distance(p) < distance(q); });
  };
  const Vector3 origin = points[0];
  const Vector3 along = (farthest([&](const Vector3& p) { return (p - origin).norm(); }) - origin).normalized();
  auto from_line = [&](const Vector3& p) { return (p - origin).cross(along).norm(); };
  const Vector3 off_line = farthest(from_line);
  if (from_line(off_line) <= tolerance) Reject("all lie on one line through " + ToText(origin));
  const Vector3 normal = along.cross(off_line - origin).normalized();
  auto from_plane = [&](const Vector3& p) { return std::abs((p - origin).dot(normal)); };
  const double thickness = from_plane(farthest(from_plane));
  if (thickness <= tolerance) Reject("all lie in one plane (thickness " + Text(thickness) + ")");
  return thickness;
}

constexpr size_t kMostFaces = 4096;     // 2,000 corners take 0.3 s to wrap, and 0.4 s a step in which two of them meet
constexpr size_t kMostPoints = 100000;  // inside of it

// Gift wrapping of one cloud at one tolerance. Fails (ok() false) if round-off makes the faces disagree.
class Wrapping {
 public:
  Wrapping(const std::vector<Vector3>& points, double tolerance) : points_(points), tolerance_(tolerance) { Wrap(); }

  bool ok() const { return ok_; }
  const std::vector<Face>& faces() const { return faces_; }
  const std::map<std::pair<int, int>, int>& edge_to_face() const { return edge_to_face_; }

 private:
  void Wrap() {
    // The lowest point in an oblique direction is a vertex; a plane through it, turned twice, rests on the cloud.
    const Vector3 oblique = Vector3(0.267, 0.5345, 0.802).normalized();
    int first = 0;
    for (int i = 1; i < size(); ++i) {
      if (oblique.dot(points_[i] - points_[first]) < 0) first = i;
    }
    const Vector3 down = -oblique, side = oblique.unitOrthogonal(), forward = down.cross(side);
    const int second = Tilt(first, side, down);
    if (second < 0) return;
    const Vector3 edge = points_[second] - points_[first];
    const Vector3 normal = (edge.dot(forward) * down - edge.dot(down) * forward).normalized();
    const int third = Tilt(first, edge.normalized(), normal);
    if (third < 0 || !AddFace(first, second, third)) return;
    for (size_t f = 0; f < faces_.size(); ++f) {
      if (faces_.size() > 4 * points_.size()) return;
      if (faces_.size() > kMostFaces)
        Reject("these " + std::to_string(points_.size()) + " points make more than " + std::to_string(kMostFaces) +
               " faces; take fewer corners");
      const Face face = faces_[f];
      for (size_t k = 0; k < face.loop.size(); ++k) {
        const int from = face.loop[(k + 1) % face.loop.size()];
        const int to = face.loop[k];
        if (edge_to_face_.count({from, to})) continue;
        const Vector3 axis = (points_[to] - points_[from]).normalized();
        const int next = Tilt(from, axis, face.normal);
        if (next < 0 || !AddFace(from, to, next)) return;
      }
    }
    ok_ = Closed();
  }

  // A plane through `pivot` and `axis` with this outward normal touches the cloud. Turns it about the axis until it
  // meets the next point; returns that point, -1 if there is none off the axis. Of points at one angle the farthest.
  int Tilt(int pivot, const Vector3& axis, const Vector3& normal) const {
    const Vector3 forward = normal.cross(axis);
    int best = -1;
    double best_up = 0, best_along = 0;
    for (int i = 0; i < size(); ++i) {
      const Vector3 d = points_[i] - points_[pivot];
      const double along = d.dot(forward), up = d.dot(normal);
      if (along * along + up * up <= tolerance_ * tolerance_) continue;
      if (best < 0) {
        best = i, best_up = up, best_along = along;
        continue;
      }
      // Turning sense: the larger the angle of (along, up), measured downwards from -forward, the sooner it is met.
      const double turn = best_along * up - best_up * along;
      const double length = std::sqrt(along * along + up * up),
                   best_length = std::sqrt(best_along * best_along + best_up * best_up);
      const double slack = 0.5 * tolerance_ * std::min(length, best_length);
      bool sooner = turn > slack;
      if (std::abs(turn) <=
          slack) {  // one ray, or the two ends of the plane itself, of which the forward one comes first
        const bool same_ray = along * best_along + up * best_up > 0;
        sooner = same_ray ? length > best_length : along > 0;
      }
      if (sooner) best = i, best_up = up, best_along = along;
    }
    return best;
  }

  // The face through three points, with all points of its plane, cut to the corners of its convex outline.
  bool AddFace(int i, int j, int k) {
    const Vector3 cross = (points_[j] - points_[i]).cross(points_[k] - points_[i]);
    if (cross.norm() == 0) return false;
    Vector3 normal = cross.normalized();
    Vector3 inner = Vector3::Zero();
    for (const Vector3& p : points_) inner += p / size();
    if (normal.dot(inner - points_[i]) > 0) normal = -normal;
    std::vector<int> members;
    for (int p = 0; p < size(); ++p) {
      const double height = normal.dot(points_[p] - points_[i]);
      if (height > 2 * tolerance_) return false;  // a point outside: the plane does not rest on the cloud
      if (height > -tolerance_ || p == i || p == j || p == k) members.push_back(p);
    }
    Face face;
    face.loop = Outline(members, normal);
    if (face.loop.size() < 3) return false;
    face.normal = NewellNormal(face.loop);
    const int number = static_cast<int>(faces_.size());
    for (size_t v = 0; v < face.loop.size(); ++v) {
      const auto edge = std::make_pair(face.loop[v], face.loop[(v + 1) % face.loop.size()]);
      if (!edge_to_face_.emplace(edge, number).second) return false;
    }
    faces_.push_back(std::move(face));
    return true;
  }

  // Corners of the convex outline of points of one plane, counter-clockwise about the normal: from one to the next as if wrapped. Points
  // within the tolerance of a side are none.
  std::vector<int> Outline(const std::vector<int>& members, const Vector3& normal) const {
    const Vector3 across = normal.unitOrthogonal();
    const int extreme = *std::min_element(members.begin(), members.end(), [&](int p, int q) {
      return across.dot(points_[p] - points_[members[0]]) < across.dot(points_[q] - points_[members[0]]);
    });
    std::vector<int> loop;
    for (int at = NextOf(extreme, members, normal); loop.empty() || at != loop[0];
         at = NextOf(at, members, normal)) {  // the extreme one may lie within a side
      loop.push_back(at);
      if (loop.size() > members.size()) return {};
    }
    return loop;
  }

  // The corner after this one: no point lies to the right of the way there, and none on it is farther away. Looked for twice: who lies
  // straight behind the first that is tried is neither to its right nor to its left.
  int NextOf(int from, const std::vector<int>& members, const Vector3& normal) const {
    int next = -1;
    Vector3 way = Vector3::Zero();
    for (int look = 0; look < 2; ++look)
      for (const int p : members) {
        const Vector3 d = points_[p] - points_[from];
        if (p == from) continue;
        const double left = normal.dot(way.cross(d)), slack = tolerance_ * way.norm();
        const bool farther = left <= slack && way.dot(d) > 0 && d.squaredNorm() > way.squaredNorm();
        if (next < 0 || left < -slack || farther) next = p, way = d;
      }
    return next;
  }

  Vector3 NewellNormal(const std::vector<int>& loop) const {
    Vector3 area = Vector3::Zero();
    for (size_t k = 1; k + 1 < loop.size(); ++k) {
      area += (points_[loop[k]] - points_[loop[0]]).cross(points_[loop[k + 1]] - points_[loop[0]]);
    }
    return area.normalized();
  }

  bool Closed() const {
    for (const auto& [edge, face] : edge_to_face_) {
      if (!edge_to_face_.count({edge.second, edge.first})) return false;
    }
    std::vector<char> used(points_.size(), 0);
    for (const auto& [edge, face] : edge_to_face_) used[edge.first] = 1;
    const auto num_vertices = static_cast<int>(std::count(used.begin(), used.end(), 1));
    return num_vertices - static_cast<int>(edge_to_face_.size() / 2) + static_cast<int>(faces_.size()) == 2;
  }

  int size() const { return static_cast<int>(points_.size()); }

  const std::vector<Vector3>& points_;
  double tolerance_;
  std::vector<Face> faces_;
  std::map<std::pair<int, int>, int> edge_to_face_;  // directed edge -> face on its left
  bool ok_ = false;
};

Polytope ToPolytope(const std::vector<Vector3>& points, const Wrapping& wrapping) {
  Polytope polytope;
  std::vector<int> to_vertex(points.size(), -1);
  for (const auto& [edge, face] : wrapping.edge_to_face()) to_vertex[edge.first] = 0;
  for (size_t p = 0; p < points.size(); ++p) {
    if (to_vertex[p] < 0) continue;
    to_vertex[p] = static_cast<int>(polytope.vertices.size());
    polytope.vertices.push_back(points[p]);
  }
  for (const Face& face : wrapping.faces()) {
    std::vector<int> loop;
    for (int p : face.loop) loop.push_back(to_vertex[p]);
    polytope.faces.push_back(std::move(loop));
    polytope.face_normals.push_back(face.normal);
  }
  for (const auto& [edge, face] : wrapping.edge_to_face()) {
    if (edge.first > edge.second) continue;
    const int other = wrapping.edge_to_face().at({edge.second, edge.first});
    polytope.edges.push_back({to_vertex[edge.first], to_vertex[edge.second]});
    polytope.edge_faces.push_back({std::min(face, other), std::max(face, other)});
  }
  return polytope;
}

}  // namespace

Polytope BuildConvexHull(std::span<const Vector3> points) {
  CheckPoints(points);
  if (points.size() > kMostPoints)
    Reject(std::to_string(points.size()) + " points are more than " + std::to_string(kMostPoints));
  Vector3 lower = points[0], upper = points[0];
  for (const Vector3& point : points) lower = lower.cwiseMin(point), upper = upper.cwiseMax(point);
  const double extent = (upper - lower).maxCoeff();
  const double thickness = CheckSpread(DropDuplicates(points, 1e-10 * extent), 4e-10 * extent);
  // Meshes are known to six or seven digits. A flat face that their noise splits would hold by one half of it, so what is flat but for noise is flat.
  // Points with noise near the tolerance can make faces disagree: then a finer one takes some of it for shape.
  for (double relative = 1e-5; relative > 1e-11; relative *= 0.1) {
    const double tolerance = relative * std::min(extent, 100 * thickness);
    const std::vector<Vector3> distinct = DropDuplicates(points, tolerance);
    const Wrapping wrapping(distinct, tolerance);
    if (wrapping.ok()) return ToPolytope(distinct, wrapping);
  }
  Reject("no closed hull could be found for these " + std::to_string(points.size()) + " points");
}

}  // namespace islet
