#include "scenes/file/scene_writer.h"

#include <array>
#include <cmath>
#include <map>
#include <span>
#include <stdexcept>
#include <string>
#include <utility>

#include "scenes/file/json_tree.h"
#include "scenes/file/number_format.h"
#include "scenes/file/scene_reader.h"
#include "scenes/setting_names.h"

namespace islet {
namespace {

// -0 without a point would be read as a whole number by some, and lose its sign.
std::string Number(double value) { return value == 0 && std::signbit(value) ? "-0.0" : ExactNumber(value); }

std::string Quote(const std::string& name) { return std::string(1, '"').append(name).append(1, '"'); }

std::string Array(std::span<const double> values) {
  std::string text = "[";
  for (const double value : values) text += (text.size() > 1 ? ", " : "") + Number(value);
  return text + "]";
}
std::string Array(const Vector3& v) { return Array(std::span<const double>(v.data(), 3)); }

// The members of an object, in one line.
class Line {
 public:
  void Add(const char* key, const std::string& value) {
    text_ += (text_.empty() ? "\"" : ", \"") + std::string(key) + "\": " + value;
  }
  std::string text() const { return "{" + text_ + "}"; }

 private:
  std::string text_;
};

std::string RegionText(const Region& region) {
  Line line;
  line.Add("lower", Array(region.lower));
  line.Add("upper", Array(region.upper));
  return line.text();
}

std::string ShapeText(const Shape& shape, int body) {
  Line line;
  switch (shape.kind()) {
    case ShapeKind::kSphere:
      line.Add("type", "\"sphere\"");
      line.Add("radius", Number(shape.girth()));
      break;
    case ShapeKind::kBox:
      line.Add("type", "\"box\"");
      line.Add("half_extents", Array(shape.half_extents()));
      break;
    case ShapeKind::kHalfSpace:
      line.Add("type", "\"half_space\"");
      break;
    case ShapeKind::kCapsule:
    case ShapeKind::kCylinder:
      line.Add("type", shape.kind() == ShapeKind::kCapsule ? "\"capsule\"" : "\"cylinder\"");
      line.Add("radius", Number(shape.girth()));
      line.Add("half_length", Number(shape.half_length()));
      break;
    case ShapeKind::kConvexHull: {
      std::string points;
      for (const Vector3& v : shape.polytope().vertices) points += (points.empty() ? "" : ", ") + Array(v);
      line.Add("type", "\"convex_hull\"");
      line.Add("points", "[" + points + "]");
      break;
    }
    case ShapeKind::kCustom:
      throw std::invalid_argument("body " + std::to_string(body) + ": a shape that is a function cannot be written");
  }
  return line.text();
}

const char* KindName(const Shape& shape) {
  static constexpr const char* kNames[] = {"sphere", "box", "half_space", "hull", "capsule", "cylinder", "custom"};
  return kNames[static_cast<int>(shape.kind())];
}

// Gives each different text a name, in the order of their coming.
class Names {
 public:
  std::string Of(const std::string& text, const std::string& stem) {
    const auto [known, fresh] = names_.try_emplace(text, "");
    if (fresh) {
      known->second = stem + "_" + std::to_string(++counts_[stem]);
      entries_ += (entries_.empty() ? "\n    \"" : ",\n    \"") + known->second + "\": " + text;
    }
    return Quote(known->second);
  }
  const std::string& entries() const { return entries_; }

