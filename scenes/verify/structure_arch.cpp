// T17: a semicircular arch of wedges. Whether it can stand is a small linear program, solved here by clipping a polygon;
// the engine must agree close to the limit.
//
// Half of the arch, by symmetry: at the crown acts a horizontal thrust H with moment M = H y about height 0 and no shear.
// Below joint k hang the wedges 1..k of weight w_i and centre x_i. On the joint at angle phi from the crown (through the
// origin, from radius r_in to r_out, direction e = (sin phi, cos phi), normal t = (cos phi, -sin phi)) acts H along x and
// the weight V = sum w_i downwards:
//   normal force  N = H cos phi + V sin phi,   shear  S = H sin phi - V cos phi   (along e, outwards on the lower part)
//   moment about the origin  m = M + sum w_i x_i;   the line of action crosses the joint at radius m / N
// It stands if H and M exist with N >= 0, r_in N <= m <= r_out N, |S| <= mu N at every joint: linear in (H, M).  A joint at
// the crown (even n) has phi = 0. Heyman, The stone skeleton (1966), safe theorem; joints carry no tension.
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <optional>
#include <string>
#include <vector>

#include "scenes/verify/builders.h"
#include "scenes/verify/structure_measures.h"

namespace islet::verify {
namespace {

constexpr double kRadius = 5;   // [m] of the middle line
constexpr double kBreadth = 1;  // [m]
constexpr double kFriction = 0.7;

struct Arch {
  int wedges;
  double thickness;                                                            // [m]
  double Angle(int joint) const { return std::numbers::pi * joint / wedges; }  // [rad] from the right springing
  double Inner() const { return kRadius - 0.5 * thickness; }
  double Outer() const { return kRadius + 0.5 * thickness; }
};

// Area and centre of wedge number i, a trapezium with straight chords.
struct Section {
  double area, x, z;
};
Section SectionOf(const Arch& arch, int i) {
  const double a = arch.Angle(i), b = arch.Angle(i + 1);
  const double half = 0.5 * (b - a), middle = 0.5 * (a + b);
  // Between the two chords at distances r cos(half), of lengths 2 r sin(half).
  const double inner = arch.Inner(), outer = arch.Outer(), slope = std::sin(half) * std::cos(half);
  const double area = slope * (outer * outer - inner * inner);
  const double radius = (2.0 / 3) * slope * std::cos(half) * (std::pow(outer, 3) - std::pow(inner, 3)) / area;
  return {area, radius * std::cos(middle), radius * std::sin(middle)};
}

using Point = std::array<double, 2>;  // (H, M), per unit weight density times breadth

// Keeps the part of a convex polygon where a H + b M <= c.
std::vector<Point> Clip(const std::vector<Point>& polygon, double a, double b, double c) {
  std::vector<Point> kept;
  const auto excess = [&](const Point& p) { return a * p[0] + b * p[1] - c; };
  for (size_t i = 0; i < polygon.size(); ++i) {
    const Point &p = polygon[i], &q = polygon[(i + 1) % polygon.size()];
    const double ep = excess(p), eq = excess(q);
    if (ep <= 0) kept.push_back(p);
    if ((ep < 0 && eq > 0) || (ep > 0 && eq < 0)) {
      const double s = ep / (ep - eq);
      kept.push_back({p[0] + s * (q[0] - p[0]), p[1] + s * (q[1] - p[1])});
    }
  }
  return kept;
}

// [thrust over weight density and breadth, m^2] smallest and largest H with which the arch can stand; none: it falls.
struct Thrust {
  double least, most;
};
std::optional<Thrust> FindThrust(const Arch& arch, double friction) {
  const double size = 100 * kRadius * kRadius;
  std::vector<Point> polygon = {{0, 0}, {size, 0}, {size, size * kRadius}, {0, size * kRadius}};
  double weight = 0, moment = 0;  // of what hangs between crown and joint: sum w, sum w x
  // From the crown down the right side; with odd n the crown is the middle of the keystone, and no joint.
  for (int joint = arch.wedges / 2; joint >= 0; --joint) {
    const bool keystone = arch.wedges % 2 == 1 && joint == arch.wedges / 2;
    if (keystone) {
      const double half = 0.5 * std::numbers::pi / arch.wedges;
      const double inner = arch.Inner() * std::cos(half), outer = arch.Outer() * std::cos(half);
      // Right half of the trapezium: width at height z is z tan(half); centre of mass by integration.
      const double area = 0.5 * std::tan(half) * (outer * outer - inner * inner);
      weight += area;
      moment += std::pow(std::tan(half), 2) * (std::pow(outer, 3) - std::pow(inner, 3)) / 6;
    } else if (joint < arch.wedges / 2) {
      const Section section = SectionOf(arch, joint);
      weight += section.area;
      moment += section.area * section.x;
    }
    const double phi = 0.5 * std::numbers::pi - arch.Angle(joint), sine = std::sin(phi), cosine = std::cos(phi);
    // m - r_out N <= 0,  r_in N - m <= 0,  +-S - mu N <= 0 with m = M + moment.
    polygon = Clip(polygon, -arch.Outer() * cosine, 1, arch.Outer() * weight * sine - moment);
    polygon = Clip(polygon, arch.Inner() * cosine, -1, moment - arch.Inner() * weight * sine);
    polygon = Clip(polygon, sine - friction * cosine, 0, weight * (cosine + friction * sine));
    polygon = Clip(polygon, -sine - friction * cosine, 0, weight * (-cosine + friction * sine));
  }
  if (polygon.empty()) return std::nullopt;
  const auto [least, most] = std::minmax_element(polygon.begin(), polygon.end());
  return Thrust{(*least)[0], (*most)[0]};
}

// [1] smallest thickness over radius with which it stands.
double CriticalThickness(int wedges, double friction) {
  double falls = 0.01, stands = 0.5;
  while (stands - falls > 1e-10) {
    const double middle = 0.5 * (falls + stands);
    (FindThrust({wedges, middle * kRadius}, friction) ? stands : falls) = middle;
  }
  return stands;
}

// Corners of wedge i, W: it stands in the plane of x and z.
std::vector<Vector3> CornersOf(const Arch& arch, int i) {
  std::vector<Vector3> corners;
  for (const int joint : {i, i + 1})
    for (const double radius : {arch.Inner(), arch.Outer()})
      for (const double y : {-0.5 * kBreadth, 0.5 * kBreadth})
        corners.emplace_back(radius * std::cos(arch.Angle(joint)), y, radius * std::sin(arch.Angle(joint)));
  return corners;
}

struct ArchRun {
  double travel = 0;   // [m] of any wedge's corner
  double weight = 0;   // off: load on the ground against the weight, over it
  double balance = 0;  // momentum of both springings together along x, over the weight
  double thrust = 0;   // [N] at the right springing in the last frame
};

ArchRun RunArch(const CheckSettings& settings, const Arch& arch, double seconds) {
  World world(settings.engine);
  const int ground = world.Add(Floor(kFriction));
  std::vector<int> wedges;
  for (int i = 0; i < arch.wedges; ++i) {
    const Shape shape = Shape::ConvexHull(CornersOf(arch, i));
    wedges.push_back(world.Add(
        {.shape = shape, .density = 1, .position_W = shape.hull_offset(), .friction = kFriction, .restitution = 0}));
  }
  const std::vector<Body> start(world.bodies().begin(), world.bodies().end());
  const double weight = Weight(world);
  ArchRun run;
  for (int frame = 0; frame < Frames(seconds, settings.dt); ++frame) {
    world.Step(settings.dt);
    const Vector3 load = -ImpulseOn(world, ground) / settings.dt;
    run.weight = std::max(run.weight, std::abs(load.z() / weight - 1));
    run.balance = std::max(run.balance, std::abs(load.x()) / weight);
    for (const int i : wedges) run.travel = std::max(run.travel, Travel(world.shape(i), start[i], world.body(i)));
    if (run.travel > kRadius) break;  // it has fallen
  }
  run.thrust = std::abs(ImpulseBetween(world, ground, wedges.front()).x()) / settings.dt;
  return run;
}

void MeasureArchOf(const CheckSettings& settings, int wedges, Measurements* out) {
  const double critical = CriticalThickness(wedges, kFriction);
  const std::string name = ", " + std::to_string(wedges) + " wedges";
  const Arch thick{wedges, 1.005 * critical * kRadius}, thin{wedges, 0.995 * critical * kRadius};
  const ArchRun stands = RunArch(settings, thick, 5);
  out->AtMost("farthest travel of a corner in 5 s, 1.005 x critical" + name, "m", stands.travel, 1e-6);
  out->AtMost("load on the ground against the weight, 1.005 x critical" + name, "of the weight", stands.weight, 1e-6);
  out->AtMost("thrust right against left, 1.005 x critical" + name, "of the weight", stands.balance, 1e-6);
  const Thrust range = FindThrust(thick, kFriction).value();
  const double middle = 0.5 * (range.most + range.least) * kBreadth * kGravity;
  out->Absolute("thrust, 1.005 x critical" + name, "N", middle, stands.thrust,
                0.5 * (range.most - range.least) * kBreadth * kGravity * (1 + 1e-6),
                "any thrust between the program's least and most is right");
  const ArchRun falls = RunArch(settings, thin, 5);
  out->Verdict("falls within 5 s, 0.995 x critical" + name, true, falls.travel > thin.thickness);
}

}  // namespace

void MeasureArch(const CheckSettings& settings, Measurements* out) {
  // The second source: 0.1075 of Milankovitch (1907), as quoted by Ochsendorf, The Structural Engineer 84 (2006).
  out->Absolute("critical thickness over radius by the program, 2000 wedges", "", 0.1075,
                CriticalThickness(2000, kFriction), 5e-5);
  MeasureArchOf(settings, 15, out);
  MeasureArchOf(settings, 16, out);
  if (!settings.quick) MeasureArchOf(settings, 31, out);
}

}  // namespace islet::verify
