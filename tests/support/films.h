// Films that several tests record, and when two are the same.
#pragma once

#include <gtest/gtest.h>

#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>
#include <vector>

#include "engine/shape_data.h"
#include "scenes/film/film_file.h"
#include "tests/support/worlds.h"

namespace islet::testing {

struct Film {
  FilmHead head;
  std::vector<FilmFrame> frames;
  std::string stopped_by;  // empty: cut off
};

inline Film ReadFilm(const std::string& path) {
  FilmReader reader(path);
  Film film;
  film.head = reader.head();
  for (FilmFrame frame; reader.Next(&frame);) film.frames.push_back(frame);
  film.stopped_by = reader.stopped_by();
  return film;
}

inline std::string ReadBytes(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

inline void WriteBytes(const std::string& path, const std::string& bytes) {
  std::ofstream(path, std::ios::binary).write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
}

// A path of its own in the folder of the system's temporary files; what is there goes with the object.
class Scratch {
 public:
  explicit Scratch(const std::string& name = "film") {
    const auto* test = ::testing::UnitTest::GetInstance()->current_test_info();
    folder_ =
        std::filesystem::temp_directory_path() / (std::string("islet_") + test->test_suite_name() + "_" + test->name());
    std::filesystem::remove_all(folder_);
    std::filesystem::create_directories(folder_);
    path_ = folder_ / name;
  }
  ~Scratch() { std::filesystem::remove_all(folder_); }
  std::string path() const { return path_; }
  std::string Beside(const std::string& name) const { return folder_ / name; }

 private:
  std::filesystem::path folder_, path_;
};

// Of every shape that can be recorded one that falls on a half-space, beside a fixed box and a kinematic one.
inline Film AllShapes(int frames) {
  World world(Awake());
  world.Add(Floor());
  const Shape cube = Shape::Box({0.5, 0.4, 0.3});
  const std::vector<Vector3> points{{0, 0, 0},     {1, 0, 0},     {0, 1.1, 0},      {0.1, 0.2, 0.9},
                                    {0.7, 0.7, 0}, {0.5, 0, 0.6}, {-0.2, -0.1, 0.3}};
  const auto add = [&](const Shape& shape, BodyKind kind, const Vector3& position) {
    BodyDefinition body{.shape = shape, .kind = kind, .position_W = position, .friction = 0.5, .restitution = 0.2};
    body.rotation_WB = Turn(0.3, {1, 2, 3});
    if (kind == BodyKind::kDynamic) body.mass = 1.0 / 3;
    if (kind == BodyKind::kKinematic) body.linear_velocity_W = {0.1, 0, 0};
    world.Add(body);
  };
  add(cube, BodyKind::kFixed, {-3, 0, 1});
  add(cube, BodyKind::kKinematic, {-6, 0, 1});
  for (const Shape& shape : {cube, cube, Shape::Sphere(0.37), Shape::ConvexHull(points), Shape::Capsule(0.2, 0.45),
                             Shape::Cylinder(0.31, 0.4)})
    add(shape, BodyKind::kDynamic, {1.5 * static_cast<double>(world.bodies().size()), 0.1, 0.7});
  Film film;
  film.head = HeadOf(world, 1.0 / 60, "shapes", "islet run shapes", Region{{-9, -9, 0}, {30, 9, 1e6}});
  film.head.arguments = {"shapes", "--friction=0.5"};
  film.head.version = "1.2.3";
  film.frames.push_back(FrameOf(world, {}, 0, 0, 0));
  for (int frame = 1; frame < frames; ++frame) {
    const StepReport report = world.Step(film.head.dt);
    film.frames.push_back(FrameOf(world, report, frame, 0.001 * frame, 0));
  }
  film.stopped_by = "frames";
  return film;
}

inline void Write(const Film& film, const std::string& path) {
  FilmWriter writer(path, film.head);
  for (const FilmFrame& frame : film.frames) writer.Add(frame);
  if (!film.stopped_by.empty()) writer.Finish(film.stopped_by);
}

template <typename T>
bool SameBits(const T& a, const T& b) {
  return std::memcmp(&a, &b, sizeof a) == 0;
}

// But for wall times, if these are two runs.
inline void ExpectSame(const FilmFrame& a, const FilmFrame& b, bool times = true) {
  ASSERT_EQ(a.number, b.number);
  EXPECT_EQ(a.state_hash, b.state_hash) << "frame " << a.number;
  EXPECT_TRUE(SameBits(a.time, b.time));
  ASSERT_EQ(a.poses.size(), b.poses.size());
  for (size_t i = 0; i < a.poses.size(); ++i) EXPECT_TRUE(SameBits(a.poses[i], b.poses[i])) << "body " << i;
  EXPECT_EQ(a.frozen, b.frozen);
  EXPECT_EQ(a.island, b.island);
  ASSERT_EQ(a.accuracy.size(), b.accuracy.size());
  for (size_t i = 0; i < a.accuracy.size(); ++i) EXPECT_TRUE(SameBits(a.accuracy[i], b.accuracy[i])) << "body " << i;
  ASSERT_EQ(a.contacts.size(), b.contacts.size());
  for (size_t i = 0; i < a.contacts.size(); ++i)
    EXPECT_TRUE(SameBits(a.contacts[i], b.contacts[i])) << "contact " << i << " of frame " << a.number;
  const FilmNumbers &m = a.numbers, &n = b.numbers;
  EXPECT_TRUE(!times || (SameBits(m.stages, n.stages) && SameBits(m.step_seconds, n.step_seconds)));
  EXPECT_EQ(m.contacts, n.contacts);
  EXPECT_EQ(m.islands, n.islands);
  EXPECT_EQ(m.awake, n.awake);
  EXPECT_EQ(m.frozen, n.frozen);
  EXPECT_EQ(m.sides_changed, n.sides_changed);
  EXPECT_EQ(m.overlapping, n.overlapping);
  EXPECT_EQ(m.missed, n.missed);
  EXPECT_EQ(m.failed, n.failed);
  EXPECT_TRUE(SameBits(m.kinetic, n.kinetic) && SameBits(m.potential, n.potential));
  EXPECT_TRUE(SameBits(m.coulomb_map, n.coulomb_map) && SameBits(m.penetration, n.penetration));
  EXPECT_TRUE(SameBits(m.energy_created, n.energy_created));
  EXPECT_TRUE(SameBits(m.momentum_unexplained, n.momentum_unexplained));
  EXPECT_TRUE(SameBits(m.angular_momentum_unexplained, n.angular_momentum_unexplained));
}

inline void ExpectSame(const Shape& a, const Shape& b) {
  const Shape::Data &m = a.data(), &n = b.data();
  EXPECT_EQ(m.kind, n.kind);
  EXPECT_EQ(m.radius, n.radius);
  EXPECT_EQ(m.half_extents, n.half_extents);
  EXPECT_EQ(m.size, n.size);
  EXPECT_EQ(m.girth, n.girth);
  EXPECT_EQ(m.half_length, n.half_length);
  EXPECT_EQ(m.hull_offset, n.hull_offset);
  EXPECT_EQ(m.volume, n.volume);
  EXPECT_EQ(m.inertia_per_mass, n.inertia_per_mass);
  EXPECT_EQ(m.polytope.vertices, n.polytope.vertices);
  EXPECT_EQ(m.polytope.faces, n.polytope.faces);
  EXPECT_EQ(m.polytope.face_normals, n.polytope.face_normals);
  EXPECT_EQ(m.polytope.edges, n.polytope.edges);
  EXPECT_EQ(m.polytope.edge_faces, n.polytope.edge_faces);
}

inline void ExpectSame(const FilmHead& a, const FilmHead& b) {
  EXPECT_EQ(a.scene, b.scene);
  EXPECT_EQ(a.title, b.title);
  EXPECT_EQ(a.about, b.about);
  EXPECT_EQ(a.command, b.command);
  EXPECT_EQ(a.arguments, b.arguments);
  EXPECT_EQ(a.scene_text, b.scene_text);
  EXPECT_EQ(a.version, b.version);
  EXPECT_EQ(a.dt, b.dt);
  EXPECT_EQ(a.tolerance, b.tolerance);
  EXPECT_EQ(a.gravity_W, b.gravity_W);
  ASSERT_EQ(a.bounds.has_value(), b.bounds.has_value());
  EXPECT_TRUE(!a.bounds || (a.bounds->lower == b.bounds->lower && a.bounds->upper == b.bounds->upper));
  ASSERT_EQ(a.shapes.size(), b.shapes.size());
  for (size_t i = 0; i < a.shapes.size(); ++i) ExpectSame(a.shapes[i], b.shapes[i]);
  ASSERT_EQ(a.bodies.size(), b.bodies.size());
  for (size_t i = 0; i < a.bodies.size(); ++i) {
    EXPECT_EQ(a.bodies[i].shape, b.bodies[i].shape);
    EXPECT_EQ(a.bodies[i].kind, b.bodies[i].kind);
    EXPECT_EQ(a.bodies[i].mass, b.bodies[i].mass);
  }
}

inline void ExpectSame(const Film& a, const Film& b) {
  ExpectSame(a.head, b.head);
  ASSERT_EQ(a.frames.size(), b.frames.size());
  for (size_t i = 0; i < a.frames.size(); ++i) ExpectSame(a.frames[i], b.frames[i]);
  EXPECT_EQ(a.stopped_by, b.stopped_by);
}

}  // namespace islet::testing
