#include "engine/geometry/round_contact.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <utility>

#include "engine/geometry/curve_distance.h"
#include "engine/geometry/edge_contact.h"
#include "qp/elementary.h"
#include "qp/smallness.h"

namespace islet {
namespace {

constexpr std::uint32_t kRimPoints = 8;  // of an end that stands flat, beside its lowest point

// Whether a face whose normal has this cosine with the contact's lies flat, to kLevel.
bool LiesFlat(double cosine) { return cosine * cosine > 1 - kLevel * kLevel; }

// One of the places on the rim of an end that stays with the body as it turns.
Vector3 RimPoint(const Circle& rim, const Matrix3& rotation, std::uint32_t k) {
  const double angle = 2 * std::numbers::pi * k / kRimPoints;
  return rim.centre + rim.radius * (Cosine(angle) * rotation.col(0) + Sine(angle) * rotation.col(1));
}

// What a body may meet others with, about an origin that both bodies share. Bodies are as thick as `girth` around their points and lines.
struct Solid {
  const Shape* shape;
  Matrix3 rotation;
  double girth = 0;                    // around points: of spheres and capsules
  double wall = 0;                     // around lines: of capsules and of the axis of a cylinder
  std::vector<Vector3> points, faces;  // faces: their normals
  std::vector<Line> lines;
  std::vector<Circle> circles;

  Vector3 axis() const { return rotation.col(2); }
  void Load(const Shape& of, const Vector3& at, const Matrix3& turned);
  Vector3 Farthest(const Vector3& direction) const;
  double Extent(const Vector3& direction) const { return direction.dot(Farthest(direction)); }
  bool HasUnder(const Vector3& face, const Vector3& point, double depth) const;
};

void Solid::Load(const Shape& of, const Vector3& at, const Matrix3& turned) {
  shape = &of;
  rotation = turned;
  girth = wall = 0;
  points.clear(), faces.clear(), lines.clear(), circles.clear();
  const Vector3 half = of.half_length() * axis();
  switch (of.kind()) {
    case ShapeKind::kSphere:
      girth = of.girth();
      points.push_back(at);
      return;
    case ShapeKind::kCapsule:
      girth = wall = of.girth();
      points = {at - half, at + half};
      lines.push_back({at - half, 2 * half});
      return;
    case ShapeKind::kCylinder:
      wall = of.girth();
      faces = {-axis(), axis()};
      lines.push_back({at - half, 2 * half});
      circles = {{at - half, axis(), of.girth()}, {at + half, axis(), of.girth()}};
      return;
    default:
      for (const Vector3& v : of.polytope().vertices) points.push_back(at + turned * v);
      for (const Vector3& n : of.polytope().face_normals) faces.push_back(turned * n);
      for (const auto& [from, to] : of.polytope().edges) lines.push_back({points[from], points[to] - points[from]});
  }
}

Vector3 Solid::Farthest(const Vector3& direction) const {
  if (shape->kind() == ShapeKind::kCylinder)
    return FarthestOnCircle(circles[axis().dot(direction) > 0], direction, rotation.col(0));
  size_t best = 0;
  double height = -1e300;
  for (size_t i = 0; i < points.size(); ++i)
    if (const double h = direction.dot(points[i]); h > height) height = h, best = i;
  return points[best] + girth * direction;
}

// Whether a point of a face, or one this deep below it, is at least as deep inside of all that is beside the face.
bool Solid::HasUnder(const Vector3& face, const Vector3& point, double depth) const {
  if (shape->kind() == ShapeKind::kCylinder) {
    const Vector3 r = point - 0.5 * (circles[0].centre + circles[1].centre);
    return depth <= shape->half_length() && (r - axis().dot(r) * axis()).norm() <= shape->girth() - depth;
  }
  for (size_t f = 0; f < faces.size(); ++f)
    if (faces[f] != face && faces[f].dot(point - points[shape->polytope().faces[f][0]]) > -depth) return false;
  return true;
}

// The direction that separates best, and where the bodies are nearest along it.
struct Nearest {
  Vector3 normal = Vector3::UnitZ(), on_a = Vector3::Zero(), on_b = Vector3::Zero();
  double gap = -INFINITY;
};

class Search {
 public:
  Search(const Solid& a, const Solid& b) : a_(a), b_(b), size_(std::min(a.shape->size(), b.shape->size())) {}

