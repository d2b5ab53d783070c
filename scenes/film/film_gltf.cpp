#include "scenes/film/film_gltf.h"

#include <tiny_gltf.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <limits>
#include <map>
#include <numbers>
#include <sstream>
#include <stdexcept>
#include <type_traits>
#include <utility>
#include <vector>

namespace islet {
namespace {

constexpr std::uint64_t kMostBytes = 1'000'000'000;
constexpr double kLeastReach = 10;  // [m] of a half-space

std::array<float, 3> ToGltf(double x, double y, double z) {
  return {static_cast<float>(x), static_cast<float>(z), static_cast<float>(-y)};
}
std::array<float, 3> ToGltf(const Vector3& v) { return ToGltf(v.x(), v.y(), v.z()); }

struct Mesh {  // triangles, counter-clockwise seen from outside
  std::vector<std::array<float, 3>> points, normals;
  std::vector<std::uint32_t> corners;

  void Add(const Vector3& point, const Vector3& normal) {
    points.push_back(ToGltf(point));
    normals.push_back(ToGltf(normal));
  }
};

Vector3 UnitOr(const Vector3& v, const Vector3& other) {
  const double norm = v.stableNorm();
  return norm > 0 ? Vector3(v / norm) : other;
}

Mesh PolytopeMesh(const Polytope& polytope) {
  Mesh mesh;
  for (size_t f = 0; f < polytope.faces.size(); ++f) {
    const Vector3 normal = UnitOr(polytope.face_normals[f], Vector3::UnitZ());
    const auto first = static_cast<std::uint32_t>(mesh.points.size());
    const auto corners = static_cast<std::uint32_t>(polytope.faces[f].size());
    for (const int v : polytope.faces[f]) mesh.Add(polytope.vertices[v], normal);
    for (std::uint32_t k = 1; k + 1 < corners; ++k)
      mesh.corners.insert(mesh.corners.end(), {first, first + k, first + k + 1});
  }
  return mesh;
}

struct Ring {  // about the z axis
  double radius, height;
  double out, up;  // of the normal
};

// Between each two rings that follow one another, but for those that lie in one place: an edge.
Mesh RoundMesh(const std::vector<Ring>& rings) {
  constexpr std::uint32_t kSides = 32;
  Mesh mesh;
  for (const Ring& ring : rings) {
    for (std::uint32_t side = 0; side <= kSides; ++side) {
      const double angle = 2 * std::numbers::pi * (side % kSides) / kSides;
      const double c = std::cos(angle), s = std::sin(angle);
      mesh.Add({ring.radius * c, ring.radius * s, ring.height}, {ring.out * c, ring.out * s, ring.up});
    }
  }
  for (std::uint32_t r = 0; r + 1 < rings.size(); ++r) {
    const Ring &low = rings[r], &high = rings[r + 1];
    if (low.radius == high.radius && low.height == high.height) continue;
    for (std::uint32_t side = 0; side < kSides; ++side) {
      const std::uint32_t a = r * (kSides + 1) + side, b = a + 1, c = a + kSides + 1, d = c + 1;
      if (low.radius > 0) mesh.corners.insert(mesh.corners.end(), {a, b, d});
      if (high.radius > 0) mesh.corners.insert(mesh.corners.end(), {a, d, c});
    }
  }
  return mesh;
}

std::vector<Ring> RingsOf(const Shape& shape) {
  constexpr int kBands = 8;  // of half a ball
  const double r = shape.girth(), h = shape.half_length();
  if (shape.kind() == ShapeKind::kCylinder)
    return {{0, -h, 0, -1}, {r, -h, 0, -1}, {r, -h, 1, 0}, {r, h, 1, 0}, {r, h, 0, 1}, {0, h, 0, 1}};
  std::vector<Ring> rings;
  for (int k = -kBands; k <= kBands; ++k) {
    const double angle = 0.5 * std::numbers::pi * k / kBands;
    const double c = std::abs(k) == kBands ? 0 : std::cos(angle), s = std::sin(angle);
    if (k == 0 && h > 0) rings.push_back({r, -h, 1, 0});
    rings.push_back({r * c, r * s + (k < 0 ? -h : h), c, s});
  }
  return rings;
}

Mesh MeshOf(const Shape& shape, double reach) {
  if (shape.kind() == ShapeKind::kBox || shape.kind() == ShapeKind::kConvexHull) return PolytopeMesh(shape.polytope());
  if (shape.kind() != ShapeKind::kHalfSpace) return RoundMesh(RingsOf(shape));
  Mesh mesh;
  for (const auto& [x, y] : {std::pair(-1, -1), std::pair(1, -1), std::pair(1, 1), std::pair(-1, 1)})
    mesh.Add({x * reach, y * reach, 0}, Vector3::UnitZ());
  mesh.corners = {0, 1, 2, 0, 2, 3};
  return mesh;
}

std::array<float, 4> ToRotation(const std::array<float, 7>& pose) {
  const Eigen::Vector4d q = Eigen::Vector4d(pose[3], pose[5], -pose[4], pose[6]).stableNormalized();
  return {static_cast<float>(q[0]), static_cast<float>(q[1]), static_cast<float>(q[2]), static_cast<float>(q[3])};
}

struct Keys {  // of one body
  std::vector<std::array<float, 3>> translations;
  std::vector<std::array<float, 4>> rotations;

