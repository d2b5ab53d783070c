#include "scenes/viewer/page.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <fstream>
#include <limits>
#include <random>
#include <sstream>
#include <tuple>

#include "engine/world.h"
#include "scenes/viewer/bundle.h"
#include "tests/scenes/viewer/page_reader.h"

namespace islet {
namespace {

struct TestFilm {
  FilmHead head;
  std::vector<FilmFrame> frames;
};

// One of each shape, dropped on a half-space, and a wall.
TestFilm RunFilm(int steps, std::string name = "shapes") {
  Settings settings;
  settings.threads = 1;
  World world(settings);
  world.Add({.shape = Shape::HalfSpace(), .kind = BodyKind::kFixed});
  world.Add({.shape = Shape::Box({0.25, 4, 1}), .kind = BodyKind::kFixed, .position_W = {3, 0.1, 1}});
  const std::vector<Vector3> corners{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
  const std::array<Shape, 5> shapes{Shape::Box({0.5, 0.4, 0.3}), Shape::Sphere(0.5), Shape::Capsule(0.2, 0.4),
                                    Shape::Cylinder(0.4, 0.3), Shape::ConvexHull(corners)};
  for (int i = 0; i < 15; ++i) {
    world.Add({.shape = shapes[i % 5],
               .position_W = {0.3 * (i % 3), 0.2 * (i % 2), 1.0 + 1.3 * i},
               .rotation_WB = Quaternion(0.8, 0.1 * i, 0.3, -0.2).normalized(),
               .angular_velocity_W = {0.5 * i, -3, 2}});
  }
  TestFilm film;
  film.head = HeadOf(world, 1.0 / 60, std::move(name), "islet run shapes --seconds=3", std::nullopt);
  const double start = PotentialEnergy(world);
  film.frames.push_back(FrameOf(world, {}, 0, 0, start));
  for (int i = 1; i <= steps; ++i) {
    const StepReport report = world.Step(1.0 / 60);
    film.frames.push_back(FrameOf(world, report, i, 1e-3 * i, start));
  }
  return film;
}

void WritePage(const TestFilm& film, PageOptions options, std::ostream* out) {
  options.expected_frames = static_cast<int>(film.frames.size());
  PageWriter writer(out, film.head, options);
  for (const FilmFrame& frame : film.frames) writer.Add(frame);
  writer.Finish("frames");
}

std::string PageOf(const TestFilm& film, const PageOptions& options = {}) {
  std::ostringstream out;
  WritePage(film, options, &out);
  return out.str();
}

std::vector<page_reader::Frame> Decode(const std::string& page) {
  const nlohmann::json head = page_reader::Head(page);
  std::vector<page_reader::Frame> frames;
  for (size_t k = 0; k < head["chunks"].size(); ++k)
    for (page_reader::Frame& frame : page_reader::ReadChunk(page, head, static_cast<int>(k))) frames.push_back(frame);
  return frames;
}

double Press(const FilmContact& c) {
  return std::abs(double{c.impulse_W[0]} * c.normal_W[0] + double{c.impulse_W[1]} * c.normal_W[1] +
                  double{c.impulse_W[2]} * c.normal_W[2]);
}

void ExpectNear(const std::array<double, 3>& found, const std::array<float, 3>& wanted, double error) {
  for (int k = 0; k < 3; ++k) EXPECT_NEAR(found[k], wanted[k], error);
}

TEST(Page, HoldsTheFilmWithinTheErrorsThatItTells) {
  const TestFilm film = RunFilm(200);
  const std::string page = PageOf(film);
  if (const char* path = std::getenv("ISLET_PAGE"))
    std::ofstream(path, std::ios::binary) << page;  // for the browser's test
  const nlohmann::json head = page_reader::Head(page);
  const double position_error = head["errors"]["position"], rotation_error = head["errors"]["rotation"];
  EXPECT_LE(position_error, 1e-4);
  EXPECT_LE(rotation_error, 1e-3);
  const std::vector<page_reader::Frame> frames = Decode(page);
  ASSERT_EQ(frames.size(), film.frames.size());
  size_t contacts = 0, turned = 0;
  for (size_t f = 0; f < frames.size(); ++f) {
    const FilmFrame& wanted = film.frames[f];
    for (size_t i = 0; i < wanted.poses.size(); ++i) {
      double product = 0, length = 0;
      for (int k = 0; k < 3; ++k) EXPECT_NEAR(frames[f].poses[i][k], wanted.poses[i][k], position_error + 1e-12);
      for (int k = 3; k < 7; ++k) {
        product += frames[f].poses[i][k] * wanted.poses[i][k];
        length += double{wanted.poses[i][k]} * wanted.poses[i][k];
      }
      EXPECT_LE(2 * std::acos(std::min(std::abs(product) / std::sqrt(length), 1.0)), rotation_error + 1e-3);
      EXPECT_EQ(frames[f].frozen[i], wanted.frozen[i] != 0);
      EXPECT_EQ(frames[f].island[i], wanted.island[i]);
      EXPECT_NEAR(frames[f].accuracy[i], wanted.accuracy[i], 2e-3 * wanted.accuracy[i] + 1e-20);
      turned += std::abs(wanted.poses[i][6]) < 0.3;
    }
    ASSERT_EQ(frames[f].contacts.size(), wanted.contacts.size());
    std::vector<FilmContact> sorted = wanted.contacts;
    std::stable_sort(sorted.begin(), sorted.end(), [](const FilmContact& p, const FilmContact& q) {
      return std::tie(p.body_a, p.body_b) < std::tie(q.body_a, q.body_b);
    });
    for (size_t c = 0; c < sorted.size(); ++c) {
      const page_reader::Contact& found = frames[f].contacts[c];
      EXPECT_EQ(found.a, sorted[c].body_a);
      EXPECT_EQ(found.b, sorted[c].body_b);
      ExpectNear(found.point, sorted[c].point_W, head["steps"]["position"].get<double>());
      ExpectNear(found.normal, sorted[c].normal_W, 4e-3);
      const auto& j = sorted[c].impulse_W;
      ExpectNear(found.impulse, j,
                 7e-3 * std::sqrt(double{j[0]} * j[0] + double{j[1]} * j[1] + double{j[2]} * j[2]) + 1e-19);
    }
    contacts += sorted.size();
  }
  EXPECT_GT(contacts, 1000u);  // or nothing was compared
  EXPECT_GT(turned, 100u);     // another part of the rotation was left out
}

TEST(Page, TheNumbersOfTheCurvesAreExact) {
  TestFilm film = RunFilm(40);
  film.frames[7].numbers.unsolved = 42;
  const std::string page = PageOf(film), bytes = page_reader::Block(page, "numbers");
  const nlohmann::json head = page_reader::Head(page);
  const auto number = [&](const std::string& name, size_t frame) {
    const auto place = std::find(head["numbers"].begin(), head["numbers"].end(), name) - head["numbers"].begin();
    double value;
    std::memcpy(&value, bytes.data() + 8 * (place * film.frames.size() + frame), 8);
    return value;
  };
  ASSERT_EQ(bytes.size(), 8 * head["numbers"].size() * film.frames.size());
  for (size_t f = 0; f < film.frames.size(); ++f) {
    const FilmNumbers& n = film.frames[f].numbers;
    EXPECT_EQ(number("time", f), film.frames[f].time);
    EXPECT_EQ(number("kinetic", f), n.kinetic);
    EXPECT_EQ(number("potential", f), n.potential);
    EXPECT_EQ(number("static_qp", f), n.stages.static_qp);
    EXPECT_EQ(number("energy_created", f), n.energy_created);
    EXPECT_EQ(number("awake", f), n.awake);
    EXPECT_EQ(number("unsolved", f), n.unsolved);
    EXPECT_EQ(number("hash_high", f) * 4294967296.0 + 0, double(film.frames[f].state_hash >> 32) * 4294967296.0);
    EXPECT_EQ(number("hash_low", f), double(film.frames[f].state_hash & 0xffffffff));
  }
  EXPECT_GT(film.frames[0].numbers.kinetic, 0);  // the bodies turn from the start
  EXPECT_EQ(film.frames[0].numbers.awake, 15);
}

// Many bodies on a random walk, each with so many contacts a frame.
TestFilm Walk(int bodies, int frames, int contacts) {
  TestFilm film;
  film.head.scene = "walk";
  film.head.shapes = {Shape::Box({0.5, 0.5, 0.5})};
  film.head.bodies.assign(bodies, {0, BodyKind::kDynamic, 1});
  std::mt19937 random(7);
  std::uniform_real_distribution<float> unit(-1, 1);
  FilmFrame frame;
  frame.poses.resize(bodies);
  for (auto& pose : frame.poses) pose = {20 * unit(random), 20 * unit(random), 20 * unit(random), 0, 0, 0, 1};
  frame.frozen.assign(bodies, 0);
  frame.island.assign(bodies, 0);
  frame.accuracy.assign(bodies, 1e-7f);
  for (int f = 0; f < frames; ++f) {
    frame.number = f, frame.time = f / 30.0;
    for (auto& pose : frame.poses)
      for (float& part : pose) part += 0.02f * unit(random);
    frame.contacts.clear();
    for (int c = 0; c < contacts; ++c) {
      const int a = c * 7 % (bodies - 1);
      const auto& p = frame.poses[a];
      frame.contacts.push_back({a,
                                a + 1,
                                {p[0] + 0.5f * unit(random), p[1], p[2] + 0.5f * unit(random)},
                                {0, 0, 1},
                                {unit(random), unit(random), std::exp(4 * unit(random))}});
    }
    film.frames.push_back(frame);
  }
  return film;
}

TEST(Page, ContactsThatDoNotFitAreThoseThatPressLeast) {
  const TestFilm film = Walk(100, 40, 400);
  PageOptions options;
  options.contact_bytes = 60'000;
  const std::string page = PageOf(film, options);
  const nlohmann::json head = page_reader::Head(page);
  EXPECT_EQ(head["contacts"]["all"], 40 * 400);
  EXPECT_LT(head["contacts"]["kept"], 40 * 400);
  EXPECT_EQ(head["contacts"]["frames_cut"], 40);
  for (const page_reader::Frame& frame : Decode(page)) EXPECT_EQ(frame.contacts_all, 400u);
  const std::vector<page_reader::Frame> frames = Decode(page);
  for (size_t f = 0; f < frames.size(); ++f) {
    std::vector<double> wanted, found;
    std::vector<double> most(100, 0);
    for (const FilmContact& c : film.frames[f].contacts) {
      wanted.push_back(Press(c));
      for (const int body : {c.body_a, c.body_b}) most[body] = std::max(most[body], Press(c));
    }
    for (const page_reader::Contact& c : frames[f].contacts)
      found.push_back(std::abs(c.impulse[0] * c.normal[0] + c.impulse[1] * c.normal[1] + c.impulse[2] * c.normal[2]));
    std::sort(wanted.rbegin(), wanted.rend());
    std::sort(found.rbegin(), found.rend());
    ASSERT_GE(found.size(), 32u);
    for (size_t k = 0; k < found.size(); ++k) EXPECT_NEAR(found[k], wanted[k], 0.03 * wanted[k]);
    for (int i = 0; i < 100; ++i) EXPECT_NEAR(frames[f].press[i], most[i], 0.03 * most[i]);
  }
}

TEST(Page, AThousandCubesAndSixHundredFramesAreBelow20Megabytes) {
  EXPECT_LT(PageOf(Walk(1000, 600, 1500)).size(), 20'000'000u);
}

TEST(Page, NamesCannotLeaveTheirScript) {
  TestFilm film = RunFilm(1, "</script><script>alert(1)</script><!-- \" ' \\ \xff\xfe\n");
  film.head.command = film.head.title = film.head.about = "islet run '</ScRiPt>' <!--<script>";
  const std::string page = PageOf(film), plain = PageOf(RunFilm(1));
  const nlohmann::json head = page_reader::Head(page);
  for (const char* name : {"command", "title", "about"}) EXPECT_EQ(head[name], film.head.command);
  EXPECT_TRUE(head["scene"].get<std::string>().starts_with("</script><script>alert(1)</script><!--"));
  const auto count = [](const std::string& text, const std::string& part) {
    int found = 0;
    for (size_t at = text.find(part); at != std::string::npos; at = text.find(part, at + 1)) ++found;
    return found;
  };
  for (const char* part : {"<script", "</script", "</ScRiPt", "<!--", "alert(1)</"})
    EXPECT_EQ(count(page, part), count(plain, part)) << part;
}

void ExpectRefused(const TestFilm& film, const std::string& part) {
  try {
    PageOf(film);
    ADD_FAILURE() << "taken, without: " << part;
  } catch (const std::invalid_argument& error) {
    EXPECT_NE(std::string(error.what()).find(part), std::string::npos) << error.what();
  }
}

TEST(Page, WhatIsNoFilmIsRefused) {
  const TestFilm good = RunFilm(3);
  TestFilm film = good;
  film.frames[2].poses[4][1] = std::numeric_limits<float>::quiet_NaN();
  ExpectRefused(film, "frame 2: the pose of body 4");
  film = good;
  film.frames[1].poses[5] = {0, 0, 0, 0, 0, 0, 0};
  ExpectRefused(film, "frame 1: the pose of body 5");
  film = good;
  film.frames[3].contacts.push_back({2, 99, {}, {0, 0, 1}, {}});
  ExpectRefused(film, "frame 3: the contact of bodies 2 and 99");
  film = good;
  film.frames[3].island[3] = 17;
  ExpectRefused(film, "frame 3: the island of body 3");
  film = good;
  film.frames[0].poses.pop_back();
  ExpectRefused(film, "frame 0");
  film = good;
  film.head.bodies[1].shape = 12;
  ExpectRefused(film, "body 1 has shape 12");
  film = good;
  film.frames.clear();
  ExpectRefused(film, "no frame");
}

TEST(Page, FarBodiesStayNearTheirPlace) {
  TestFilm film = Walk(2, 5, 1);
  film.frames[3].poses[1][0] = 1e30f;
  film.frames[4].poses[1][0] = -1e30f;
  const std::string page = PageOf(film);
  EXPECT_GT(page_reader::Head(page)["errors"]["position"].get<double>(), 1e29);
  EXPECT_NEAR(Decode(page)[2].poses[1][0], film.frames[2].poses[1][0], 1e-3);
  EXPECT_GT(Decode(page)[3].poses[1][0], 1e6);
}

TEST(Page, NeedsNoNetwork) {
  const std::string page(ViewerPage());
  for (const char* part : {"src=\"http", "href=\"http", "<link rel=\"stylesheet\"", "@import", "url(http"})
    EXPECT_EQ(page.find(part), std::string::npos) << part;
}

TEST(Page, AStreamThatFailsIsTold) {
  const TestFilm film = RunFilm(1);
  std::ostringstream out;
  out.setstate(std::ios::badbit);
  EXPECT_THROW(WritePage(film, {}, &out), std::runtime_error);
}

}  // namespace
}  // namespace islet