 private:
  std::map<std::string, std::string> names_;
  std::map<std::string, int> counts_;
  std::string entries_;
};

// A world makes rotations of unit length, which may change the last bit of one that had it. So one close by is looked for that becomes it.
Quaternion BeforeNormalizing(const Quaternion& q) {
  Quaternion candidate = q;
  for (int i = 1; i <= 10'000; ++i) {
    if (candidate.normalized().coeffs() == q.coeffs()) return candidate;
    const int roundings = (i % 2 == 0 ? 1 : -1) * ((i + 1) / 2);
    candidate.coeffs() = q.coeffs() * (1 + roundings * 0x1p-52);
  }
  throw std::logic_error("no rotation was found that becomes (" + Number(q.w()) + ", " + Number(q.x()) + ", " +
                         Number(q.y()) + ", " + Number(q.z()) + ")");
}

std::string EffortText(const Effort& effort) {
  const char* const name = NameIn(kEfforts, effort);
  return name ? Quote(name) : std::to_string(effort.sweeps);
}

// Those that differ from the default.
std::string SettingsText(const Settings& s) {
  const Settings usual;
  Line line;
  if (s.model != usual.model) line.Add("model", Quote(NameIn(kModels, s.model)));
  if (s.cone != usual.cone) line.Add("cone", Quote(NameIn(kCones, s.cone)));
  if (s.bounce_law != usual.bounce_law) line.Add("bounce", Quote(NameIn(kBounceLaws, s.bounce_law)));
  if (s.bounce_limit != usual.bounce_limit) line.Add("bounce_limit", std::to_string(s.bounce_limit));
  if (s.freezing != usual.freezing) line.Add("freeze", Quote(NameIn(kFreezings, s.freezing)));
  if (s.freeze_count != usual.freeze_count) line.Add("freeze_count", std::to_string(s.freeze_count));
  if (s.freeze_seconds != usual.freeze_seconds) line.Add("freeze_seconds", Number(s.freeze_seconds));
  if (s.freeze_travel != usual.freeze_travel) line.Add("freeze_travel", Number(s.freeze_travel));
  if (s.tolerance != usual.tolerance) line.Add("tolerance", Number(s.tolerance));
  if (EffortText(s.effort) != EffortText(usual.effort)) line.Add("effort", EffortText(s.effort));
  std::string rungs;
  bool all = true;
  for (int r = 0; r < qp::kNumRungs; ++r) {
    all = all && s.ladder.Has(static_cast<qp::Rung>(r));
    if (s.ladder.Has(static_cast<qp::Rung>(r)))
      rungs += (rungs.empty() ? "\"" : ", \"") + std::string(qp::kRungNames[r]) + "\"";
  }
  if (!all) line.Add("ladder", "[" + rungs + "]");
  if (s.group_bodies != usual.group_bodies) line.Add("group_bodies", std::to_string(s.group_bodies));
  if (s.touch_gap != usual.touch_gap) line.Add("touch_gap", Number(s.touch_gap));
  if (s.overlap_tolerance != usual.overlap_tolerance) line.Add("overlap_tolerance", Number(s.overlap_tolerance));
  if (s.stateless != usual.stateless) line.Add("stateless", s.stateless ? "true" : "false");
  std::string volumes;
  for (const Region& region : s.cold_volumes) volumes += (volumes.empty() ? "" : ", ") + RegionText(region);
  if (!volumes.empty()) line.Add("cold_volumes", "[" + volumes + "]");
  return line.text();
}

std::string LayersText(std::uint32_t bits) {
  std::string text;
  for (int layer = 0; layer < 32; ++layer)
    if (bits & (std::uint32_t{1} << layer)) text += (text.empty() ? "" : ", ") + std::to_string(layer);
  return "[" + text + "]";
}

std::string InertiaText(const Matrix3& inertia) {
  std::string rows;
  for (int r = 0; r < 3; ++r) rows += (r ? ", " : "") + Array(Vector3(inertia.row(r)));
  return "[" + rows + "]";
}

// To the bit: not -0.
bool Zero(const Vector3& v) { return Array(v) == "[0, 0, 0]"; }

std::string BodyText(const World& world, int number, Names* shapes, Names* materials) {
  const Body& body = world.body(number);
  const Shape& shape = world.shape(number);
  Line line;
  line.Add("shape", shapes->Of(ShapeText(shape, number), KindName(shape)));
  if (body.kind != BodyKind::kDynamic) line.Add("kind", body.kind == BodyKind::kFixed ? "\"fixed\"" : "\"kinematic\"");
  if (body.kind == BodyKind::kDynamic) {
    line.Add("mass", Number(body.mass));
    if (body.inertia_B != shape.MassFromMass(body.mass).inertia_B) line.Add("inertia", InertiaText(body.inertia_B));
  }
  line.Add("position", Array(body.position_W));
  const Quaternion q = BeforeNormalizing(body.rotation_WB);
  const double wxyz[] = {q.w(), q.x(), q.y(), q.z()};
  if (Array(wxyz) != "[1, 0, 0, 0]") line.Add("rotation", Array(wxyz));
  if (!Zero(body.linear_velocity_W)) line.Add("velocity", Array(body.linear_velocity_W));
  if (!Zero(body.angular_velocity_W)) line.Add("angular_velocity", Array(body.angular_velocity_W));
  Line material;
  material.Add("friction", Number(body.friction));
  material.Add("restitution", Number(body.restitution));
  line.Add("material", materials->Of(material.text(), "material"));
  if (body.layers != 1) line.Add("layers", LayersText(body.layers));
  if (body.collides_with != 0xffffffff) line.Add("collides_with", LayersText(body.collides_with));
  if (body.sensor) line.Add("sensor", "true");
  if (!Zero(body.surface_velocity_B)) line.Add("surface_velocity", Array(body.surface_velocity_B));
  if (!Zero(body.force_W)) line.Add("force", Array(body.force_W));
  if (!Zero(body.torque_W)) line.Add("torque", Array(body.torque_W));
  return line.text();
}

}  // namespace

std::string WriteScene(const World& world, const SceneCaption& caption) {
  Names shapes, materials;
  std::string bodies;
  for (size_t i = 0; i < world.bodies().size(); ++i) {
    if (world.bodies()[i].removed) continue;
    bodies += (bodies.empty() ? "\n    " : ",\n    ") + BodyText(world, static_cast<int>(i), &shapes, &materials);
  }
  Line time;
  time.Add("dt", Number(caption.dt));
  time.Add("end", Number(caption.end));

  std::string text = "{\n  \"version\": " + std::to_string(kFormatVersion);
  const auto add = [&text](const char* key, const std::string& value) {
    text += ",\n  \"" + std::string(key) + "\": " + value;
  };
  add("title", JsonQuoted(caption.title));
  if (!caption.about.empty()) add("about", JsonQuoted(caption.about));
  if (!caption.expected.empty()) add("expected", JsonQuoted(caption.expected));
  add("units", "\"SI\"");
  if (caption.seed != 0) add("seed", std::to_string(caption.seed));
  add("gravity", Array(world.settings().gravity));
  if (const std::string settings = SettingsText(world.settings()); settings != "{}") add("settings", settings);
  add("time", time.text());
  if (caption.bounds) add("bounds", RegionText(*caption.bounds));
  if (caption.passed_z) add("passed_below", Number(*caption.passed_z));
  add("materials", "{" + materials.entries() + "\n  }");
  add("shapes", "{" + shapes.entries() + "\n  }");
  add("bodies", "[" + bodies + "\n  ]");
  return text + "\n}\n";
}

}  // namespace islet