  void Add(const std::array<float, 7>& pose) {
    translations.push_back(ToGltf(pose[0], pose[1], pose[2]));
    std::array<float, 4> q = ToRotation(pose);
    // q and -q are one rotation. Who draws between two keys shall take the short way.
    if (!rotations.empty()) {
      const std::array<float, 4>& before = rotations.back();
      if (q[0] * before[0] + q[1] * before[1] + q[2] * before[2] + q[3] * before[3] < 0)
        for (float& part : q) part = -part;
    }
    rotations.push_back(q);
  }
};

struct Motion {
  std::vector<float> times;    // [s]
  std::vector<Keys> keys;      // per body; one key for those that do not move
  double reach = kLeastReach;  // [m]
};

[[noreturn]] void TooLarge() {
  throw std::invalid_argument("the glTF file would have more than 1 GB: too many frames, bodies or shapes");
}

Motion ReadMotion(FilmReader* reader) {
  const std::vector<FilmBody>& bodies = reader->head().bodies;
  Motion motion;
  motion.keys.resize(bodies.size());
  std::uint64_t bytes = 0;
  for (FilmFrame frame; reader->Next(&frame);) {
    const auto time = static_cast<float>(frame.time);
    if (!std::isfinite(time) || (!motion.times.empty() && !(time > motion.times.back())))
      throw std::invalid_argument("the time of frame " + std::to_string(frame.number) +
                                  " is no other than that before in single precision, which glTF has");
    const bool first = motion.times.empty();
    motion.times.push_back(time);
    for (size_t i = 0; i < bodies.size(); ++i) {
      if (!first && bodies[i].kind == BodyKind::kFixed) continue;
      motion.keys[i].Add(frame.poses[i]);
      bytes += 7 * sizeof(float);
      for (int k = 0; k < 3; ++k) motion.reach = std::max(motion.reach, 2 * std::abs(double{frame.poses[i][k]}));
    }
    if (bytes > kMostBytes) TooLarge();
  }
  if (motion.times.empty()) throw std::invalid_argument("the recording holds no frame, so there is nothing to show");
  motion.reach = std::min(motion.reach, 1e30);
  return motion;
}

// What the numbers of an accessor are for, and so the view that they are in.
enum View { kVertices, kCorners, kKeys };

// Numbers and what refers to them.
class Numbers {
 public:
  explicit Numbers(tinygltf::Model* model) : model_(model) {}

  // bounds: whether the accessor tells its least and largest.
  template <typename T, size_t n>
  int Add(const std::vector<std::array<T, n>>& values, View view, bool bounds) {
    std::vector<unsigned char>& bytes = bytes_[view];
    tinygltf::Accessor accessor;
    accessor.byteOffset = bytes.size();
    accessor.bufferView = view;
    accessor.componentType =
        std::is_same_v<T, float> ? TINYGLTF_COMPONENT_TYPE_FLOAT : TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT;
    accessor.count = values.size();
    accessor.type = n == 1 ? TINYGLTF_TYPE_SCALAR : n == 3 ? TINYGLTF_TYPE_VEC3 : TINYGLTF_TYPE_VEC4;
    for (size_t k = 0; bounds && k < n; ++k) {
      const auto less = [k](const auto& a, const auto& b) { return a[k] < b[k]; };
      accessor.minValues.push_back((*std::min_element(values.begin(), values.end(), less))[k]);
      accessor.maxValues.push_back((*std::max_element(values.begin(), values.end(), less))[k]);
    }
    const auto* begin = reinterpret_cast<const unsigned char*>(values.data());
    bytes.insert(bytes.end(), begin, begin + values.size() * sizeof values[0]);
    total_ += values.size() * sizeof values[0];
    if (total_ > kMostBytes) TooLarge();
    model_->accessors.push_back(std::move(accessor));
    return static_cast<int>(model_->accessors.size()) - 1;
  }

  void Finish() {
    constexpr std::array<int, 3> kTargets{TINYGLTF_TARGET_ARRAY_BUFFER, TINYGLTF_TARGET_ELEMENT_ARRAY_BUFFER, 0};
    tinygltf::Buffer buffer;
    for (const View v : {kVertices, kCorners, kKeys}) {
      if (bytes_[v].empty()) break;  // no keys, where nothing moves
      tinygltf::BufferView view;
      view.buffer = 0;
      view.byteOffset = buffer.data.size();
      view.byteLength = bytes_[v].size();
      view.target = kTargets[v];
      if (v == kVertices) view.byteStride = 3 * sizeof(float);
      buffer.data.insert(buffer.data.end(), bytes_[v].begin(), bytes_[v].end());
      bytes_[v] = {};
      model_->bufferViews.push_back(std::move(view));
    }
    model_->buffers.push_back(std::move(buffer));
  }

