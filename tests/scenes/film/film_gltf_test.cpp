#include "scenes/film/film_gltf.h"

#include <gtest/gtest.h>
#include <tiny_gltf.h>

#include <cmath>
#include <cstring>
#include <set>
#include <stdexcept>
#include <type_traits>

#include "tests/support/films.h"

namespace islet {
namespace {

using testing::AllShapes;
using testing::Film;
using testing::Scratch;
using testing::Write;

std::string Convert(const Film& film) {
  const Scratch scratch;
  Write(film, scratch.path());
  FilmReader reader(scratch.path());
  return FilmToGlb(&reader);
}

tinygltf::Model Load(const std::string& bytes) {
  tinygltf::Model model;
  std::string error, warning;
  EXPECT_TRUE(tinygltf::TinyGLTF().LoadBinaryFromMemory(&model, &error, &warning,
                                                        reinterpret_cast<const unsigned char*>(bytes.data()),
                                                        static_cast<unsigned>(bytes.size())));
  EXPECT_EQ(error + warning, "");
  return model;
}

template <typename T>
std::vector<T> Values(const tinygltf::Model& model, int number) {
  const tinygltf::Accessor& accessor = model.accessors.at(number);
  const tinygltf::BufferView& view = model.bufferViews.at(accessor.bufferView);
  const size_t width = accessor.type == TINYGLTF_TYPE_SCALAR ? 1 : accessor.type == TINYGLTF_TYPE_VEC3 ? 3 : 4;
  EXPECT_EQ(accessor.componentType,
            (std::is_same_v<T, float> ? TINYGLTF_COMPONENT_TYPE_FLOAT : TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT));
  std::vector<T> values(accessor.count * width);
  EXPECT_LE(accessor.byteOffset + values.size() * sizeof(T), view.byteLength);
  std::memcpy(values.data(), model.buffers.at(0).data.data() + view.byteOffset + accessor.byteOffset,
              values.size() * sizeof(T));
  return values;
}

std::uint32_t Word(const std::string& bytes, size_t at) {
  std::uint32_t word;
  std::memcpy(&word, bytes.data() + at, 4);
  return word;
}

// What the specification of glTF 2.0 demands of the parts that are used.
void ExpectValid(const std::string& bytes, const tinygltf::Model& model) {
  EXPECT_EQ(bytes.substr(0, 4), "glTF");
  EXPECT_EQ(Word(bytes, 4), 2u);
  EXPECT_EQ(Word(bytes, 8), bytes.size());
  const std::uint32_t json = Word(bytes, 12);
  EXPECT_EQ(json % 4, 0u);
  EXPECT_EQ(Word(bytes, 20 + json) % 4, 0u);
  EXPECT_EQ(28 + json + Word(bytes, 20 + json), bytes.size());

  EXPECT_EQ(model.asset.version, "2.0");
  ASSERT_EQ(model.buffers.size(), 1u);
  for (const tinygltf::BufferView& view : model.bufferViews) {
    EXPECT_EQ(view.byteOffset % 4, 0u);
    EXPECT_GT(view.byteLength, 0u);
    EXPECT_LE(view.byteOffset + view.byteLength, model.buffers[0].data.size());
    EXPECT_EQ(view.byteStride, view.target == TINYGLTF_TARGET_ARRAY_BUFFER ? 12u : 0u);
  }
  std::set<int> points, times;
  for (const tinygltf::Mesh& mesh : model.meshes) {
    for (const tinygltf::Primitive& primitive : mesh.primitives) {
      points.insert(primitive.attributes.at("POSITION"));
      const std::vector<float> p = Values<float>(model, primitive.attributes.at("POSITION"));
      const std::vector<float> n = Values<float>(model, primitive.attributes.at("NORMAL"));
      ASSERT_EQ(p.size(), n.size());
      for (size_t i = 0; i < n.size(); i += 3) EXPECT_NEAR(std::hypot(n[i], n[i + 1], n[i + 2]), 1, 1e-6);
      const std::vector<std::uint32_t> corners = Values<std::uint32_t>(model, primitive.indices);
      ASSERT_EQ(corners.size() % 3, 0u);
      for (size_t i = 0; i < corners.size(); i += 3) {
        Eigen::Vector3f corner[3], normal[3];
        for (int k = 0; k < 3; ++k) {
          ASSERT_LT(corners[i + k], p.size() / 3);
          corner[k] = Eigen::Map<const Eigen::Vector3f>(&p[3 * corners[i + k]]);
          normal[k] = Eigen::Map<const Eigen::Vector3f>(&n[3 * corners[i + k]]);
        }
        // Each triangle looks outwards, as its normals tell.
        const Eigen::Vector3f area = (corner[1] - corner[0]).cross(corner[2] - corner[0]);
        EXPECT_GT(area.norm(), 0);
        for (int k = 0; k < 3; ++k) EXPECT_GT(area.normalized().dot(normal[k]), 0.9f) << mesh.name;
        EXPECT_TRUE(area.dot(corner[0]) > 0 || mesh.name.starts_with("half-space")) << mesh.name;
      }
    }
  }
  for (const tinygltf::Animation& animation : model.animations) {
    std::set<std::pair<int, std::string>> targets;
    for (const tinygltf::AnimationChannel& channel : animation.channels) {
      EXPECT_TRUE(targets.emplace(channel.target_node, channel.target_path).second);
      const tinygltf::AnimationSampler& sampler = animation.samplers.at(channel.sampler);
      times.insert(sampler.input);
      EXPECT_EQ(model.accessors.at(sampler.input).count, model.accessors.at(sampler.output).count);
      const std::vector<float> input = Values<float>(model, sampler.input);
      EXPECT_GE(input[0], 0);
      for (size_t i = 1; i < input.size(); ++i) EXPECT_GT(input[i], input[i - 1]);
    }
  }
  for (size_t a = 0; a < model.accessors.size(); ++a) {
    const tinygltf::Accessor& accessor = model.accessors[a];
    EXPECT_EQ(accessor.byteOffset % 4, 0u);
    EXPECT_GT(accessor.count, 0u);
    const bool bounded = points.contains(static_cast<int>(a)) || times.contains(static_cast<int>(a));
    if (!bounded) continue;
    const std::vector<float> values = Values<float>(model, static_cast<int>(a));
    const size_t width = accessor.minValues.size();
    ASSERT_EQ(width, points.contains(static_cast<int>(a)) ? 3u : 1u);
    for (size_t k = 0; k < width; ++k) {
      float least = values[k], most = values[k];
      for (size_t i = k; i < values.size(); i += width)
        least = std::min(least, values[i]), most = std::max(most, values[i]);
      EXPECT_EQ(accessor.minValues[k], least);
      EXPECT_EQ(accessor.maxValues[k], most);
    }
  }
}

// z up, from y up.
Vector3 Back(const float* p) { return {p[0], -p[2], p[1]}; }

void ExpectPose(const float* translation, const float* rotation, const std::array<float, 7>& pose) {
  EXPECT_EQ(Back(translation), Vector3(pose[0], pose[1], pose[2]));
  const Quaternion read(rotation[3], rotation[0], -rotation[2], rotation[1]);
  EXPECT_NEAR(read.norm(), 1, 1e-6);
  EXPECT_LT(read.angularDistance(Quaternion(pose[6], pose[3], pose[4], pose[5])), 2e-6);
}

TEST(FilmGltf, ShowsEveryBodyWhereItWasInEveryFrame) {
  const Film film = AllShapes(50);
  const std::string bytes = Convert(film);
  const tinygltf::Model model = Load(bytes);
  ExpectValid(bytes, model);
  const size_t bodies = film.head.bodies.size();
  ASSERT_EQ(model.nodes.size(), bodies);
  ASSERT_EQ(model.scenes.at(model.defaultScene).nodes.size(), bodies);
  EXPECT_EQ(model.meshes.size(), film.head.shapes.size() + 1);  // the box stands and moves
  EXPECT_EQ(model.nodes[2].mesh, model.nodes[3].mesh);          // two that move with one shape
  EXPECT_NE(model.nodes[1].mesh, model.nodes[2].mesh);
  const auto points = [&](int node) {
    return model.meshes[model.nodes[node].mesh].primitives[0].attributes.at("POSITION");
  };
  EXPECT_EQ(points(1), points(2));

  for (size_t i = 0; i < bodies; ++i) {
    const std::vector<double>&t = model.nodes[i].translation, &r = model.nodes[i].rotation;
    const std::array<float, 3> translation{static_cast<float>(t.at(0)), static_cast<float>(t.at(1)),
                                           static_cast<float>(t.at(2))};
    const std::array<float, 4> rotation{static_cast<float>(r.at(0)), static_cast<float>(r.at(1)),
                                        static_cast<float>(r.at(2)), static_cast<float>(r.at(3))};
    ExpectPose(translation.data(), rotation.data(), film.frames[0].poses[i]);
  }
  ASSERT_EQ(model.animations.size(), 1u);
  std::set<int> moved;
  for (const tinygltf::AnimationChannel& channel : model.animations[0].channels) {
    moved.insert(channel.target_node);
    if (channel.target_path != "translation") continue;
    const auto& samplers = model.animations[0].samplers;
    const std::vector<float> times = Values<float>(model, samplers[channel.sampler].input);
    const std::vector<float> translations = Values<float>(model, samplers[channel.sampler].output);
    const std::vector<float> rotations = Values<float>(model, samplers[channel.sampler + 1].output);
    ASSERT_EQ(times.size(), film.frames.size());
    for (size_t f = 0; f < times.size(); ++f) {
      EXPECT_EQ(times[f], static_cast<float>(film.frames[f].time));
      ExpectPose(&translations[3 * f], &rotations[4 * f], film.frames[f].poses[channel.target_node]);
      if (f == 0) continue;
      double dot = 0;  // the short way round
      for (int k = 0; k < 4; ++k) dot += double{rotations[4 * f + k]} * rotations[4 * f - 4 + k];
      EXPECT_GT(dot, 0);
    }
  }
  for (size_t i = 0; i < bodies; ++i)
    EXPECT_EQ(moved.contains(static_cast<int>(i)), film.head.bodies[i].kind != BodyKind::kFixed) << i;
}

// The points of a mesh lie on the shape, turned with it.
TEST(FilmGltf, MeshesAreTheShapes) {
  const Film film = AllShapes(1);
  const tinygltf::Model model = Load(Convert(film));
  for (size_t i = 0; i < film.head.bodies.size(); ++i) {
    const Shape& shape = film.head.shapes[film.head.bodies[i].shape];
    const int number = model.meshes[model.nodes[i].mesh].primitives[0].attributes.at("POSITION");
    const std::vector<float> points = Values<float>(model, number);
    Vector3 most = Vector3::Zero();
    for (size_t p = 0; p < points.size(); p += 3) {
      const Vector3 at = Back(&points[p]);
      most = most.cwiseMax(at.cwiseAbs());
      const ShapeKind kind = shape.kind();
      EXPECT_TRUE(kind != ShapeKind::kSphere || std::abs(at.norm() - shape.radius()) < 1e-6);
      EXPECT_TRUE(kind != ShapeKind::kHalfSpace || at.z() == 0);
      EXPECT_TRUE(kind != ShapeKind::kCylinder || std::hypot(at.x(), at.y()) < shape.girth() + 1e-6);
    }
    if (shape.kind() == ShapeKind::kHalfSpace) {
      EXPECT_GE(most.x(), 20);
    } else if (shape.kind() != ShapeKind::kConvexHull) {
      EXPECT_LT((most - shape.half_extents()).norm(), 1e-6) << i;
    }
  }
}

TEST(FilmGltf, WithoutMotionThereIsNoAnimation) {
  Film film = AllShapes(3);
  for (FilmBody& body : film.head.bodies) body = {body.shape, BodyKind::kFixed, 0};
  const std::string bytes = Convert(film);
  const tinygltf::Model model = Load(bytes);
  ExpectValid(bytes, model);
  EXPECT_EQ(model.animations.size(), 0u);
}

TEST(FilmGltf, RefusesWhatItCannotShow) {
  Film film = AllShapes(3);
  film.frames[2].time = std::nextafter(film.frames[1].time, 1);
  EXPECT_THROW(Convert(film), std::invalid_argument);
  film.frames.clear();
  EXPECT_THROW(Convert(film), std::invalid_argument);
  film.head.bodies.clear();
  EXPECT_THROW(Convert(film), std::invalid_argument);
}

}  // namespace
}  // namespace islet