  // Beyond `reach` [m] it stops at the first direction that says so; `between` is one: from centre to centre.
  Nearest Find(double reach, const Vector3& between) {
    FindBest(reach, between);
    if (a_.circles.size() > 0 && b_.circles.size() > 0 && std::abs(best_.gap) <= kTouch * size_) TakeMiddleOfRims();
    return best_;
  }

 private:
  void FindBest(double reach, const Vector3& between) {
    for (const Vector3& n : a_.faces) TryFace(a_, n, true);
    for (const Vector3& n : b_.faces) TryFace(b_, n, false);
    if (best_.gap > reach || settled_) return;
    if (between.squaredNorm() > 0) {
      if (const double gap = GapAlong(between.normalized()); gap > reach) {
        best_ = {.gap = gap};
        return;
      }
    }
    TryAll();
    if (best_.gap == -INFINITY) TryDirection(a_.rotation.col(0), false);  // a ball in the middle of a capsule
  }

  // What cost least comes first: once found, the nearest points of bodies that are apart need no other.
  void TryAll() {
    for (const Vector3& p : a_.points) {
      for (const Vector3& q : b_.points) TryPoints(p, q, a_.girth, b_.girth);
      TryPoint(p, a_.girth, b_, 1);
    }
    for (const Vector3& q : b_.points) TryPoint(q, b_.girth, a_, -1);
    for (const Line& p : a_.lines)
      for (const Line& q : b_.lines) TryCurves(NearestOfLines(p, q), false, &p, &q);
    if (nearest_) return;
    for (const Line& p : a_.lines)
      for (const Circle& q : b_.circles)
        if (!nearest_) TryCurves(NearestOfCircleAndLine(q, p), true, &p, nullptr);
    for (const Circle& p : a_.circles) {
      for (const Line& q : b_.lines)
        if (!nearest_) TryCurves(NearestOfCircleAndLine(p, q), false, nullptr, &q);
      for (const Circle& q : b_.circles)
        if (!nearest_) TryCurves(NearestOfCircles(p, q), false, nullptr, nullptr);
    }
  }

  double GapAlong(const Vector3& n) const { return -b_.Extent(-n) - a_.Extent(n); }
  bool Better(double gap) const { return gap > best_.gap + kNegligible * size_; }

  // A face of one meets what of the other is nearest along its normal. Where that is over the face, no direction separates more; nor where
  // it is in the body, and as deep below all else as below the face.
  void TryFace(const Solid& of, const Vector3& face, bool of_a) {
    if (!TryDirection(of_a ? face : Vector3(-face), of_a)) return;
    const Vector3& other = of_a ? best_.on_b : best_.on_a;
    settled_ = of.HasUnder(face, other - std::max(0.0, best_.gap) * face, std::max(0.0, -best_.gap));
  }

  // Returns whether it is better than what is known. The nearest point is one of the other body than that.
  bool TryDirection(const Vector3& n, bool of_a) {
    const Vector3 on_a = a_.Farthest(n), on_b = b_.Farthest(-n);
    const double gap = n.dot(on_b - on_a);
    if (!Better(gap)) return false;
    best_ = of_a ? Nearest{n, on_b - gap * n, on_b, gap} : Nearest{n, on_a, on_a + gap * n, gap};
    return true;
  }

  // Points on the surfaces that are farthest along n, as those of two bodies are where they are nearest.
  // `real`: they are points of the bodies, not of what goes on beyond them.
  void TryPlace(const Vector3& n, const Vector3& on_a, const Vector3& on_b, bool real) {
    const double gap = GapAlong(n);
    if (!Better(gap) || std::abs(n.dot(on_b - on_a) - gap) > kNegligible * size_) return;
    best_ = {n, on_a, on_b, gap};
    nearest_ = real && gap > kNegligible * size_ && (on_b - on_a - gap * n).norm() <= kNegligible * size_;
  }

