#include "engine/geometry/box_box.h"

#include <array>
#include <cmath>

#include "engine/geometry/edge_contact.h"
#include "engine/geometry/face_contact.h"
#include "engine/geometry/separating_axis.h"

namespace islet {
namespace {

struct Axis {
  AxisScore score;
  int index = -1;                    // faces: 0..2 of a, 3..5 of b; edges: 3 i + j
  Vector3 normal = Vector3::Zero();  // unit, from a to b, W
};

// Everything the fifteen tests share. t, R: b's centre and axes seen from a.
struct Pair {
  Pair(const Shape& a, const Placement& pa, const Shape& b, const Placement& pb, double reach_)
      : shape_a(a),
        shape_b(b),
        pose_a(pa),
        pose_b(pb),
        half_a(a.half_extents()),
        half_b(b.half_extents()),
        A(pa.rotation_WB),
        B(pb.rotation_WB),
        between(pb.position_W - pa.position_W),
        R(A.transpose() * B),
        absolute_R(R.cwiseAbs()),
        t(A.transpose() * between),
        size(std::min(a.size(), b.size())),
        reach(reach_) {}
  const Shape &shape_a, &shape_b;
  const Placement &pose_a, &pose_b;
  const Vector3 &half_a, &half_b;
  const Matrix3 &A, &B;
  const Vector3 between;  // [m] from a to b, W
  const Matrix3 R, absolute_R;
  const Vector3 t;
  const double size, reach;
};

// What one axis says. distance: [m] between the centres along it; its sign is that of the way from a to b.
struct Separation {
  double distance, value;  // [m]
};

Separation AlongFace(const Pair& pair, int k) {
  const bool of_a = k < 3;
  const int i = of_a ? k : k - 3;
  const double distance = of_a ? pair.t[i] : pair.R.col(i).dot(pair.t);
  const double extent = of_a ? pair.half_a[i] + pair.absolute_R.row(i).dot(pair.half_b)
                             : pair.half_b[i] + pair.absolute_R.col(i).dot(pair.half_a);
  return {distance, std::abs(distance) - extent};
}

// The same for the edges a_i and b_j, whose axis a_i x b_j has seen from a the components 0, -R(i2, j), R(i1, j): `distance`
// and `value` are both larger by its length. Square roots and divisions are left to the few axes that may be chosen.
struct EdgeSeparation {
  double distance, value, length_square;

