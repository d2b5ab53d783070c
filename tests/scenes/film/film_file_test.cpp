#include "scenes/film/film_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/resource.h>

#include <chrono>
#include <csignal>
#include <limits>
#include <stdexcept>

#include "engine/contact.h"
#include "scenes/film/chunk_file.h"
#include "scenes/film/film_head.h"
#include "scenes/film/frame_code.h"
#include "tests/support/films.h"

namespace islet {
namespace {

using testing::AllShapes;
using testing::ExpectSame;
using testing::Film;
using ::testing::HasSubstr;
using testing::ReadBytes;
using testing::ReadFilm;
using testing::Scratch;
using testing::Write;
using testing::WriteBytes;

std::string RefusalOf(const std::string& path) {
  try {
    ReadFilm(path);
  } catch (const std::invalid_argument& error) {
    return error.what();
  }
  return "";
}

// Some bodies, and no more than it takes.
Film Small() {
  Film film;
  film.head.scene = "small";
  film.head.shapes = {Shape::Sphere(0.5)};
  film.head.bodies = {{0, BodyKind::kFixed, 0}, {0, BodyKind::kDynamic, 2}};
  for (int i = 0; i < 3; ++i) {
    FilmFrame frame;
    frame.number = i;
    frame.time = 0.1 * i;
    frame.poses = {{0, 0, 0, 0, 0, 0, 1}, {0, 0.1f, 1.0f - 0.1f * static_cast<float>(i), 0, 0, 0, 1}};
    frame.frozen = {0, 1};
    frame.island = {-1, 1};
    frame.accuracy = {0, 1e-7f};
    frame.contacts = {{0, 1, {0, 0, 0.5f}, {0, 0, 1}, {0, 0, 0.3f}}};
    frame.state_hash = 0x0123456789abcdefu + static_cast<std::uint64_t>(i);
    film.frames.push_back(frame);
  }
  film.stopped_by = "rest";
  return film;
}

TEST(FilmFile, GivesBackWhatItGotBitForBit) {
  const Scratch scratch;
  const Film film = AllShapes(40);
  ASSERT_EQ(film.head.shapes.size(), 6u);
  ASSERT_GT(film.frames.back().contacts.size(), 5u);
  Write(film, scratch.path());
  ExpectSame(film, ReadFilm(scratch.path()));
}

TEST(FilmFile, KeepsExtremeNumbers) {
  const Scratch scratch;
  Film film = Small();
  film.head.scene = "\"\\\n\x01 \xc3\xa9";
  film.head.title = "\"title\"";
  film.head.about = "about\n\xc3\xa9";
  film.head.scene_text = std::string(100'000, '[');
  film.head.arguments = {"", "--a=b c", "'"};
  film.head.dt = 5e-324;
  film.head.bodies[1].mass = 1.7976931348623157e308;
  film.head.gravity_W = {-0.0, 0.1, 1e-300};
  using Limits = std::numeric_limits<float>;
  FilmFrame& frame = film.frames[1];
  frame.poses[1] = {Limits::max(), -Limits::max(), -0.0f, Limits::denorm_min(), -Limits::min(), 1e-30f, 1};
  frame.state_hash = ~std::uint64_t{0};
  frame.numbers.kinetic = std::numeric_limits<double>::denorm_min();
  frame.numbers.contacts = std::numeric_limits<int>::max();
  frame.numbers.unsolved = (1 << 30) - 2;
  frame.numbers.failed = true;
  // In no order, one pair more often than in the frame before, one both ways, one with itself.
  frame.contacts = {{1, 0, {1, 2, 3}, {-0.0f, 0, 1}, {4, 5, 6}}, {0, 1, {7, 8, 9}, {1, 0, 0}, {1, 1, 1}},
                    {1, 1, {1, 1, 1}, {0, 1, 0}, {2, 2, 2}},     {0, 1, {7, 8, 9}, {1, 0, 0}, {1, 1, 1}},
                    {0, 1, {7, 8, 1}, {1, 0, 0}, {1, 1, 5}},     {1, 0, {7, 8, 9}, {1, 0, 0}, {1, 1, 1}}};
  film.frames[2].contacts.clear();
  Write(film, scratch.path());
  ExpectSame(film, ReadFilm(scratch.path()));
}

// Older recordings have 0 or 1 where now the problems without an answer stand, too.
TEST(FilmFile, WhatAnOlderRecordingDoesNotTellIsUnknown) {
  FilmFrame frame = Small().frames[0];
  for (const bool failed : {false, true}) {
    frame.numbers.failed = failed;
    frame.numbers.unsolved = 42;
    const FilmFrame read = DecodeFrame(EncodeFrame(frame, nullptr, 2), nullptr, 2);
    EXPECT_EQ(read.numbers.unsolved, 42);
    EXPECT_EQ(read.numbers.failed, failed);
    std::string old = EncodeFrame(frame, nullptr, 2);
    old.replace(56, 4, {failed ? '\1' : '\0', '\0', '\0', '\0'});
    const FilmFrame unknown = DecodeFrame(old, nullptr, 2);
    EXPECT_EQ(unknown.numbers.unsolved, -1);
    EXPECT_EQ(unknown.numbers.failed, failed);
    EXPECT_EQ(EncodeFrame(unknown, nullptr, 2), old);
  }
}

TEST(FilmFile, ManyBodiesAlikeTakeFewBytes) {
  const Scratch scratch;
  Film film;
  film.head.scene = "many";
  film.head.shapes = {Shape::Box({0.5, 0.5, 0.5})};
  film.head.bodies.assign(kMostFilmBodies, {0, BodyKind::kDynamic, 1});
  Write(film, scratch.path());
  EXPECT_LT(ReadBytes(scratch.path()).size(), 500u);
  EXPECT_EQ(ReadFilm(scratch.path()).head.bodies.size(), kMostFilmBodies);
  film.head.bodies.push_back(film.head.bodies[0]);
  EXPECT_THROW(Write(film, scratch.Beside("more")), std::invalid_argument);
  EXPECT_FALSE(std::filesystem::exists(scratch.Beside("more")));
}

TEST(FilmFile, CutAnywhereItGivesTheFramesBefore) {
  const Scratch scratch;
  const Film film = Small();
  std::vector<size_t> ends;  // of the head, then of each frame
  {
    FilmWriter writer(scratch.path(), film.head);
    ends.push_back(std::filesystem::file_size(scratch.path()));
    for (const FilmFrame& frame : film.frames) {
      writer.Add(frame);
      ends.push_back(std::filesystem::file_size(scratch.path()));  // there at once, without a Finish
    }
    writer.Finish("rest");
  }
  const std::string whole = ReadBytes(scratch.path());
  ASSERT_GT(whole.size(), ends.back());
  const std::string part = scratch.Beside("part");
  for (size_t size = 0; size < whole.size(); ++size) {
    WriteBytes(part, whole.substr(0, size));
    if (size < ends[0]) {
      EXPECT_THAT(RefusalOf(part), HasSubstr(part)) << size;
      continue;
    }
    const Film read = ReadFilm(part);
    size_t frames = 0;
    while (frames < film.frames.size() && ends[frames + 1] <= size) ++frames;
    ASSERT_EQ(read.frames.size(), frames) << size;
    for (size_t i = 0; i < frames; ++i) ExpectSame(read.frames[i], film.frames[i]);
    EXPECT_EQ(read.stopped_by, "") << size;
    FilmReader reader(part);
    for (FilmFrame frame; reader.Next(&frame);) {
    }
    EXPECT_EQ(reader.left_over(), size - ends[frames]);
  }
}

TEST(FilmFile, EveryByteThatChangedIsSeen) {
  const Scratch scratch;
  Write(Small(), scratch.path());
  const std::string whole = ReadBytes(scratch.path());
  const std::string broken = scratch.Beside("broken");
  for (size_t i = 0; i < whole.size(); ++i) {
    for (const int flip : {1, 128}) {
      std::string bytes = whole;
      bytes[i] = static_cast<char>(bytes[i] ^ flip);
      WriteBytes(broken, bytes);
      ASSERT_THAT(RefusalOf(broken), HasSubstr(broken + ": byte ")) << "byte " << i << " flipped by " << flip;
    }
  }
  WriteBytes(broken, whole + whole.substr(12));
  EXPECT_THAT(RefusalOf(broken), HasSubstr("byte " + std::to_string(whole.size()) + ": the recording goes on"));
}

TEST(FilmFile, NoRecordingIsRefusedByName) {
  const Scratch scratch;
  EXPECT_THAT(RefusalOf(scratch.path()), HasSubstr("No such file"));
  EXPECT_THAT(RefusalOf("/"), HasSubstr("directory"));
  WriteBytes(scratch.path(), "");
  EXPECT_THAT(RefusalOf(scratch.path()), HasSubstr("is empty"));
  WriteBytes(scratch.path(), "{\"scene\": 1}");
  EXPECT_THAT(RefusalOf(scratch.path()), HasSubstr("no recording"));
  WriteBytes(scratch.path(), std::string("isletrec\x02\0\0\0", 12));
  EXPECT_THAT(RefusalOf(scratch.path()), HasSubstr("version 2"));
}

// A head that was tampered with, checksums and all.
std::string RefusalOfHead(const std::string& from, const std::string& to) {
  const Scratch scratch;
  std::string text = HeadToJson(Small().head);
  const size_t at = text.find(from);
  EXPECT_NE(at, std::string::npos) << from << " in " << text;
  text.replace(at, from.size(), to);
  ChunkWriter(scratch.path(), ChunkKind::kHead, text).Close();
  return RefusalOf(scratch.path());
}

// Half a million of them took minutes.
std::string ManyKeys(int count) {
  std::string keys;
  for (int i = 0; i < count; ++i) keys += "\"k" + std::to_string(i) + "\":0,";
  return keys;
}

TEST(FilmFile, HeadsThatAreWrongAreRefusedByKey) {
  const std::vector<std::array<std::string, 3>> cases{
      {"\"dt\":", "\"td\":", "dt is missing"},
      {"\"dt\":0.0", "\"dt\":-0.0", "dt must be positive, got -0.0"},
      {"\"dt\":", "\"dt\":1e999,\"d\":", "no JSON"},
      {"\"dt\":", "\"dt\":\"x\",\"d\":", "dt must be a finite number, got \"x\""},
      {"[0.0,0.0,-9.81]", "[0.0,-9.81]", "gravity must be 3 numbers"},
      {"[0.0,0.0,-9.81]", "[0.0,null,-9.81]", "gravity must be a finite number, got null"},
      {"\"sphere\"", "\"cone\"", "kind is of no known kind, got \"cone\""},
      {"\"radius\":0.5", "\"radius\":-0.5", "radius must be positive"},
      {"\"radius\":0.5", "\"radius\":1e200", "radius must be below 1e30"},
      {"\"radius\":0.5", "\"ra\":0.5", "radius is missing"},
      {"[1,0,\"fixed\"", "[1,1,\"fixed\"", "their shape must be a whole number from 0 to 0, got 1"},
      {"[1,0,\"fixed\"", "[1,-1,\"fixed\"", "got -1"},
      {"[1,0,\"fixed\"", "[1,18446744073709551615,\"fixed\"", "got 18446744073709551615"},
      {"[1,0,\"fixed\"", "[1,0.5,\"fixed\"", "got 0.5"},
      {"[1,0,\"fixed\"", "[0,0,\"fixed\"", "their count"},
      {"[1,0,\"fixed\"", "[131072,0,\"fixed\"", "from 1 to 0, got 1"},
      {"[1,0,\"fixed\"", "[1000000000000,0,\"fixed\"", "got 1000000000000"},
      {"[1,0,\"fixed\"", "[1,0,\"wall\"", "got \"wall\""},
      {"[1,0,\"fixed\"", "[1,\"fixed\"", "rows of count"},
      {"\"dynamic\",2", "\"dynamic\",-2", "mass must not be negative"},
      {"\"arguments\":[]", "\"arguments\":7", "arguments must be a list"},
      {"\"arguments\":[]", "\"arguments\":[7]", "arguments must be a text, got 7"},
      {"\"shapes\":", "\"bounds\":[[0,0,0],[1,1,-1]],\"shapes\":", "bounds must be a lower and an upper corner"},
      {"\"arguments\":[]", "\"arguments\":" + std::string(100'000, '['), "nested"},
      {"\"arguments\":[]", "\"arguments\":[0" + std::string(600'000, ','), "more than 500000 values"},
      {"{\"program\"", "[{\"program\"", "no JSON"},
      {"\"arguments\":[]", ManyKeys(200) + "\"arguments\":[]", "more than 100 keys of one object"},
      {"\"arguments\":[]", "\"arguments\":[]}]}" + std::string(100, ']'), "no JSON"},
      {"\"radius\":0.5", "\"radius\":0.5" + std::string(9 << 20, ' '), "at most 8388608 are right"},
  };
  for (const auto& [from, to, message] : cases)
    EXPECT_THAT(RefusalOfHead(from, to), HasSubstr(message)) << from << " -> " << to.substr(0, 60);
}

TEST(FilmFile, HullsThatAreWrongAreRefused) {
  Film film = AllShapes(1);
  const std::string text = HeadToJson(film.head);
  HeadFromJson(text);
  const auto refused = [&](const std::string& from, const std::string& to, const std::string& message) {
    std::string changed = text;
    const size_t at = changed.find(from, changed.find("\"hull\""));
    ASSERT_NE(at, std::string::npos) << from;
    changed.replace(at, from.size(), to);
    try {
      HeadFromJson(changed);
      ADD_FAILURE() << from << " -> " << to;
    } catch (const std::invalid_argument& error) {
      EXPECT_THAT(error.what(), HasSubstr(message));
    }
  };
  refused("\"faces\":[[", "\"faces\":[[9,", "faces must be a whole number from 0 to 6, got 9");
  refused("\"faces\":[[", "\"faces\":[[0,1],[", "three corners");
  refused("\"faces\":[[", "\"faces\":[[0,1,2],[", "normals");
  refused("\"vertices\":[[", "\"vertices\":[[1,", "must be 3 numbers");
  refused("\"vertices\":[[", "\"vertices\":[[1e300,0,0],[", "radius must be below 1e30");
  refused("\"faces\":[[", "\"faces\":[[0,0,0],[", "normals");
}

TEST(FilmFile, FramesThatAreWrongAreRefusedWithTheirPlace) {
  const Scratch scratch;
  const Film film = Small();
  const std::string first = EncodeFrame(film.frames[0], nullptr, 2);
  const auto refused = [&](const std::string& second, const std::string& message) {
    ChunkWriter writer(scratch.path(), ChunkKind::kHead, HeadToJson(film.head));
    writer.Append(ChunkKind::kFrame, first);
    const auto offset = std::filesystem::file_size(scratch.path());
    writer.Append(ChunkKind::kFrame, second);
    writer.Close();
    EXPECT_THAT(RefusalOf(scratch.path()),
                HasSubstr(scratch.path() + ": byte " + std::to_string(offset) + ": the frame behind 1 others: "));
    EXPECT_THAT(RefusalOf(scratch.path()), HasSubstr(message));
  };
  const std::string second = EncodeFrame(film.frames[1], &film.frames[0], 2);
  const auto with = [&](size_t at, const std::string& bytes) {
    return second.substr(0, at) + bytes + second.substr(at + bytes.size());
  };
  const std::string nan("\0\0\0\0\0\0\xf8\x7f", 8), ones("\xff\xff\xff\xff", 4);
  refused("", "has only 0 bytes");
  refused(second + "x", "do not make");
  refused(with(0, std::string(4, '\0')), "number must grow");
  refused(with(0, ones), "number is too large");
  refused(with(4, ones), "4294967295 contacts of 2 bodies do not make");
  refused(with(8, ones), "has 4294967295 bodies, the head has 2");
  refused(with(12, nan), "time is not a number");
  refused(with(12, std::string(8, '\0')), "time must grow");
  refused(with(28, ones), "contacts must not be negative, got -1");
  refused(with(59, std::string(1, '\x80')), "failed must not be negative");
  refused(with(60, nan), "step_seconds is not a number");
  const size_t columns = 180;  // x of body 0 and 1, byte by byte
  refused(with(columns + 4, std::string("\x80\0\x7f\0", 4)), "a pose is infinite");
  refused(with(columns + 6 * 8, second.substr(columns + 6 * 8, 4) + std::string("\x80\0\x3f\0", 4)),
          "a rotation is zero");
  refused(with(columns + 7 * 8, std::string("\2", 1)), "island must be a body or -1");
  refused(with(columns + 9 * 8, std::string("\2", 1)), "frozen must be 0 or 1, got 2");
  refused(with(columns + 9 * 8 + 2, std::string("\2", 1)), "bodies that are not there: 2, 1");
}

TEST(FilmFile, ChunksOutOfOrderAreRefused) {
  const Scratch scratch;
  const Film film = Small();
  const std::string head = HeadToJson(film.head), frame = EncodeFrame(film.frames[0], nullptr, 2);
  { ChunkWriter(scratch.path(), ChunkKind::kEnd, "{}"); }
  EXPECT_THAT(RefusalOf(scratch.path()), HasSubstr("not the head"));
  {
    ChunkWriter writer(scratch.path(), ChunkKind::kHead, head);
    writer.Append(ChunkKind::kHead, head);
  }
  EXPECT_THAT(RefusalOf(scratch.path()), HasSubstr("a second head"));
  for (const char* end : {"", "[]", "{\"frames\":1}", "{\"frames\":1,\"stopped_by\":\"\"}",
                          "{\"frames\":2,\"stopped_by\":\"rest\"}", "{\"frames\":\"1\",\"stopped_by\":\"rest\"}"}) {
    ChunkWriter writer(scratch.path(), ChunkKind::kHead, head);
    writer.Append(ChunkKind::kFrame, frame);
    writer.Append(ChunkKind::kEnd, end);
    EXPECT_THAT(RefusalOf(scratch.path()), HasSubstr("the end does not tell why it ended after 1 frames")) << end;
  }
}

// [MB] most that this process had in memory since it was last asked to forget.
long PeakMemory() {
  std::ifstream status("/proc/self/status");
  for (std::string line; std::getline(status, line);)
    if (line.starts_with("VmHWM:")) return std::stol(line.substr(6)) / 1024;
  return -1;
}
void ForgetPeakMemory() { std::ofstream("/proc/self/clear_refs") << "5"; }

TEST(FilmFile, ALittleFileDoesNotAskForMuch) {
  const Scratch scratch;
  Film film = Small();
  film.head.bodies.assign(kMostFilmBodies, film.head.bodies[0]);
  {
    // A frame of half a million contacts, all zero, which is wrong at its end.
    ChunkWriter writer(scratch.path(), ChunkKind::kHead, HeadToJson(film.head));
    std::string frame(FrameBytes(kMostFilmBodies, kMostFrameContacts), '\0');
    writer.Append(ChunkKind::kFrame, frame);
  }
  ASSERT_LT(ReadBytes(scratch.path()).size(), 10'000u);
  ForgetPeakMemory();
  const long before = PeakMemory();
  const auto start = std::chrono::steady_clock::now();
  EXPECT_THAT(RefusalOf(scratch.path()), HasSubstr("the frame"));
  EXPECT_LT(PeakMemory() - before, 100);
  EXPECT_LT(std::chrono::steady_clock::now() - start, std::chrono::seconds(1));
}

TEST(FilmFile, WhatCannotBeRecordedLeavesTheFileAsItWas) {
  const Scratch scratch;
  WriteBytes(scratch.path(), "old");
  Film film = Small();
  CustomShape custom;
  custom.half_extents = {1, 1, 1};
  custom.size = custom.volume = 1;
  custom.inertia_per_mass = Matrix3::Identity();
  custom.collide = [](const CustomQuery&, std::vector<Contact>*) {};
  film.head.shapes = {Shape::Custom(custom)};
  try {
    Write(film, scratch.path());
    ADD_FAILURE() << "a custom shape";
  } catch (const std::invalid_argument& error) {
    EXPECT_THAT(error.what(), HasSubstr("a custom shape is a function"));
    EXPECT_THAT(error.what(), HasSubstr(scratch.path()));
  }
  film = Small();
  film.head.scene = "\xff";
  EXPECT_THROW(Write(film, scratch.path()), std::invalid_argument);
  EXPECT_EQ(ReadBytes(scratch.path()), "old");

  film = Small();
  film.frames[2].poses[1][0] = std::numeric_limits<float>::quiet_NaN();
  EXPECT_THROW(Write(film, scratch.path()), std::runtime_error);
  EXPECT_EQ(ReadFilm(scratch.path()).frames.size(), 2u);
}

TEST(FilmFile, AFullDiskIsAnErrorAndKeepsTheFramesBefore) {
  EXPECT_THROW(Write(Small(), "/dev/full"), std::runtime_error);
  EXPECT_THROW(Write(Small(), "/nowhere/film"), std::runtime_error);

  const Scratch scratch;
  const Film film = AllShapes(30);
  Write(film, scratch.path());
  const auto whole = std::filesystem::file_size(scratch.path());
  rlimit before{};
  getrlimit(RLIMIT_FSIZE, &before);
  std::signal(SIGXFSZ, SIG_IGN);
  for (const auto size : {whole / 2, whole - 1, std::uintmax_t{100}}) {
    const rlimit limit{size, before.rlim_max};
    setrlimit(RLIMIT_FSIZE, &limit);
    std::string message;
    try {
      Write(film, scratch.Beside("cut"));
    } catch (const std::runtime_error& error) {
      message = error.what();
    }
    setrlimit(RLIMIT_FSIZE, &before);
    EXPECT_THAT(message, HasSubstr("cannot write " + scratch.Beside("cut") + ": File too large"));
    if (size == 100) continue;  // not even the head: the file from before is still there
    const Film cut = ReadFilm(scratch.Beside("cut"));
    EXPECT_GT(cut.frames.size(), 10u);
    EXPECT_EQ(cut.stopped_by, "");
    FilmReader reader(scratch.Beside("cut"));
    for (FilmFrame frame; reader.Next(&frame);) {
    }
    EXPECT_EQ(reader.left_over(), 0u);
  }
}

}  // namespace
}  // namespace islet