  // Whether a point of a line that goes on beyond its ends lies between these.
  static bool IsBetweenEnds(const Line& line, const Vector3& point) {
    const double along = (point - line.from).dot(line.way);
    return along >= 0 && along <= line.way.squaredNorm();
  }

  // The lines of a and b of the pair, if they are lines: those of round bodies lie below their surfaces.
  void TryCurves(const CurvePlaces& places, bool swapped, const Line* line_a, const Line* line_b) {
    const double radius_a = line_a ? a_.wall : 0, radius_b = line_b ? b_.wall : 0;
    for (int k = 0; k < places.count; ++k) {
      const CurvePlace& place = places.place[k];
      const Vector3 &p = swapped ? place.on_q : place.on_p, &q = swapped ? place.on_p : place.on_q;
      Vector3 cross = place.tangent_p.cross(place.tangent_q);
      if (cross.norm() < kNegligible) {  // side by side: from one to the other
        cross = q - p - place.tangent_p.dot(q - p) * place.tangent_p;
        if (cross.norm() <= kNegligible * size_) continue;
      }
      for (const double sign : {1.0, -1.0}) {
        const Vector3 n = sign * cross.normalized();
        TryPlace(n, p + radius_a * n, q - radius_b * n,
                 (!line_a || IsBetweenEnds(*line_a, p)) && (!line_b || IsBetweenEnds(*line_b, q)));
      }
    }
  }

  // Where two rims touch side by side, all directions between the ends and walls that meet there separate as well: halfway between. Ends
  // that lie on each other decide for themselves.
  void TakeMiddleOfRims() {
    const Vector3 touch = 0.5 * (best_.on_a + best_.on_b);
    if (a_.axis().cross(b_.axis()).norm() < kAngle) return;
    Vector3 sum = Vector3::Zero();
    bool several = false;
    const auto add = [&](const Vector3& n) {
      if (GapAlong(n) < best_.gap - kTouch * size_) return;
      sum += n;
      several = several || best_.normal.cross(n).norm() > kAngle;
    };
    for (const Solid* of : {&a_, &b_}) {
      const double sign = of == &a_ ? 1 : -1;
      for (const Vector3& end : of->faces) add(sign * end);
      const Vector3 r = touch - of->circles[0].centre;
      add(sign * (r - of->axis().dot(r) * of->axis()).normalized());
    }
    if (!several) return;
    const Vector3 n = sum.normalized(), on_a = a_.Farthest(n), on_b = b_.Farthest(-n);
    best_ = {n, on_a, on_b, n.dot(on_b - on_a)};
  }

  void TryPoints(const Vector3& p, const Vector3& q, double radius_a, double radius_b) {
    const double apart = (q - p).norm();
    if (apart <= kNegligible * size_) return;
    const Vector3 n = (q - p) / apart;
    TryPlace(n, p + radius_a * n, q - radius_b * n, true);
  }

  // A point of one against the curves of the other; sign: 1 if it is a's.
  void TryPoint(const Vector3& point, double radius, const Solid& other, double sign) {
    const auto attempt = [&](const Vector3& on_other, double other_radius) {
      if (sign > 0) return TryPoints(point, on_other, radius, other_radius);
      TryPoints(on_other, point, other_radius, radius);
    };
    for (const Line& line : other.lines) {
      const double along = (point - line.from).dot(line.way) / line.way.squaredNorm();
      if (along > 0 && along < 1) attempt(line.from + along * line.way, other.wall);
    }
    for (const Circle& circle : other.circles)
      attempt(FarthestOnCircle(circle, point - circle.centre, other.rotation.col(0)), 0);
  }

