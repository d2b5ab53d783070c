#include "engine/geometry/edge_contact.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "engine/contact.h"
#include "engine/geometry/support.h"
#include "qp/elementary.h"

namespace islet {
namespace {

constexpr std::uint32_t kTouchingEdges = 7u << 29;

// A polytope as the other one sees it: positions from the centre of body a, in W.
struct Side {
  Side(const Shape& shape, const Matrix3& rotation_, const Vector3& centre_)
      : polytope(shape.polytope()), rotation(rotation_), centre(centre_) {}
  Vector3 Vertex(int v) const { return centre + rotation * polytope.vertices[v]; }
  Vector3 Outward(int face) const { return rotation * polytope.face_normals[face]; }
  double Farthest(const Vector3& direction) const {
    double most = -INFINITY;
    const Vector3 d = rotation.transpose() * direction;
    for (const Vector3& v : polytope.vertices) most = std::max(most, d.dot(v));
    return direction.dot(centre) + most;
  }
  // The vertices that lie farthest: from where to where along the edge, and one of them.
  struct Support {
    double from = INFINITY, to = -INFINITY;
    Vector3 on_edge = Vector3::Zero();
  };
  Support SupportOf(const Vector3& direction, const Vector3& along, double slack) const {
    const double least = Farthest(direction) - slack;
    Support support;
    for (int v = 0; v < static_cast<int>(polytope.vertices.size()); ++v) {
      const Vector3 at = Vertex(v);
      if (direction.dot(at) < least) continue;
      support.from = std::min(support.from, along.dot(at));
      support.to = std::max(support.to, along.dot(at));
      support.on_edge = at - along.dot(at) * along;
    }
    return support;
  }

  const Polytope& polytope;
  const Matrix3& rotation;
  const Vector3 centre;
};

// The normals of faces along which the bodies are as far apart as along the best one.
class Fan {
 public:
  explicit Fan(const Vector3& best) : best_(best) {}

  void Add(const Vector3& normal, bool of_a) {
    const Vector3 across = best_.cross(normal);
    if (across.norm() < kAngle) return;
    if (!open_) along_ = across.normalized();
    open_ = true;
    flat_ = flat_ && std::abs(along_.dot(normal)) < kAngle;
    const double angle = ArcTangent(across.dot(along_), best_.dot(normal));
    least_ = std::min(least_, angle);
    most_ = std::max(most_, angle);
    for (double& of_other : angles_[!of_a]) flat_ = flat_ && std::abs(angle - of_other) > kAngle;  // a face of both
    std::rotate(angles_[of_a].begin(), angles_[of_a].end() - 1, angles_[of_a].end());
    angles_[of_a][0] = angle;
  }
  // There are several, and all are square to one line.
  bool IsOfEdges() const { return open_ && flat_; }
  const Vector3& along() const { return along_; }
  Vector3 Middle() const {
    const double angle = 0.5 * (least_ + most_);
    return Cosine(angle) * best_ + Sine(angle) * along_.cross(best_);
  }