 private:
  tinygltf::Model* model_;
  std::uint64_t total_ = 0;  // [bytes]
  std::array<std::vector<unsigned char>, 3> bytes_;
};

template <typename T>
std::vector<std::array<T, 1>> Single(const std::vector<T>& values) {
  std::vector<std::array<T, 1>> list;
  for (const T value : values) list.push_back({value});
  return list;
}

// What moves is seen behind walls.
tinygltf::Material MaterialOf(bool moves) {
  tinygltf::Material material;
  material.name = moves ? "moves" : "stands";
  material.pbrMetallicRoughness.metallicFactor = 0;
  material.pbrMetallicRoughness.roughnessFactor = 0.7;
  if (moves) {
    material.pbrMetallicRoughness.baseColorFactor = {0.85, 0.42, 0.2, 1};
  } else {
    material.pbrMetallicRoughness.baseColorFactor = {0.6, 0.65, 0.7, 0.3};
    material.alphaMode = "BLEND";
    material.doubleSided = true;
  }
  return material;
}

}  // namespace

std::string FilmToGlb(FilmReader* reader) {
  const FilmHead& head = reader->head();
  const Motion motion = ReadMotion(reader);
  tinygltf::Model model;
  model.asset.version = "2.0";
  model.asset.generator = "islet " + head.version;
  model.materials = {MaterialOf(false), MaterialOf(true)};
  model.defaultScene = 0;
  tinygltf::Scene scene;
  scene.name = head.title.empty() ? head.scene : head.title;
  if (!head.command.empty())
    scene.extras = tinygltf::Value(tinygltf::Value::Object{{"command", tinygltf::Value(head.command)}});

  Numbers numbers(&model);
  std::map<int, std::array<int, 3>> accessors;  // by shape: points, normals, corners
  std::map<std::pair<int, bool>, int> meshes;   // by shape and whether it moves
  tinygltf::Animation animation;
  animation.name = scene.name;
  int times = -1;
  for (size_t i = 0; i < head.bodies.size(); ++i) {
    const FilmBody& body = head.bodies[i];
    const Shape& shape = head.shapes[body.shape];
    const bool moves = body.kind != BodyKind::kFixed;
    const Keys& keys = motion.keys[i];
    if (!accessors.contains(body.shape)) {
      const Mesh mesh = MeshOf(shape, motion.reach);
      accessors[body.shape] = {numbers.Add(mesh.points, kVertices, true), numbers.Add(mesh.normals, kVertices, false),
                               numbers.Add(Single(mesh.corners), kCorners, false)};
    }
    const auto [mesh, added] = meshes.try_emplace({body.shape, moves}, static_cast<int>(model.meshes.size()));
    if (added) {
      const auto& [points, normals, corners] = accessors[body.shape];
      tinygltf::Primitive primitive;
      primitive.attributes = {{"POSITION", points}, {"NORMAL", normals}};
      primitive.indices = corners;
      primitive.material = moves ? 1 : 0;
      primitive.mode = TINYGLTF_MODE_TRIANGLES;
      tinygltf::Mesh made;
      made.name = NameOf(shape.kind()) + std::string(" ") + std::to_string(body.shape);
      made.primitives.push_back(std::move(primitive));
      model.meshes.push_back(std::move(made));
    }
    tinygltf::Node node;
    node.name = NameOf(shape.kind()) + std::string(" of body ") + std::to_string(i);
    node.mesh = mesh->second;
    node.translation.assign(keys.translations[0].begin(), keys.translations[0].end());
    node.rotation.assign(keys.rotations[0].begin(), keys.rotations[0].end());
    const int number = static_cast<int>(model.nodes.size());
    scene.nodes.push_back(number);
    model.nodes.push_back(std::move(node));
    if (!moves) continue;
    if (times < 0) times = numbers.Add(Single(motion.times), kKeys, true);
    const auto animate = [&](const char* path, int output) {
      tinygltf::AnimationSampler sampler;
      sampler.input = times;
      sampler.output = output;
      tinygltf::AnimationChannel channel;
      channel.sampler = static_cast<int>(animation.samplers.size());
      channel.target_node = number;
      channel.target_path = path;
      animation.samplers.push_back(std::move(sampler));
      animation.channels.push_back(std::move(channel));
    };
    animate("translation", numbers.Add(keys.translations, kKeys, false));
    animate("rotation", numbers.Add(keys.rotations, kKeys, false));
  }
  if (model.nodes.empty()) throw std::invalid_argument("the recording holds no body, so there is nothing to show");
  numbers.Finish();
  if (!animation.channels.empty()) model.animations.push_back(std::move(animation));
  model.scenes.push_back(std::move(scene));

  std::ostringstream stream;
  if (!tinygltf::TinyGLTF().WriteGltfSceneToStream(&model, stream, false, true) || !stream)
    throw std::runtime_error("the glTF file could not be made");
  return std::move(stream).str();
}

}  // namespace islet
