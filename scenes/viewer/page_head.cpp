#include "scenes/viewer/page_head.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <vector>

#include "scenes/setting_names.h"

namespace islet {
namespace {

using Json = nlohmann::ordered_json;

// visit(name, value) of the numbers of a frame, in the order of the curves.
template <typename Visit>
void VisitNumbers(const FilmFrame& frame, const Visit& visit) {
  const FilmNumbers& n = frame.numbers;
  const StageSeconds& s = n.stages;
  const float accuracy = frame.accuracy.empty() ? 0 : *std::max_element(frame.accuracy.begin(), frame.accuracy.end());
  visit("number", frame.number);
  visit("time", frame.time);
  visit("accuracy", accuracy);
  visit("contacts", n.contacts);
  visit("islands", n.islands);
  visit("awake", n.awake);
  visit("frozen", n.frozen);
  visit("step_seconds", n.step_seconds);
  visit("detect", s.detect);
  visit("cut_islands", s.islands);
  visit("pq", s.pq);
  visit("collision_qp", s.collision_qp);
  visit("static_qp", s.static_qp);
  visit("freeze", s.freeze);
  visit("move", s.move);
  visit("kinetic", n.kinetic);
  visit("potential", n.potential);
  visit("coulomb_map", n.coulomb_map);
  visit("penetration", n.penetration);
  visit("energy_created", n.energy_created);
  visit("momentum_unexplained", n.momentum_unexplained);
  visit("angular_momentum_unexplained", n.angular_momentum_unexplained);
  visit("sides_changed", n.sides_changed);
  visit("overlapping", n.overlapping);
  visit("missed", n.missed);
  visit("unsolved", n.unsolved);
  visit("failed", n.failed);
  visit("hash_high", static_cast<double>(frame.state_hash >> 32));
  visit("hash_low", static_cast<double>(frame.state_hash & 0xffffffff));
}

std::vector<const char*> NumberNames() {
  std::vector<const char*> names;
  VisitNumbers({}, [&](const char* name, double) { names.push_back(name); });
  return names;
}

Json ToJson(const Vector3& v) { return {v.x(), v.y(), v.z()}; }

Json ToJson(const Shape& shape) {
  Json json{{"kind", NameOf(shape.kind())}};
  switch (shape.kind()) {
    case ShapeKind::kSphere:
      json["radius"] = shape.radius();
      break;
    case ShapeKind::kCapsule:
    case ShapeKind::kCylinder:
      json["radius"] = shape.girth();
      json["half_length"] = shape.half_length();
      break;
    case ShapeKind::kConvexHull:
      json["vertices"] = Json::array();
      for (const Vector3& vertex : shape.polytope().vertices) json["vertices"].push_back(ToJson(vertex));
      json["faces"] = shape.polytope().faces;
      break;
    case ShapeKind::kBox:
    case ShapeKind::kCustom:
      json["half_extents"] = ToJson(shape.half_extents());
      break;
    case ShapeKind::kHalfSpace:
      break;
  }
  return json;
}

}  // namespace

void CheckPageHead(const FilmHead& head) {
  for (size_t i = 0; i < head.bodies.size(); ++i) {
    const FilmBody& body = head.bodies[i];
    if (body.shape < 0 || body.shape >= static_cast<int>(head.shapes.size()))
      throw std::invalid_argument("body " + std::to_string(i) + " has shape " + std::to_string(body.shape) +
                                  ", which is not there");
    if (!std::isfinite(body.mass))
      throw std::invalid_argument("the mass of body " + std::to_string(i) + " is not finite");
  }
}

void AppendNumbers(const FilmFrame& frame, std::vector<double>* numbers) {
  VisitNumbers(frame, [&](const char*, double value) { numbers->push_back(value); });
}

std::string NumberBytes(const std::vector<double>& numbers) {
  std::string bytes;
  bytes.reserve(8 * numbers.size());
  const size_t names = NumberNames().size();
  for (size_t name = 0; name < names; ++name) {
    for (size_t at = name; at < numbers.size(); at += names) {
      std::uint64_t bits;
      std::memcpy(&bits, &numbers[at], 8);
      for (int shift = 0; shift < 64; shift += 8) bytes.push_back(static_cast<char>(bits >> shift & 255));
    }
  }
  return bytes;
}

std::string PageHeadJson(const FilmHead& head, const PageChunk& sum, const std::vector<int>& chunk_sizes,
                         double position_step, const std::string& stopped_by, const std::string& start) {
  Json json{{"scene", head.scene},
            {"title", head.title},
            {"about", head.about},
            {"command", head.command},
            {"dt", head.dt},
            {"tolerance", head.tolerance},
            {"gravity", ToJson(head.gravity_W)},
            {"stopped_by", stopped_by},
            {"start", start},
            {"bounds", nullptr}};
  if (head.bounds) json["bounds"] = {{"lower", ToJson(head.bounds->lower)}, {"upper", ToJson(head.bounds->upper)}};
  json["shapes"] = Json::array();
  for (const Shape& shape : head.shapes) json["shapes"].push_back(ToJson(shape));
  Json shapes = Json::array(), kinds = Json::array(), masses = Json::array();
  for (const FilmBody& body : head.bodies) {
    shapes.push_back(body.shape);
    kinds.push_back(NameIn(kBodyKinds, body.kind));
    masses.push_back(body.mass);
  }
  json["bodies"] = {{"shape", shapes}, {"kind", kinds}, {"mass", masses}};
  json["frames"] = sum.frames;
  json["chunks"] = chunk_sizes;
  json["numbers"] = NumberNames();
  json["steps"] = {{"position", position_step}, {"rotation", kRotationStep}};
  json["errors"] = {{"position", sum.position_error}, {"rotation", sum.rotation_error}};
  json["contacts"] = {{"all", sum.contacts_all}, {"kept", sum.contacts_kept}, {"frames_cut", sum.frames_cut}};

  // Names may hold bytes that are no UTF-8, and what would end the <script>.
  std::string text;
  for (const char c : json.dump(-1, ' ', false, Json::error_handler_t::replace)) {
    if (c == '<')
      text += "\\u003c";
    else
      text += c;
  }
  return text;
}

}  // namespace islet
