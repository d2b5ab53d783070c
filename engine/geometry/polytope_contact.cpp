#include "engine/geometry/polytope_contact.h"

#include <algorithm>
#include <limits>

#include "engine/geometry/edge_contact.h"
#include "engine/geometry/face_contact.h"
#include "engine/geometry/separating_axis.h"

namespace islet {
namespace {

// A polytope turned into W, relative to the centre of body a. Refilled for each pair; the vectors keep their memory.
struct Turned {
  const Polytope* source = nullptr;
  Vector3 centre = Vector3::Zero();
  std::vector<Vector3> vertices, normals;

  void Fill(const Polytope& polytope, const Matrix3& rotation, const Vector3& centre_) {
    source = &polytope;
    centre = centre_;
    vertices.clear();
    normals.clear();
    for (const Vector3& v : polytope.vertices) vertices.push_back(centre + rotation * v);
    for (const Vector3& n : polytope.face_normals) normals.push_back(rotation * n);
  }
  int num_faces() const { return static_cast<int>(normals.size()); }
  const Vector3& OnFace(int face) const { return vertices[source->faces[face][0]]; }
};

struct Axis {
  AxisScore score;
  int face = -1;  // of a, or of b after those of a
  int edge_a = -1, edge_b = -1;
  Vector3 normal = Vector3::Zero();  // unit, from a to b, W
};

struct Scratch {
  Turned a, b;
  std::vector<int> edges_a, edges_b;
  std::vector<Vector3> reference, incident;
};

// The vertex that lies deepest against a direction.
int Deepest(const Turned& polytope, const Vector3& direction) {
  int deepest = 0;
  double least = std::numeric_limits<double>::infinity();
  for (size_t v = 0; v < polytope.vertices.size(); ++v) {
    const double height = direction.dot(polytope.vertices[v]);
    if (height < least) least = height, deepest = static_cast<int>(v);
  }
  return deepest;
}

// [m] least height of the other polytope over a face; where it is no more than `enough`, some height that is no more. Asked
// of the likely vertex first, so most faces cost one look.
double FaceSeparation(const Turned& polytope, int face, const Turned& other, int likely, double enough) {
  const Vector3& normal = polytope.normals[face];
  const Vector3& on_face = polytope.OnFace(face);
  double least = normal.dot(other.vertices[likely] - on_face);
  for (size_t v = 0; v < other.vertices.size() && least > enough; ++v) {
    least = std::min(least, normal.dot(other.vertices[v] - on_face));
  }
  return least;
}

// False if a face's axis already shows that the bodies are out of reach.
bool BestFace(const Turned& a, const Turned& b, double reach, double size, Axis* best) {
  const int num_a = a.num_faces(), num = num_a + b.num_faces();
  const Vector3 apart = b.centre - a.centre;
  const int likely_a = Deepest(a, -apart), likely_b = Deepest(b, apart);
  for (int f = 0; f < num; ++f) {
    const bool of_a = f < num_a;
    const double enough = best->face < 0 ? -std::numeric_limits<double>::infinity()
                                         : std::min(reach, best->score.Needed(FaceSlack(size), size));
    const double separation =
        of_a ? FaceSeparation(a, f, b, likely_b, enough) : FaceSeparation(b, f - num_a, a, likely_a, enough);
    if (separation > reach) return false;
    const AxisScore score = AxisScore::Of(separation, size);
    if (best->face < 0 || score.BetterThan(best->score, FaceSlack(size))) {
      *best = {score, f, -1, -1, of_a ? a.normals[f] : Vector3(-b.normals[f - num_a])};
    }
  }
  return true;
}

// An edge is an arc between its two face normals on the sphere of directions. Two edges carry a supporting axis of the
// pair only if the arc of a meets the mirrored arc of b.
bool ArcsMeet(const Vector3& a0, const Vector3& a1, const Vector3& along_a, const Vector3& b0, const Vector3& b1,
              const Vector3& along_b) {
  const double b0_side = -b0.dot(along_a), b1_side = -b1.dot(along_a);
  if (b0_side * b1_side >= 0) return false;
  const double a0_side = a0.dot(along_b), a1_side = a1.dot(along_b);
  if (a0_side * a1_side >= 0) return false;
  // Same hemisphere: the crossing point and not its antipode. along_a = a0 x a1 up to a positive factor, or negative.
  const Vector3 middle_a = a0 + a1, middle_b = -(b0 + b1);
  Vector3 crossing = along_a.cross(along_b);
  if (crossing.dot(middle_a) < 0) crossing = -crossing;
  return crossing.dot(middle_b) > 0;
}

// Whether some direction of an edge's arc keeps a point of the other body farther than `least` from the edge. The arc's
// plane is square to the edge, so a point's height along it is greatest where it looks at the point.
bool MayKeepApart(const Vector3& n0, const Vector3& n1, const Vector3& along, const Vector3& to_point, double least) {
  const double by_n0 = n0.dot(to_point), by_n1 = n1.dot(to_point);
  if (by_n0 > least || by_n1 > least) return true;
  if (by_n0 + by_n1 <= 0) return false;  // it looks away
  const Vector3 across = to_point - (along.dot(to_point) / along.squaredNorm()) * along;
  return across.norm() > least && n0.cross(across).dot(along) * n1.cross(across).dot(along) < 0;
}

// The edges that may carry an axis along which the bodies are farther apart than `least`. `point` is one of the other body.
void EdgesApart(const Turned& polytope, const Vector3& point, double least, std::vector<int>* edges) {
  edges->clear();
  for (size_t e = 0; e < polytope.source->edges.size(); ++e) {
    const auto& ends = polytope.source->edges[e];
    const auto& faces = polytope.source->edge_faces[e];
    const Vector3& from = polytope.vertices[ends[0]];
    if (MayKeepApart(polytope.normals[faces[0]], polytope.normals[faces[1]], polytope.vertices[ends[1]] - from,
                     point - from, least)) {
      edges->push_back(static_cast<int>(e));
    }
  }
}

// Of the axes of two edges that are better than the best face's: others would not be taken.
bool BestEdges(Scratch* scratch, double reach, double size, const Axis& face, Axis* best) {
  const Turned &a = scratch->a, &b = scratch->b;
  const double least = std::min(reach, face.score.Needed(EdgeSlack(size), size));
  EdgesApart(a, b.vertices[Deepest(b, face.normal)], least, &scratch->edges_a);
  EdgesApart(b, a.vertices[Deepest(a, -face.normal)], least, &scratch->edges_b);
  for (const int ea : scratch->edges_a) {
    const auto& ends_a = a.source->edges[ea];
    const auto& faces_a = a.source->edge_faces[ea];
    const Vector3& from_a = a.vertices[ends_a[0]];
    const Vector3 along_a = a.vertices[ends_a[1]] - from_a;
    for (const int eb : scratch->edges_b) {
      const auto& ends_b = b.source->edges[eb];
      const auto& faces_b = b.source->edge_faces[eb];
      const Vector3& from_b = b.vertices[ends_b[0]];
      const Vector3 along_b = b.vertices[ends_b[1]] - from_b;
      if (!ArcsMeet(a.normals[faces_a[0]], a.normals[faces_a[1]], along_a, b.normals[faces_b[0]], b.normals[faces_b[1]],
                    along_b)) {
        continue;
      }
      Vector3 normal = along_a.cross(along_b);
      const double length = normal.norm();
      if (length * length < 1e-12 * along_a.squaredNorm() * along_b.squaredNorm()) continue;
      normal /= length;
      if (normal.dot(a.normals[faces_a[0]] + a.normals[faces_a[1]]) < 0) normal = -normal;
      const double separation = normal.dot(from_b - from_a);
      if (separation > reach) return false;
      const AxisScore score = AxisScore::Of(separation, size);
      if (best->edge_a < 0 || score.BetterThan(best->score, FaceSlack(size))) {
        *best = {score, -1, ea, eb, normal};
      }
    }
  }
  return true;
}

// One point between the two edges. False if their lines are nearest outside the edges.
bool AppendEdgeContact(const Turned& a, const Turned& b, const Vector3& origin_W, const Axis& axis,
                       std::vector<Contact>* contacts) {
  const auto& ends_a = a.source->edges[axis.edge_a];
  const auto& ends_b = b.source->edges[axis.edge_b];
  const Vector3 &from_a = a.vertices[ends_a[0]], &from_b = b.vertices[ends_b[0]];
  const Vector3 u = a.vertices[ends_a[1]] - from_a, v = b.vertices[ends_b[1]] - from_b, d = from_b - from_a;
  const Vector3 cross = u.cross(v);
  const double square = cross.squaredNorm();
  const double s = d.cross(v).dot(cross) / square, t = d.cross(u).dot(cross) / square;
  if (s < 0 || s > 1 || t < 0 || t > 1) return false;
  const double gap = axis.score.separation;
  contacts->push_back(MakeContact(origin_W + from_a + s * u + (0.5 * gap) * axis.normal, axis.normal, gap,
                                  1u << 31 | (static_cast<std::uint32_t>(axis.edge_a) & 0x7fffu) << 15 |
                                      (static_cast<std::uint32_t>(axis.edge_b) & 0x7fffu)));
  return true;
}

// Of the faces at the corner that lies deepest against the reference face, the one that looks most against it.
int IncidentFace(const Turned& other, const Vector3& outward, const Vector3& on_plane, double slack) {
  const double least = outward.dot(other.vertices[Deepest(other, outward)] - on_plane);
  int best = -1;
  double best_cosine = 2;
  for (int f = 0; f < other.num_faces(); ++f) {
    const double cosine = outward.dot(other.normals[f]);
    if (cosine >= best_cosine) continue;
    const bool at_deepest = std::any_of(other.source->faces[f].begin(), other.source->faces[f].end(), [&](int v) {
      return outward.dot(other.vertices[v] - on_plane) <= least + slack;
    });
    if (at_deepest) best = f, best_cosine = cosine;
  }
  return best;
}

void Corners(const Turned& polytope, int face, std::vector<Vector3>* corners) {
  corners->clear();
  for (int v : polytope.source->faces[face]) corners->push_back(polytope.vertices[v]);
}

// Fills in the two faces; the corners are kept in the scratch.
ClipInput FacesOf(Scratch* scratch, const Axis& axis, double reach, double size) {
  const Turned &a = scratch->a, &b = scratch->b;
  const bool of_b = axis.face >= a.num_faces();
  const Turned &reference = of_b ? b : a, &other = of_b ? a : b;
  ClipInput input;
  input.reference_face = of_b ? axis.face - a.num_faces() : axis.face;
  input.normal = reference.normals[input.reference_face];
  input.incident_face = IncidentFace(other, input.normal, reference.OnFace(input.reference_face), FaceSlack(size));
  Corners(reference, input.reference_face, &scratch->reference);
  Corners(other, input.incident_face, &scratch->incident);
  input.reference = scratch->reference.data();
  input.num_reference = static_cast<int>(scratch->reference.size());
  input.incident = scratch->incident.data();
  input.num_incident = static_cast<int>(scratch->incident.size());
  input.reference_is_b = of_b;
  input.size = size;
  input.reach = reach;
  return input;
}

}  // namespace

void CollidePolytopes(const Shape& a, const Placement& pose_a, const Shape& b, const Placement& pose_b, double reach,
                      std::vector<Contact>* contacts) {
  static thread_local Scratch scratch;
  scratch.a.Fill(a.polytope(), pose_a.rotation_WB, Vector3::Zero());
  scratch.b.Fill(b.polytope(), pose_b.rotation_WB, pose_b.position_W - pose_a.position_W);
  const double size = std::min(a.size(), b.size());
  Axis face, edges;
  if (!BestFace(scratch.a, scratch.b, reach, size, &face)) return;
  if (!BestEdges(&scratch, reach, size, face, &edges)) return;
  const bool of_edges = edges.edge_a >= 0 && edges.score.BetterThan(face.score, EdgeSlack(size));
  const Axis& best = of_edges ? edges : face;
  if (AppendTouchingFeatures(a, pose_a, b, pose_b, best.normal, best.score.separation, size, contacts)) return;
  if (of_edges) {
    if (AppendEdgeContact(scratch.a, scratch.b, pose_a.position_W, edges, contacts)) return;
    if (OnlyEdgesSeparate(face.score.separation, edges.score.separation)) {
      AppendNearestPoints(a, pose_a, b, pose_b, edges.normal, edges.score.separation, reach, contacts);
      return;
    }
  }
  ClipInput input = FacesOf(&scratch, face, reach, size);
  input.origin_W = pose_a.position_W;
  AppendFaceContacts(a, pose_a, b, pose_b, face.score.separation, face.normal, input, contacts);
}

}  // namespace islet
