#include "scenes/viewer/page_head.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <nlohmann/json.hpp>
#include <stdexcept>

#include "scenes/setting_names.h"

namespace islet {
namespace {

using Json = nlohmann::ordered_json;

constexpr std::array kNumberNames{"number",
                                  "time",
                                  "accuracy",
                                  "contacts",
                                  "islands",
                                  "awake",
                                  "frozen",
                                  "step_seconds",
                                  "detect",
                                  "cut_islands",
                                  "pq",
                                  "collision_qp",
                                  "static_qp",
                                  "freeze",
                                  "move",
                                  "kinetic",
                                  "potential",
                                  "coulomb_map",
                                  "penetration",
                                  "energy_created",
                                  "momentum_unexplained",
                                  "angular_momentum_unexplained",
                                  "sides_changed",
                                  "overlapping",
                                  "missed",
                                  "unsolved",
                                  "failed",
                                  "hash_high",
                                  "hash_low"};

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
  const FilmNumbers& n = frame.numbers;
  const StageSeconds& s = n.stages;
  const float accuracy = frame.accuracy.empty() ? 0 : *std::max_element(frame.accuracy.begin(), frame.accuracy.end());
  const std::array<double, kNumberNames.size()> all{double(frame.number),
                                                    frame.time,
                                                    double{accuracy},
                                                    double(n.contacts),
                                                    double(n.islands),
                                                    double(n.awake),
                                                    double(n.frozen),
                                                    n.step_seconds,
                                                    s.detect,
                                                    s.islands,
                                                    s.pq,
                                                    s.collision_qp,
                                                    s.static_qp,
                                                    s.freeze,
                                                    s.move,
                                                    n.kinetic,
                                                    n.potential,
                                                    n.coulomb_map,
                                                    n.penetration,
                                                    n.energy_created,
                                                    n.momentum_unexplained,
                                                    n.angular_momentum_unexplained,
                                                    double(n.sides_changed),
                                                    double(n.overlapping),
                                                    double(n.missed),
                                                    double(n.unsolved),
                                                    double(n.failed),
                                                    double(frame.state_hash >> 32),
                                                    double(frame.state_hash & 0xffffffff)};
  numbers->insert(numbers->end(), all.begin(), all.end());
}

std::string NumberBytes(const std::vector<double>& numbers) {
  std::string bytes;
  bytes.reserve(8 * numbers.size());
  for (size_t name = 0; name < kNumberNames.size(); ++name) {
    for (size_t at = name; at < numbers.size(); at += kNumberNames.size()) {
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
  json["numbers"] = kNumberNames;
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