  bool Exceeds(double limit) const {  // value / length > limit
    const double limit_square = limit * limit * length_square;
    return value > 0 ? (limit <= 0 || value * value > limit_square) : (limit < 0 && value * value < limit_square);
  }
  bool parallel() const { return length_square < 1e-12; }
};

EdgeSeparation AlongEdges(const Pair& pair, int i, int j) {
  const int i1 = (i + 1) % 3, i2 = (i + 2) % 3, j1 = (j + 1) % 3, j2 = (j + 2) % 3;
  const double p = pair.R(i1, j), q = pair.R(i2, j);
  const double distance = pair.t[i2] * p - pair.t[i1] * q;
  const double extent = pair.half_a[i1] * pair.absolute_R(i2, j) + pair.half_a[i2] * pair.absolute_R(i1, j) +
                        pair.half_b[j1] * pair.absolute_R(i, j2) + pair.half_b[j2] * pair.absolute_R(i, j1);
  return {distance, std::abs(distance) - extent, p * p + q * q};
}

// Axes by number: faces 0 to 5, edge pairs 6 + 3 i + j. The same arithmetic as the search below, so that a good guess and
// a bad one give the same answer.
bool Separates(const Pair& pair, int axis) {
  if (axis < 6) return AlongFace(pair, axis).value > pair.reach;
  const EdgeSeparation edges = AlongEdges(pair, (axis - 6) / 3, (axis - 6) % 3);
  return !edges.parallel() && edges.Exceeds(pair.reach);
}

// Both return the axis that shows that the boxes are out of reach, or -1.
int BestFace(const Pair& pair, Axis* best) {
  const int first = pair.half_b.prod() > pair.half_a.prod() ? 3 : 0;
  for (int i = 0; i < 6; ++i) {
    const int k = (first + i) % 6;
    const Separation separation = AlongFace(pair, k);
    if (separation.value > pair.reach) return k;
    const AxisScore score = AxisScore::Of(separation.value, pair.size);
    if (best->index >= 0 && !score.BetterThan(best->score, FaceSlack(pair.size))) continue;
    *best = {score, k, (separation.distance < 0 ? -1 : 1) * (k < 3 ? pair.A.col(k) : pair.B.col(k - 3))};
  }
  return -1;
}

// The same for the nine edge pairs; best stays empty if none is better than the best face.
int BestEdge(const Pair& pair, const AxisScore& face, Axis* best) {
  const double least = face.separates ? std::max(face.separation + EdgeSlack(pair.size), -TouchSlack(pair.size))
                                      : std::min(face.separation + EdgeSlack(pair.size), -TouchSlack(pair.size));
  for (int i = 0; i < 3; ++i) {
    const int i1 = (i + 1) % 3, i2 = (i + 2) % 3;
    for (int j = 0; j < 3; ++j) {
      const EdgeSeparation edges = AlongEdges(pair, i, j);
      if (edges.parallel()) continue;
      if (edges.Exceeds(pair.reach)) return 6 + 3 * i + j;
      if (!edges.Exceeds(least)) continue;
      const double length = std::sqrt(edges.length_square);
      const AxisScore score = AxisScore::Of(edges.value / length, pair.size);
      if (score.BetterThan(best->index < 0 ? face : best->score,
                           best->index < 0 ? EdgeSlack(pair.size) : FaceSlack(pair.size))) {
        const double scale = (edges.distance < 0 ? -1 : 1) / length;
        *best = {score, 3 * i + j, scale * (pair.R(i1, j) * pair.A.col(i2) - pair.R(i2, j) * pair.A.col(i1))};
      }
    }
  }
  return -1;
}

// Centre of the edge along `axis` that lies farthest in a direction; sets the two bits that name it.
Vector3 SupportEdge(const Matrix3& rotation, const Vector3& half, int axis, const Vector3& direction, int* bits) {
  Vector3 centre = Vector3::Zero();
  *bits = 0;
  for (int k = 1; k <= 2; ++k) {
    const int other = (axis + k) % 3;
    const bool positive = rotation.col(other).dot(direction) > 0;
    centre += (positive ? half[other] : -half[other]) * rotation.col(other);
    *bits |= static_cast<int>(positive) << (k - 1);
  }
  return centre;
}

// One point between the two nearest edges. False if their lines are nearest outside the edges: the bodies then meet
// elsewhere.
bool AppendEdgeContact(const Pair& pair, const Axis& axis, std::vector<Contact>* contacts) {
  const int i = axis.index / 3, j = axis.index % 3;
  int bits_a = 0, bits_b = 0;
  const Vector3 centre_a = SupportEdge(pair.A, pair.half_a, i, axis.normal, &bits_a);
  const Vector3 centre_b = pair.between + SupportEdge(pair.B, pair.half_b, j, -axis.normal, &bits_b);
  const Vector3 d = centre_b - centre_a;
  const double cosine = pair.R(i, j);
  const double along_a = d.dot(pair.A.col(i)), along_b = d.dot(pair.B.col(j));
  const double sine_square = 1 - cosine * cosine;
  if (sine_square < 1e-12) return false;
  const double s = (along_a - cosine * along_b) / sine_square, t = (cosine * along_a - along_b) / sine_square;
  if (std::abs(s) > pair.half_a[i] || std::abs(t) > pair.half_b[j]) return false;
  const Vector3 on_a = centre_a + s * pair.A.col(i);
  const double gap = axis.score.separation;
  contacts->push_back(MakeContact(pair.pose_a.position_W + on_a + (0.5 * gap) * axis.normal,
                                  axis.normal.normalized(),  // nearly parallel edges: the length came from differences
                                  gap, 1u << 31 | static_cast<std::uint32_t>(axis.index << 4 | bits_a << 2 | bits_b)));
  return true;
}

// Corners of the face whose outward normal is sign * axis, counter-clockwise seen from outside.
std::array<Vector3, 4> FaceCorners(const Vector3& centre, const Matrix3& rotation, const Vector3& half, int axis,
                                   double sign) {
  const int u = (axis + 1) % 3, w = (axis + 2) % 3;
  const Vector3 middle = centre + sign * half[axis] * rotation.col(axis);
  const Vector3 du = half[u] * rotation.col(u), dw = sign * half[w] * rotation.col(w);
  return {middle - du - dw, middle + du - dw, middle + du + dw, middle - du + dw};
}

void AppendFaces(const Pair& pair, const Axis& axis, std::vector<Contact>* contacts) {
  const bool of_b = axis.index >= 3;
  const Vector3 outward = of_b ? Vector3(-axis.normal) : axis.normal;
  const Vector3 centre_a = Vector3::Zero();
  const Matrix3 &reference_R = of_b ? pair.B : pair.A, &incident_R = of_b ? pair.A : pair.B;
  const Vector3 &reference_half = of_b ? pair.half_b : pair.half_a, &incident_half = of_b ? pair.half_a : pair.half_b;
  const int reference_axis = axis.index % 3;
  const double reference_sign = reference_R.col(reference_axis).dot(outward) < 0 ? -1 : 1;
  // Incident: the face of the other box that looks most against the normal.
  const Vector3 cosines = incident_R.transpose() * outward;
  Eigen::Index incident_axis = 0;
  cosines.cwiseAbs().maxCoeff(&incident_axis);
  const double incident_sign = cosines[incident_axis] > 0 ? -1 : 1;
  const std::array<Vector3, 4> reference =
      FaceCorners(of_b ? pair.between : centre_a, reference_R, reference_half, reference_axis, reference_sign);
  const std::array<Vector3, 4> incident = FaceCorners(of_b ? centre_a : pair.between, incident_R, incident_half,
                                                      static_cast<int>(incident_axis), incident_sign);
  ClipInput input;
  input.origin_W = pair.pose_a.position_W;
  input.reference = reference.data();
  input.num_reference = 4;
  input.normal = outward;
  input.incident = incident.data();
  input.num_incident = 4;
  input.reference_is_b = of_b;
  input.reference_face = 2 * reference_axis + (reference_sign > 0);
  input.incident_face = static_cast<int>(2 * incident_axis) + (incident_sign > 0);
  input.size = pair.size;
  input.reach = pair.reach;
  AppendFaceContacts(pair.shape_a, pair.pose_a, pair.shape_b, pair.pose_b, axis.score.separation, axis.normal, input,
                     contacts);
}

}  // namespace

void CollideBoxBox(const Shape& a, const Placement& pose_a, const Shape& b, const Placement& pose_b, double reach,
                   std::vector<Contact>* contacts, std::int8_t* separating) {
  const Pair pair(a, pose_a, b, pose_b, reach);
  if (*separating >= 0 && Separates(pair, *separating)) return;
  Axis face, edge;
  int out_of_reach = BestFace(pair, &face);
  if (out_of_reach < 0) out_of_reach = BestEdge(pair, face.score, &edge);
  *separating = static_cast<std::int8_t>(out_of_reach);
  if (out_of_reach >= 0) return;
  const Axis& best = edge.index >= 0 ? edge : face;
  if (AppendTouchingFeatures(a, pose_a, b, pose_b, best.normal, best.score.separation, pair.size, contacts)) return;
  if (edge.index >= 0) {
    if (AppendEdgeContact(pair, edge, contacts)) return;
    if (OnlyEdgesSeparate(face.score.separation, edge.score.separation)) {
      AppendNearestPoints(a, pose_a, b, pose_b, edge.normal, edge.score.separation, reach, contacts);
      return;
    }
  }
  AppendFaces(pair, face, contacts);
}

}  // namespace islet
