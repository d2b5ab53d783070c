// The program from outside: runs that record, are killed, are checked.
#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <spawn.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <csignal>
#include <cstdlib>
#include <random>
#include <thread>

#include "tests/support/films.h"

namespace islet {
namespace {

using testing::ExpectSame;
using testing::Film;
using ::testing::HasSubstr;
using testing::ReadBytes;
using testing::ReadFilm;
using testing::Scratch;
using testing::Write;
using testing::WriteBytes;

pid_t Start(std::vector<std::string> arguments, const std::string& messages) {
  arguments.insert(arguments.begin(), ISLET_PROGRAM);
  std::vector<char*> argv;
  for (std::string& argument : arguments) argv.push_back(argument.data());
  argv.push_back(nullptr);
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_addopen(&actions, STDOUT_FILENO, messages.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0600);
  posix_spawn_file_actions_adddup2(&actions, STDOUT_FILENO, STDERR_FILENO);
  pid_t process = -1;
  EXPECT_EQ(posix_spawn(&process, ISLET_PROGRAM, &actions, nullptr, argv.data(), environ), 0);
  posix_spawn_file_actions_destroy(&actions);
  return process;
}

int Wait(pid_t process) {
  int status = -1;
  EXPECT_EQ(waitpid(process, &status, 0), process);
  return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
}

struct Outcome {
  int status;
  std::string messages;
};
Outcome RunIslet(const Scratch& scratch, const std::vector<std::string>& arguments) {
  const std::string messages = scratch.Beside("messages");
  const int status = Wait(Start(arguments, messages));
  return {status, ReadBytes(messages)};
}

std::vector<std::string> Recording(const std::string& path) {
  return {"run", "cubejam", "--count", "20", "--frames", "60", "--threads", "1", "--record", path};
}

// More kills by hand: ISLET_KILLS=200.
TEST(Record, AKillAtAnyMomentLeavesTheFramesBefore) {
  const Scratch scratch;
  const std::string messages = scratch.Beside("messages");
  const auto start = std::chrono::steady_clock::now();
  ASSERT_EQ(Wait(Start(Recording(scratch.Beside("whole")), messages)), 0);
  const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  const Film whole = ReadFilm(scratch.Beside("whole"));
  ASSERT_EQ(whole.frames.size(), 61u);
  ASSERT_EQ(whole.stopped_by, "frames");

  const char* const wish = std::getenv("ISLET_KILLS");
  const int kills = wish ? std::atoi(wish) : 20;
  std::mt19937 random(20261125);
  std::uniform_real_distribution<double> moment(0, seconds);
  int cut = 0;
  for (int i = 0; i < kills; ++i) {
    std::filesystem::remove(scratch.path());
    const pid_t process = Start(Recording(scratch.path()), messages);
    std::this_thread::sleep_for(std::chrono::duration<double>(moment(random)));
    kill(process, SIGKILL);
    Wait(process);
    if (!std::filesystem::exists(scratch.path())) continue;  // killed before there was a head
    const Film film = ReadFilm(scratch.path());
    ASSERT_LE(film.frames.size(), whole.frames.size());
    for (size_t f = 0; f < film.frames.size(); ++f) ExpectSame(film.frames[f], whole.frames[f], false);
    cut += film.frames.size() < whole.frames.size();
    EXPECT_TRUE(film.stopped_by.empty() || film.frames.size() == whole.frames.size());
  }
  std::printf("%d kills, %d within the recording, of %zu frames in %.2f s\n", kills, cut, whole.frames.size(), seconds);
  EXPECT_GT(cut, kills / 4);
}

TEST(Record, ACheckPassesAndFindsTheFrameThatDiffers) {
  const Scratch scratch;
  ASSERT_EQ(RunIslet(scratch, {"run", "csstack", "--seed", "12", "--dt", "0.02", "--frames", "25", "--friction=0.4",
                               "--record", scratch.path(), "--report", scratch.Beside("report")})
                .status,
            0);
  EXPECT_TRUE(std::filesystem::exists(scratch.Beside("report")));
  Film film = ReadFilm(scratch.path());
  EXPECT_EQ(film.head.command, "islet run csstack --seed=12 --friction=0.4 --frames=25 --dt=0.02");
  ASSERT_EQ(film.frames.size(), 26u);
  EXPECT_EQ(film.frames[0].time, 0);

  const auto check = [&] { return RunIslet(scratch, {"replay", scratch.path(), "--check", "--threads", "2"}); };
  Outcome outcome = check();
  EXPECT_EQ(outcome.status, 0) << outcome.messages;
  EXPECT_THAT(outcome.messages, HasSubstr("all 26 frames are the same"));

  const auto changed = [&](const auto& change) {
    Film other = film;
    change(&other);
    Write(other, scratch.path());
    return check();
  };
  outcome = changed([](Film* f) { f->frames[7].state_hash ^= 1; });
  EXPECT_EQ(outcome.status, 1);
  EXPECT_THAT(outcome.messages, HasSubstr("frame 7 differs, at 0.14 s"));
  outcome = changed([](Film* f) { f->frames[0].state_hash ^= 1; });
  EXPECT_EQ(outcome.status, 1);
  EXPECT_THAT(outcome.messages, HasSubstr("frame 0 differs"));
  outcome = changed([](Film* f) { f->head.arguments[1] = "--seed=13"; });
  EXPECT_EQ(outcome.status, 1);
  EXPECT_THAT(outcome.messages, HasSubstr("frame 0 differs"));
  outcome = changed([](Film* f) { f->frames.pop_back(); });
  EXPECT_EQ(outcome.status, 1);
  EXPECT_THAT(outcome.messages, HasSubstr("ends with frame 24 by frames, this run goes on"));
  outcome = changed([](Film* f) { f->head.arguments[3] = "--frames=20"; });
  EXPECT_EQ(outcome.status, 1);
  EXPECT_THAT(outcome.messages, HasSubstr("this run ends with frame 20 by frames, the recording goes on"));
  outcome = changed([](Film* f) { f->stopped_by = "rest"; });
  EXPECT_EQ(outcome.status, 1);
  EXPECT_THAT(outcome.messages, HasSubstr("stopped by rest, this run by frames"));

  // Cut off, or ended from outside: what is there is compared.
  outcome = changed([](Film* f) { f->frames.resize(10), f->stopped_by.clear(); });
  EXPECT_EQ(outcome.status, 0) << outcome.messages;
  EXPECT_THAT(outcome.messages, HasSubstr("all 10 frames are the same"));
  outcome = changed([](Film* f) { f->frames.resize(10), f->stopped_by = "interrupt"; });
  EXPECT_EQ(outcome.status, 0) << outcome.messages;
  outcome = changed([](Film* f) { f->head.version = "9.9"; });
  EXPECT_EQ(outcome.status, 0) << outcome.messages;
  EXPECT_THAT(outcome.messages, HasSubstr("recorded by islet 9.9"));
}

// A recording from somebody else writes no file and runs nothing but a scene.
TEST(Record, ACheckRunsNothingButARun) {
  const Scratch scratch;
  ASSERT_EQ(RunIslet(scratch, {"run", "stack", "--frames", "2", "--record", scratch.path()}).status, 0);
  const Film film = ReadFilm(scratch.path());
  const std::string target = scratch.Beside("target");
  const std::vector<std::pair<std::vector<std::string>, std::string>> cases{
      {{"stack", "--report=" + target}, "--report does not decide a run"},
      {{"stack", "--record=" + target}, "--record does not decide a run"},
      {{"stack", "--export-fclib=" + target}, "--export-fclib does not decide a run"},
      {{"stack", "--threads=999"}, "--threads does not decide a run"},
      {{"stack", "--tier=swept"}, "--tier does not decide a run"},
      {{"stack", "--help"}, "--help"},
      {{"stack", "--speed=3"}, "--speed"},
      {{"stack", "--seed=1", "--seed=2"}, "--seed"},
      {{"stack", "--dt=nan"}, "--dt"},
      {{"nothing"}, "nothing"},
      {{"stack\x1b[2J"}, "control characters"},
      {{}, "does not tell the command"},
  };
  for (const auto& [arguments, message] : cases) {
    Film other = film;
    other.head.arguments = arguments;
    Write(other, scratch.path());
    const Outcome outcome = RunIslet(scratch, {"replay", scratch.path(), "--check"});
    EXPECT_EQ(outcome.status, 2) << message << ": " << outcome.messages;
    EXPECT_THAT(outcome.messages, HasSubstr(message));
    EXPECT_FALSE(std::filesystem::exists(target));
  }
}

TEST(Record, AFullDiskDoesNotEndTheRun) {
  const Scratch scratch;
  rlimit before{};
  getrlimit(RLIMIT_FSIZE, &before);
  const rlimit limit{30'000, before.rlim_max};
  std::signal(SIGXFSZ, SIG_IGN);  // the program inherits both
  setrlimit(RLIMIT_FSIZE, &limit);
  const Outcome outcome = RunIslet(
      scratch, {"run", "cubejam", "--frames", "40", "--record", scratch.path(), "--report", scratch.Beside("report")});
  setrlimit(RLIMIT_FSIZE, &before);
  EXPECT_EQ(outcome.status, 1);
  EXPECT_THAT(outcome.messages, HasSubstr("cannot write " + scratch.path() + ": File too large; the recording ends"));
  EXPECT_THAT(ReadBytes(scratch.Beside("report")), HasSubstr("\"frames\": 40"));
  const Film film = ReadFilm(scratch.path());
  EXPECT_GT(film.frames.size(), 1u);
  EXPECT_LT(film.frames.size(), 41u);
}

TEST(Record, TellsWhatIsInIt) {
  const Scratch scratch;
  ASSERT_EQ(RunIslet(scratch, {"run", "stack", "--frames", "4", "--record", scratch.path()}).status, 0);
  Outcome outcome = RunIslet(scratch, {"replay", scratch.path()});
  EXPECT_EQ(outcome.status, 0);
  for (const char* part : {"stack, 5 frames of 0.03333 s, 0.13 s", "command     islet run stack --frames=4",
                           "10 that move, 1 others", "complete, stopped by frames"})
    EXPECT_THAT(outcome.messages, HasSubstr(part));
  const std::string bytes = ReadBytes(scratch.path());
  WriteBytes(scratch.path(), bytes.substr(0, bytes.size() - 40));
  outcome = RunIslet(scratch, {"replay", scratch.path()});
  EXPECT_EQ(outcome.status, 0);
  EXPECT_THAT(outcome.messages, HasSubstr("cut off behind frame 4; "));
  WriteBytes(scratch.path(), bytes.substr(0, bytes.size() - 1000));
  EXPECT_EQ(RunIslet(scratch, {"replay", scratch.path()}).status, 2);
  Film film;
  film.head.scene = "none";
  Write(film, scratch.path());
  outcome = RunIslet(scratch, {"replay", scratch.path()});
  EXPECT_THAT(outcome.messages, HasSubstr("cut off before the first frame; 0 bytes"));
}

TEST(Record, WritesGltfOrNothing) {
  const Scratch scratch;
  ASSERT_EQ(RunIslet(scratch, {"run", "stack", "--frames", "4", "--record", scratch.path()}).status, 0);
  const std::string glb = scratch.Beside("stack.glb");
  EXPECT_EQ(RunIslet(scratch, {"replay", scratch.path(), "--out", glb}).status, 0);
  EXPECT_EQ(ReadBytes(glb).substr(0, 4), "glTF");
  const auto refused = [&](const std::vector<std::string>& arguments, int status, const std::string& message) {
    const Outcome outcome = RunIslet(scratch, arguments);
    EXPECT_EQ(outcome.status, status) << outcome.messages;
    EXPECT_THAT(outcome.messages, HasSubstr(message));
  };
  refused({"replay", scratch.path(), "--out", scratch.Beside("stack.obj")}, 2, "must end in .glb");
  refused({"replay", scratch.path(), "--out", "/nowhere/stack.glb"}, 2, "--out: cannot write /nowhere/stack.glb");
  refused({"replay", glb, "--out", glb}, 2, "--out would overwrite");
  refused({"replay", glb}, 2, "byte 0: this is no recording");
  refused({"replay", scratch.path(), "--threads", "2"}, 2, "--threads 2 needs --check");
  refused({"run", "stack", "--frames", "2", "--record", "/dev/full"}, 1, "/dev/full: No space left");
  refused({"run", "stack", "--record", glb, "--report", glb}, 2, "same file");
  EXPECT_FALSE(std::filesystem::exists(scratch.Beside("stack.obj")));
}

}  // namespace
}  // namespace islet
