#include "scenes/film/film_head.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <utility>

#include "engine/shape_data.h"
#include "scenes/setting_names.h"

namespace islet {
namespace {

using Json = nlohmann::ordered_json;

// A value takes up to a hundred bytes of memory once read, so that this many are 50 MB.
constexpr size_t kMostValues = 500'000;
constexpr int kMostDepth = 8, kMostKeys = 100;
constexpr size_t kMostShapes = 20'000;
constexpr size_t kMostFaces = 4096, kMostHullVertices = 100'000;  // as the engine's hulls

constexpr std::array<std::pair<const char*, ShapeKind>, 6> kShapeKinds{{{"sphere", ShapeKind::kSphere},
                                                                        {"box", ShapeKind::kBox},
                                                                        {"half_space", ShapeKind::kHalfSpace},
                                                                        {"hull", ShapeKind::kConvexHull},
                                                                        {"capsule", ShapeKind::kCapsule},
                                                                        {"cylinder", ShapeKind::kCylinder}}};

[[noreturn]] void Refuse(const std::string& key, const std::string& rule, const Json& value) {
  std::string text = value.dump(-1, ' ', false, Json::error_handler_t::replace);
  if (text.size() > 60) text = text.substr(0, 60) + "...";
  throw std::invalid_argument(key + " " + rule + ", got " + text);
}

template <typename T, size_t n>
const char* NameOf(T value, const std::array<std::pair<const char*, T>, n>& names) {
  if (const char* const name = NameIn(names, value)) return name;
  throw std::invalid_argument("a custom shape is a function, which a recording cannot hold");
}

const Json& At(const Json& object, const std::string& key) {
  if (!object.is_object()) Refuse("what holds " + key, "must be an object", object);
  const auto found = object.find(key);
  if (found == object.end()) throw std::invalid_argument(key + " is missing");
  return *found;
}

const Json& List(const Json& value, const std::string& key, size_t most) {
  if (!value.is_array() || value.size() > most) Refuse(key, "must be a list of at most " + std::to_string(most), value);
  return value;
}

double Number(const Json& value, const std::string& key) {
  if (!value.is_number() || !std::isfinite(value.get<double>())) Refuse(key, "must be a finite number", value);
  return value.get<double>();
}

std::int64_t Whole(const Json& value, const std::string& key, std::int64_t least, std::int64_t most) {
  const bool right = value.is_number_integer() &&
                     !(value.is_number_unsigned() && value.get<std::uint64_t>() > static_cast<std::uint64_t>(most)) &&
                     value.get<std::int64_t>() >= least && value.get<std::int64_t>() <= most;
  if (!right)
    Refuse(key, "must be a whole number from " + std::to_string(least) + " to " + std::to_string(most), value);
  return value.get<std::int64_t>();
}

std::string Text(const Json& value, const std::string& key) {
  if (!value.is_string()) Refuse(key, "must be a text", value);
  return value.get<std::string>();
}

template <typename T, size_t n>
T Choice(const Json& value, const std::string& key, const std::array<std::pair<const char*, T>, n>& names) {
  if (const std::optional<T> kind = ValueIn(names, Text(value, key))) return *kind;
  Refuse(key, "is of no known kind", value);
}

template <typename Matrix>
Json NumbersOf(const Matrix& m) {
  Json list = Json::array();
  for (int i = 0; i < m.size(); ++i) list.push_back(m.data()[i]);
  return list;
}

template <typename Matrix>
Matrix Numbers(const Json& value, const std::string& key) {
  Matrix m;
  if (!value.is_array() || value.size() != static_cast<size_t>(m.size()))
    Refuse(key, "must be " + std::to_string(m.size()) + " numbers", value);
  for (int i = 0; i < m.size(); ++i) m.data()[i] = Number(value[i], key);
  return m;
}

std::vector<Vector3> Vectors(const Json& value, const std::string& key, size_t most) {
  std::vector<Vector3> vectors;
  for (const Json& entry : List(value, key, most)) vectors.push_back(Numbers<Vector3>(entry, key));
  return vectors;
}

// In the order in which the engine makes them.
void AddEdges(Polytope* polytope) {
  std::map<std::pair<int, int>, int> left;  // directed edge -> face
  for (size_t f = 0; f < polytope->faces.size(); ++f) {
    const std::vector<int>& face = polytope->faces[f];
    for (size_t k = 0; k < face.size(); ++k)
      if (!left.emplace(std::pair(face[k], face[(k + 1) % face.size()]), static_cast<int>(f)).second)
        throw std::invalid_argument("faces: two of them have an edge in the same direction");
  }
  for (const auto& [edge, face] : left) {
    const auto back = left.find({edge.second, edge.first});
    if (back == left.end()) throw std::invalid_argument("faces: they do not close");
    if (edge.first > edge.second) continue;
    polytope->edges.push_back({edge.first, edge.second});
    polytope->edge_faces.push_back({std::min(face, back->second), std::max(face, back->second)});
  }
}

Json HullToJson(const Shape& shape) {
  const Polytope& p = shape.polytope();
  Json json{{"vertices", Json::array()}, {"faces", p.faces}, {"normals", Json::array()}};
  for (const Vector3& v : p.vertices) json["vertices"].push_back(NumbersOf(v));
  for (const Vector3& n : p.face_normals) json["normals"].push_back(NumbersOf(n));
  const Shape::Data& data = shape.data();
  json["offset"] = NumbersOf(data.hull_offset);
  json["size"] = data.size;
  json["volume"] = data.volume;
  json["inertia_per_mass"] = NumbersOf(data.inertia_per_mass);
  return json;
}

// The polytope is taken as it is: a hull made anew would differ in its last bits, and may cost its maker minutes.
Shape HullFromJson(const Json& json) {
  auto data = std::make_shared<Shape::Data>();
  data->kind = ShapeKind::kConvexHull;
  Polytope& p = data->polytope;
  p.vertices = Vectors(At(json, "vertices"), "vertices", kMostHullVertices);
  p.face_normals = Vectors(At(json, "normals"), "normals", kMostFaces);
  for (const Json& face : List(At(json, "faces"), "faces", kMostFaces)) {
    if (List(face, "faces", kMostHullVertices).size() < 3) Refuse("faces", "must have three corners or more", face);
    p.faces.emplace_back();
    for (const Json& v : face)
      p.faces.back().push_back(
          static_cast<int>(Whole(v, "faces", 0, static_cast<std::int64_t>(p.vertices.size()) - 1)));
  }
  if (p.faces.size() < 4 || p.faces.size() != p.face_normals.size())
    throw std::invalid_argument("normals: " + std::to_string(p.face_normals.size()) + " for " +
                                std::to_string(p.faces.size()) + " faces of a hull");
  AddEdges(&p);
  Vector3 lower = p.vertices[0], upper = lower;
  for (const Vector3& v : p.vertices) {
    lower = lower.cwiseMin(v), upper = upper.cwiseMax(v);
    data->radius = std::max(data->radius, v.norm());
  }
  data->half_extents = (upper - lower) / 2;
  data->hull_offset = Numbers<Vector3>(At(json, "offset"), "offset");
  data->size = Number(At(json, "size"), "size");
  data->volume = Number(At(json, "volume"), "volume");
  if (!(data->size > 0)) throw std::invalid_argument("size = " + std::to_string(data->size) + " of a hull");
  data->inertia_per_mass = Numbers<Matrix3>(At(json, "inertia_per_mass"), "inertia_per_mass");
  return Shape(std::move(data));
}

Json ShapeToJson(const Shape& shape) {
  Json json{{"kind", NameOf(shape.kind(), kShapeKinds)}};
  if (shape.kind() == ShapeKind::kBox) json["half_extents"] = NumbersOf(shape.half_extents());
  if (shape.kind() == ShapeKind::kSphere || shape.HasAxis()) json["radius"] = shape.girth();
  if (shape.HasAxis()) json["half_length"] = shape.half_length();
  if (shape.kind() == ShapeKind::kConvexHull) json.update(HullToJson(shape));
  return json;
}

Shape MakeShape(const Json& json) {
  switch (Choice(At(json, "kind"), "kind", kShapeKinds)) {
    case ShapeKind::kSphere:
      return Shape::Sphere(Number(At(json, "radius"), "radius"));
    case ShapeKind::kBox:
      return Shape::Box(Numbers<Vector3>(At(json, "half_extents"), "half_extents"));
    case ShapeKind::kCapsule:
      return Shape::Capsule(Number(At(json, "radius"), "radius"), Number(At(json, "half_length"), "half_length"));
    case ShapeKind::kCylinder:
      return Shape::Cylinder(Number(At(json, "radius"), "radius"), Number(At(json, "half_length"), "half_length"));
    case ShapeKind::kConvexHull:
      return HullFromJson(json);
    default:
      return Shape::HalfSpace();
  }
}

// What is drawn is in single precision, so that no shape may be beyond it.
Shape ShapeFromJson(const Json& json) {
  Shape shape = MakeShape(json);
  if (shape.kind() != ShapeKind::kHalfSpace && !(shape.radius() <= 1e30))
    Refuse("radius", "must be below 1e30 m", json);
  return shape;
}

Json BodiesToJson(const std::vector<FilmBody>& bodies) {
  Json list = Json::array();
  const auto alike = [](const FilmBody& a, const FilmBody& b) {
    return a.shape == b.shape && a.kind == b.kind && a.mass == b.mass;
  };
  for (size_t i = 0, end; i < bodies.size(); i = end) {
    for (end = i + 1; end < bodies.size() && alike(bodies[i], bodies[end]);) ++end;
    list.push_back({end - i, bodies[i].shape, NameOf(bodies[i].kind, kBodyKinds), bodies[i].mass});
  }
  return list;
}

std::vector<FilmBody> BodiesFromJson(const Json& list, size_t shapes) {
  std::vector<FilmBody> bodies;
  for (const Json& row : List(list, "bodies", kMostFilmBodies)) {
    if (!row.is_array() || row.size() != 4) Refuse("bodies", "must be rows of count, shape, kind and mass", row);
    const std::int64_t room = static_cast<std::int64_t>(kMostFilmBodies - bodies.size());
    const std::int64_t count = Whole(row[0], "bodies: their count, 131072 in all,", 1, room);
    FilmBody body;
    body.shape = static_cast<int>(Whole(row[1], "bodies: their shape", 0, static_cast<std::int64_t>(shapes) - 1));
    body.kind = Choice(row[2], "bodies: their kind", kBodyKinds);
    body.mass = Number(row[3], "bodies: their mass");
    if (body.mass < 0) Refuse("bodies: their mass", "must not be negative", row[3]);
    bodies.insert(bodies.end(), static_cast<size_t>(count), body);
  }
  return bodies;
}

// Values, depth, and keys of an object (each is compared with all others), counted before anything is made of them.
void CheckSize(std::string_view text) {
  size_t values = 1;
  int depth = 0;
  std::array<int, kMostDepth + 1> commas{};  // by depth
  std::array<bool, kMostDepth + 1> object{};
  bool quoted = false;
  for (size_t i = 0; i < text.size(); ++i) {
    const char c = text[i];
    if (c == '\\') ++i;  // only in a quoted text; elsewhere the parser refuses it
    if (c == '"') quoted = !quoted;
    if (quoted) continue;
    const bool opens = c == '[' || c == '{', closes = c == ']' || c == '}';
    values += opens || c == ',';
    if (opens && ++depth <= kMostDepth) commas[depth] = 0, object[depth] = c == '{';
    if (closes && --depth < 0) return;  // the parser refuses it
    if (depth > kMostDepth || values > kMostValues)
      throw std::invalid_argument("more than " + std::to_string(kMostValues) + " values, or nested more than " +
                                  std::to_string(kMostDepth) + " deep");
    if (c == ',' && ++commas[depth] > kMostKeys && object[depth])
      throw std::invalid_argument("more than " + std::to_string(kMostKeys) + " keys of one object");
  }
}

}  // namespace

std::string HeadToJson(const FilmHead& head) {
  if (head.bodies.size() > kMostFilmBodies)
    throw std::invalid_argument("a recording holds at most " + std::to_string(kMostFilmBodies) + " bodies, got " +
                                std::to_string(head.bodies.size()));
  Json json{{"program", "islet"},
            {"version", head.version},
            {"scene", head.scene},
            {"command", head.command},
            {"arguments", head.arguments}};
  if (!head.title.empty()) json["title"] = head.title;
  if (!head.about.empty()) json["about"] = head.about;
  if (!head.scene_text.empty()) json["scene_text"] = head.scene_text;
  json["dt"] = head.dt;
  json["tolerance"] = head.tolerance;
  json["gravity"] = NumbersOf(head.gravity_W);
  if (head.bounds) json["bounds"] = {NumbersOf(head.bounds->lower), NumbersOf(head.bounds->upper)};
  json["shapes"] = Json::array();
  for (const Shape& shape : head.shapes) json["shapes"].push_back(ShapeToJson(shape));
  json["bodies"] = BodiesToJson(head.bodies);
  try {
    return json.dump();
  } catch (const Json::exception&) {
    throw std::invalid_argument("a recording holds texts in UTF-8 alone, got another in its scene or command");
  }
}

FilmHead HeadFromJson(std::string_view text) {
  CheckSize(text);
  Json json;
  try {
    json = Json::parse(text);
  } catch (const Json::exception& error) {
    throw std::invalid_argument(std::string("no JSON: ") + error.what());
  }
  FilmHead head;
  head.version = Text(At(json, "version"), "version");
  head.scene = Text(At(json, "scene"), "scene");
  head.command = Text(At(json, "command"), "command");
  for (const Json& argument : List(At(json, "arguments"), "arguments", 1000))
    head.arguments.push_back(Text(argument, "arguments"));
  if (json.contains("title")) head.title = Text(json["title"], "title");
  if (json.contains("about")) head.about = Text(json["about"], "about");
  if (json.contains("scene_text")) head.scene_text = Text(json["scene_text"], "scene_text");
  head.dt = Number(At(json, "dt"), "dt");
  if (!(head.dt > 0)) Refuse("dt", "must be positive", json["dt"]);
  head.tolerance = Number(At(json, "tolerance"), "tolerance");
  head.gravity_W = Numbers<Vector3>(At(json, "gravity"), "gravity");
  if (json.contains("bounds")) {
    const std::vector<Vector3> corners = Vectors(json["bounds"], "bounds", 2);
    if (corners.size() != 2 || (corners[0].array() > corners[1].array()).any())
      Refuse("bounds", "must be a lower and an upper corner", json["bounds"]);
    head.bounds = Region{corners[0], corners[1]};
  }
  for (const Json& shape : List(At(json, "shapes"), "shapes", kMostShapes)) head.shapes.push_back(ShapeFromJson(shape));
  head.bodies = BodiesFromJson(At(json, "bodies"), head.shapes.size());
  return head;
}

}  // namespace islet