  const Solid &a_, &b_;
  double size_;
  Nearest best_;
  // These points are as far apart as the bodies are along the normal: no direction separates more.
  bool nearest_ = false;
  bool settled_ = false;  // no other direction can be better than that of the face
};

// What of a body lies flat along the normal: nothing, the two ends of a long side, or the corners of a face.
struct Figure {
  std::vector<Vector3> corners;  // on the surface
  double radius = 0;             // of a round face, about its middle; 0: its corners are all there is
  double girth = 0;              // of a long side, about its core
  bool blunt = false;            // its ends are flat
  std::array<Vector3, 2> core;
  Vector3 middle, normal;  // of a face

  bool IsFace() const { return corners.size() > 2; }
  bool IsSide() const { return corners.size() == 2; }
};

void FindFigure(const Solid& solid, const Vector3& n, Figure* figure) {
  figure->corners.clear();
  figure->radius = figure->girth = 0;
  figure->blunt = false;
  const Shape& shape = *solid.shape;
  if (shape.kind() == ShapeKind::kSphere) return;
  if (shape.HasAxis()) {
    const double along = solid.axis().dot(n);
    if (shape.kind() == ShapeKind::kCylinder && LiesFlat(along)) {
      const Circle& end = solid.circles[along > 0];
      for (std::uint32_t k = 0; k < kRimPoints; ++k) figure->corners.push_back(RimPoint(end, solid.rotation, k));
      figure->radius = end.radius;
      figure->middle = end.centre;
      figure->normal = along > 0 ? solid.axis() : Vector3(-solid.axis());
    } else if (std::abs(along) < kLevel) {
      figure->girth = shape.girth();
      figure->core = {solid.lines[0].from, solid.lines[0].from + solid.lines[0].way};
      const bool capsule = shape.kind() == ShapeKind::kCapsule;
      const Vector3 across = capsule ? n : Vector3((n - along * solid.axis()).normalized());
      for (const Vector3& end : figure->core) figure->corners.push_back(end + figure->girth * across);
      figure->blunt = !capsule;
    }
    return;
  }
  const Polytope& polytope = shape.polytope();
  size_t top = 0;
  for (size_t f = 1; f < solid.faces.size(); ++f)
    if (solid.faces[f].dot(n) > solid.faces[top].dot(n)) top = f;
  if (LiesFlat(solid.faces[top].dot(n))) {
    for (const int v : polytope.faces[top]) figure->corners.push_back(solid.points[v]);
    figure->middle = figure->corners[0];
    figure->normal = solid.faces[top];
    return;
  }
  const Line* side = nullptr;  // the highest edge that is level
  double height = -1e300;
  for (const Line& edge : solid.lines) {
    if (std::abs(n.dot(edge.way)) > kLevel * edge.way.norm()) continue;
    const double h = n.dot(edge.from + 0.5 * edge.way);
    if (h > height) height = h, side = &edge;
  }
  if (!side) return;
  figure->core = {side->from, side->from + side->way};
  figure->corners.assign(figure->core.begin(), figure->core.end());
}

class Manifold {
 public:
  Manifold(const Solid& a, const Solid& b, const Nearest& nearest, double reach, std::vector<Contact>* contacts)
      : a_(a),
        b_(b),
        nearest_(nearest),
        reach_(reach),
        size_(std::min(a.shape->size(), b.shape->size())),
        contacts_(contacts),
        first_(contacts->size()),
        frame_(ContactFrame(nearest.normal)) {}

  void Append() {
    static thread_local Figure of_a, of_b;
    const Vector3& n = nearest_.normal;
    FindFigure(a_, n, &of_a);
    FindFigure(b_, -n, &of_b);
    if (of_a.IsSide() && of_b.IsSide()) {
      AlongSides(of_a, of_b, true);
      AlongSides(of_b, of_a, false);
    } else if (!of_a.corners.empty() && !of_b.corners.empty()) {
      Overlay(of_a, of_b);
    }
    // The nearest points lead, unless one of those found is as near.
    for (size_t c = first_; c < contacts_->size(); ++c)
      if ((*contacts_)[c].gap <= nearest_.gap + kNegligible * size_) return;
    Add(0, nearest_.on_a, nearest_.on_b, n, nearest_.gap);
  }