 private:
  Vector3 best_, along_ = Vector3::Zero();
  double least_ = 0, most_ = 0;  // [rad] about the line
  bool open_ = false, flat_ = true;
  std::array<std::array<double, 2>, 2> angles_{
      {{INFINITY, INFINITY}, {INFINITY, INFINITY}}};  // of either body: two meet at an edge
};

// Whether the polytope has a face with this outward normal.
bool HasFace(const Side& side, const Vector3& outward) {
  const Vector3 outward_B = side.rotation.transpose() * outward;
  return std::any_of(side.polytope.face_normals.begin(), side.polytope.face_normals.end(),
                     [&](const Vector3& n) { return n.cross(outward_B).norm() < kAngle && n.dot(outward_B) > 0; });
}

// Where a corner of one lies on a corner or an edge of the other.
struct Touch {
  Vector3 on_a, on_b;
  std::vector<Vector3> ways_a, ways_b;  // along the edges through that point
};

// The point of an edge that is nearest.
Vector3 NearestOnEdge(const Side& side, const std::array<int, 2>& edge, const Vector3& to) {
  const Vector3 from = side.Vertex(edge[0]), way = side.Vertex(edge[1]) - from;
  return from + std::clamp(way.dot(to - from) / way.squaredNorm(), 0.0, 1.0) * way;
}

void FindWays(const Side& side, const Vector3& point, double slack, std::vector<Vector3>* ways) {
  ways->clear();
  for (const auto& edge : side.polytope.edges)
    if ((NearestOnEdge(side, edge, point) - point).squaredNorm() <= slack * slack)
      ways->push_back(side.Vertex(edge[1]) - side.Vertex(edge[0]));
}

// If there is one such place. normal: along which nothing of either lies beyond.
bool FindTouch(const Side& a, const Side& b, const Vector3& normal, double slack, Touch* touch) {
  bool found = false, several = false;
  const auto look = [&](const Side& corners, const Side& edges, const Vector3& out, bool of_a) {
    const double top = corners.Farthest(out) - slack, bottom = slack - edges.Farthest(-out);
    const Vector3 out_corners = corners.rotation.transpose() * out, out_edges = edges.rotation.transpose() * out;
    const double least = top - out.dot(corners.centre), most = bottom - out.dot(edges.centre);
    for (int v = 0; v < static_cast<int>(corners.polytope.vertices.size()); ++v) {
      if (out_corners.dot(corners.polytope.vertices[v]) < least) continue;
      const Vector3 corner = corners.Vertex(v);
      for (const auto& edge : edges.polytope.edges) {
        const auto height = [&](int end) { return out_edges.dot(edges.polytope.vertices[edge[end]]); };
        if (std::min(height(0), height(1)) > most) continue;
        const Vector3 nearest = NearestOnEdge(edges, edge, corner);
        if ((nearest - corner).squaredNorm() > slack * slack) continue;
        several = several || (found && (corner - touch->on_a).norm() > 4 * slack);
        if (!found) touch->on_a = of_a ? corner : nearest, touch->on_b = of_a ? nearest : corner;
        found = true;
      }
    }
  };
  look(a, b, normal, true);
  look(b, a, -normal, false);
  if (!found || several) return false;
  FindWays(a, touch->on_a, slack, &touch->ways_a);
  FindWays(b, touch->on_b, slack, &touch->ways_b);
  return true;
}

// The ends of what two edges share, with one normal.
bool AppendEdges(const Side (&sides)[2], const std::vector<int> (&apart)[2], const Placement& pose_a,
                 const Vector3& normal_W, double slack, std::vector<Contact>* contacts) {
  Fan fan(normal_W);
  for (const int face : apart[0]) fan.Add(sides[0].Outward(face), true);
  for (const int face : apart[1]) fan.Add(-sides[1].Outward(face), false);
  if (!fan.IsOfEdges()) return false;
  const Vector3 normal = fan.Middle();
  const Side::Support on_a = sides[0].SupportOf(normal, fan.along(), slack),
                      on_b = sides[1].SupportOf(-normal, fan.along(), slack);
  const double from = std::max(on_a.from, on_b.from), to = std::min(on_a.to, on_b.to);
  if (to - from < slack) return false;
  Eigen::Index largest;
  const Vector3 along_A = pose_a.rotation_WB.transpose() * fan.along();
  along_A.cwiseAbs().maxCoeff(&largest);
  for (const double end : {from, to}) {
    contacts->push_back(
        MakeContact(pose_a.position_W + 0.5 * (on_a.on_edge + on_b.on_edge) + end * fan.along(), normal,
                    normal.dot(on_b.on_edge - on_a.on_edge),
                    kTouchingEdges | static_cast<std::uint32_t>((end == to) == (along_A[largest] > 0))));
  }
  return true;
}

// One point, with the middle of all axes along which the bodies are as far apart.
bool AppendPoint(const Side (&sides)[2], const std::vector<int> (&apart)[2], const Placement& pose_a,
                 const Vector3& normal_W, double separation, double slack, std::vector<Contact>* contacts) {
  static thread_local Touch touch;
  if (!FindTouch(sides[0], sides[1], normal_W, slack, &touch)) return false;
  Vector3 sum = Vector3::Zero();
  bool along_edges = false;  // they lie beside each other: both of their ends count
  bool several = false;
  const auto add = [&](const Vector3& normal) {
    sum += normal;
    several = several || normal_W.cross(normal).norm() > kAngle;
  };
  for (const int face : apart[0]) add(sides[0].Outward(face));
  for (const int face : apart[1]) add(-sides[1].Outward(face));
  for (const Vector3& u : touch.ways_a)
    for (const Vector3& v : touch.ways_b) {
      const Vector3 cross = u.cross(v);
      along_edges = along_edges || cross.norm() < 10 * slack * std::max(u.norm(), v.norm());
      for (const Vector3& normal : {Vector3(cross.normalized()), Vector3(-cross.normalized())})
        if (-sides[1].Farthest(-normal) - sides[0].Farthest(normal) >= separation - slack) add(normal);
    }
  if (along_edges || !several || sum.norm() < kAngle) return false;
  const Vector3 normal = sum.normalized();
  contacts->push_back(MakeContact(pose_a.position_W + 0.5 * (touch.on_a + touch.on_b), normal,
                                  normal.dot(touch.on_b - touch.on_a), kTouchingEdges | 2));
  return true;
}

}  // namespace

bool AppendTouchingFeatures(const Shape& a, const Placement& pose_a, const Shape& b, const Placement& pose_b,
                            const Vector3& normal_W, double separation, double size, std::vector<Contact>* contacts) {
  if (std::abs(separation) > kTouch * size) return false;
  const double slack = kTouch * size;
  const Side sides[2] = {{a, pose_a.rotation_WB, Vector3::Zero()},
                         {b, pose_b.rotation_WB, pose_b.position_W - pose_a.position_W}};
  if (HasFace(sides[0], normal_W) && HasFace(sides[1], -normal_W)) return false;
  static thread_local std::vector<int> apart[2];  // faces along which they are as far apart
  SidesApart(a, pose_a, b, pose_b, slack - separation, &apart[0]);
  SidesApart(b, pose_b, a, pose_a, slack - separation, &apart[1]);
  return AppendPoint(sides, apart, pose_a, normal_W, separation, slack, contacts) ||
         AppendEdges(sides, apart, pose_a, normal_W, slack, contacts);
}

}  // namespace islet