 private:
  void Add(std::uint32_t feature, const Vector3& on_a, const Vector3& on_b, const Vector3& n, double gap) {
    if (gap > reach_) return;
    const Vector3 point = 0.5 * (on_a + on_b);
    for (size_t c = first_; c < contacts_->size(); ++c)
      if (((*contacts_)[c].point_W - point).norm() <= kSamePoint * size_) return;
    contacts_->push_back(MakeContact(point, n, gap, feature));
  }

  // Where along a side, as a share of it, an end of the other passes: of a cylinder the plane of its end.
  static double PlaceAlong(const Figure& ends, size_t k, const Figure& side) {
    const Vector3 way = side.core[1] - side.core[0], own = ends.core[1] - ends.core[0];
    const Vector3& across = ends.blunt ? own : way;
    return (ends.core[k] - side.core[0]).dot(across) / way.dot(across);
  }
  static bool IsBeside(double place) { return place >= 0 && place <= 1; }

  // The ends of one long side beside the other, if they lie along each other. Where both end together there is one contact, which keeps its
  // name whatever end is the inner one; tilted in their plane, neither may be beside the other.
  void AlongSides(const Figure& ends, const Figure& side, bool of_a) {
    const Vector3 way = side.core[1] - side.core[0], own = ends.core[1] - ends.core[0];
    if (own.cross(way).norm() > kLevel * own.norm() * way.norm()) return;
    const Vector3& across = ends.blunt ? own : way;
    const double sign = of_a ? 1 : -1;
    bool named[2] = {false, false};  // both ends of a short side may be near the same one of a long side
    for (size_t k = 0; k < 2; ++k) {
      const Vector3& end = ends.core[k];
      const double place = PlaceAlong(ends, k, side);
      const size_t other = place > 0.5;
      const double apart_along = std::abs(way.normalized().dot(end - side.core[other]));
      const bool together = apart_along <= kLevel * (ends.girth + side.girth),
                 other_beside = together && IsBeside(PlaceAlong(side, other, ends));
      if (IsBeside(place) ? !of_a && other_beside : !of_a || !together || other_beside) continue;
      const Vector3 on_core = side.core[0] + std::clamp(place, 0.0, 1.0) * way;
      Vector3 between = sign * (on_core - end);
      if (ends.blunt || side.blunt) between -= across.dot(between) / across.squaredNorm() * across;
      if (between.dot(nearest_.normal) <= kNegligible * size_) continue;
      const double apart = between.norm();
      double gap = apart - ends.girth - side.girth;
      if (!IsBeside(place)) gap = std::max(gap, nearest_.gap);
      if (gap < nearest_.gap - kNegligible * size_) continue;  // deeper than the separation: beside what they share
      const Vector3 n = between / apart, own_surface = end + sign * ends.girth * n,
                    surface = on_core - sign * side.girth * n;
      const bool shared = together && !std::exchange(named[other], true);
      const size_t name = of_a ? 1 + k : shared ? 1 + other : 3 + k;
      Add(static_cast<std::uint32_t>(name), of_a ? own_surface : surface, of_a ? surface : own_surface, n, gap);
    }
  }

  // Corners of what the two figures share, seen along the normal.
  void Overlay(const Figure& of_a, const Figure& of_b) {
    for (const bool mine : {true, false}) {
      const Figure &figure = mine ? of_a : of_b, &other = mine ? of_b : of_a;
      for (size_t k = 0; k < figure.corners.size(); ++k)
        if (IsInside(figure.corners[k], other)) AddColumn(Name(mine ? 1 : 2, k, 0), figure.corners[k], of_a, of_b);
    }
    const size_t edges_a = NumEdges(of_a), edges_b = NumEdges(of_b);
    for (size_t i = 0; i < edges_a; ++i)
      for (size_t k = 0; k < edges_b; ++k) CrossEdges(Name(3, i, k), Edge(of_a, i), Edge(of_b, k), of_a, of_b);
    if (of_b.radius > 0)
      for (size_t i = 0; i < edges_a; ++i) CrossCircle(Name(4, i, 0), Edge(of_a, i), of_b, of_a, of_b);
    if (of_a.radius > 0)
      for (size_t k = 0; k < edges_b; ++k) CrossCircle(Name(5, 0, k), Edge(of_b, k), of_a, of_a, of_b);
    if (of_a.radius > 0 && of_b.radius > 0) CrossCircles(of_a, of_b);
  }

  static std::uint32_t Name(std::uint32_t kind, size_t i, size_t k) {
    return kind << 28 | (static_cast<std::uint32_t>(i) & 0x3fff) << 14 | (static_cast<std::uint32_t>(k) & 0x3fff);
  }
  // Round faces have no edges: their corners are points of the rim.
  static size_t NumEdges(const Figure& f) { return f.radius > 0 ? 0 : f.IsSide() ? 1 : f.corners.size(); }
  static Line Edge(const Figure& f, size_t k) {
    return {f.corners[k], f.corners[(k + 1) % f.corners.size()] - f.corners[k]};
  }
  Eigen::Vector2d Flat(const Vector3& v) const { return {frame_.col(1).dot(v), frame_.col(2).dot(v)}; }
  static double Cross(const Eigen::Vector2d& p, const Eigen::Vector2d& q) { return p.x() * q.y() - p.y() * q.x(); }

  bool IsInside(const Vector3& point, const Figure& figure) const {
    if (!figure.IsFace()) return false;
    if (figure.radius > 0) return Flat(point - figure.middle).norm() <= figure.radius + kNegligible * size_;
    // A face is seen from outside of its body: counter-clockwise along its own normal.
    const double sense = figure.normal.dot(nearest_.normal) > 0 ? 1 : -1;
    for (size_t k = 0; k < figure.corners.size(); ++k) {
      const Line edge = Edge(figure, k);
      const Eigen::Vector2d way = Flat(edge.way);
      if (sense * Cross(way, Flat(point - edge.from)) < -kNegligible * size_ * way.norm()) return false;
    }
    return true;
  }

  void CrossEdges(std::uint32_t name, const Line& p, const Line& q, const Figure& of_a, const Figure& of_b) {
    const Eigen::Vector2d u = Flat(p.way), v = Flat(q.way), d = Flat(q.from - p.from);
    const double cross = Cross(u, v);
    if (std::abs(cross) <= kNegligible * u.norm() * v.norm()) return;
    const double s = Cross(d, v) / cross, t = Cross(d, u) / cross;
    const double slack = kNegligible * size_, slack_s = slack / u.norm(), slack_t = slack / v.norm();
    if (s < -slack_s || s > 1 + slack_s || t < -slack_t || t > 1 + slack_t) return;
    AddColumn(name, p.from + s * p.way, of_a, of_b);
  }

  // Where the line along the normal through a point meets the plane of a face.
  Vector3 OnFace(const Figure& face, const Vector3& point) const {
    const Vector3& n = nearest_.normal;
    return point + face.normal.dot(face.middle - point) / face.normal.dot(n) * n;
  }

  void CrossCircle(std::uint32_t name, const Line& edge, const Figure& round, const Figure& of_a, const Figure& of_b) {
    const Vector3 from = OnFace(round, edge.from) - round.middle,
                  way = OnFace(round, edge.from + edge.way) - round.middle - from;
    const double a = way.squaredNorm(), b = way.dot(from), c = from.squaredNorm() - round.radius * round.radius;
    const double discriminant = b * b - a * c;
    if (a <= 0 || discriminant <= 0) return;
    for (const int which : {0, 1}) {
      const double t = (-b + (which ? 1 : -1) * std::sqrt(discriminant)) / a;
      if (t >= 0 && t <= 1)
        AddColumn(name | static_cast<std::uint32_t>(which) << 27, edge.from + t * edge.way, of_a, of_b);
    }
  }

  void CrossCircles(const Figure& of_a, const Figure& of_b) {
    const Eigen::Vector2d between = Flat(of_b.middle - of_a.middle);
    const double apart = between.norm();
    if (apart <= kNegligible * size_) return;
    const double along = (apart * apart + of_a.radius * of_a.radius - of_b.radius * of_b.radius) / (2 * apart);
    const double square = of_a.radius * of_a.radius - along * along;
    if (square <= 0) return;
    const Eigen::Vector2d way = between / apart, across(-way.y(), way.x());
    for (const double sign : {1.0, -1.0}) {
      const Eigen::Vector2d at = along * way + sign * std::sqrt(square) * across;
      AddColumn(Name(6, sign > 0, 0), of_a.middle + at.x() * frame_.col(1) + at.y() * frame_.col(2), of_a, of_b);
    }
  }

  // A contact where the line along the normal through a point meets both figures.
  void AddColumn(std::uint32_t feature, const Vector3& point, const Figure& of_a, const Figure& of_b) {
    const Vector3& n = nearest_.normal;
    const auto surface = [&](const Figure& f) -> Vector3 {
      if (f.IsFace()) return OnFace(f, point);
      const Line side = Edge(f, 0);
      const Eigen::Vector2d way = Flat(side.way);
      return side.from + Flat(point - side.from).dot(way) / way.squaredNorm() * side.way;
    };
    const Vector3 on_a = surface(of_a), on_b = surface(of_b);
    const double gap = n.dot(on_b - on_a);
    // What lies deeper than the separation is beside what they share.
    if (gap < nearest_.gap - kNegligible * size_) return;
    Add(feature, on_a, on_b, n, gap);
  }

  const Solid &a_, &b_;
  const Nearest& nearest_;
  double reach_, size_;
  std::vector<Contact>* contacts_;
  size_t first_;
  Matrix3 frame_;
};

}  // namespace

void CollideHalfSpaceRound(const Placement& half_space, const Shape& shape, const Placement& pose, double reach,
                           std::vector<Contact>* contacts) {
  const Vector3 normal = half_space.rotation_WB.col(2), axis = pose.rotation_WB.col(2);
  const double height = normal.dot(pose.position_W - half_space.position_W), along = axis.dot(normal);
  const auto add = [&](std::uint32_t feature, const Vector3& from_centre) {
    const double gap = height + normal.dot(from_centre);
    if (gap <= reach)
      contacts->push_back(MakeContact(pose.position_W + from_centre - 0.5 * gap * normal, normal, gap, feature));
  };
  const bool capsule = shape.kind() == ShapeKind::kCapsule;
  if (!capsule && LiesFlat(along)) {  // it may stand: all around the lower rim, and its lowest point
    const Circle rim{(along > 0 ? -1 : 1) * shape.half_length() * axis, axis, shape.girth()};
    for (std::uint32_t k = 0; k < kRimPoints; ++k) add(2 + k, RimPoint(rim, pose.rotation_WB, k));
    const Vector3 down = -normal + along * axis;
    if (down.norm() > kNegligible) add(along > 0 ? 0 : 1, rim.centre + rim.radius * down.normalized());
    return;
  }
  for (const std::uint32_t k : {0u, 1u}) {
    const Vector3 end = (k == 0 ? -1 : 1) * shape.half_length() * axis;
    add(k, end + shape.girth() * (capsule ? Vector3(-normal) : Vector3((-normal + along * axis).normalized())));
  }
}

void CollideRound(const Shape& a, const Placement& pose_a, const Shape& b, const Placement& pose_b, double reach,
                  std::vector<Contact>* contacts) {
  static thread_local Solid of_a, of_b;
  of_a.Load(a, Vector3::Zero(), pose_a.rotation_WB);
  of_b.Load(b, pose_b.position_W - pose_a.position_W, pose_b.rotation_WB);
  const Nearest nearest = Search(of_a, of_b).Find(reach, pose_b.position_W - pose_a.position_W);
  if (nearest.gap > reach) return;
  const size_t first = contacts->size();
  Manifold(of_a, of_b, nearest, reach, contacts).Append();
  for (size_t c = first; c < contacts->size(); ++c) (*contacts)[c].point_W += pose_a.position_W;
}

}  // namespace islet
