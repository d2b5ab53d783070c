#include "bench/charts/run.h"

#include <poll.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <exception>
#include <string_view>
#include <type_traits>

namespace islet::charts {
namespace {

static_assert(std::is_trivially_copyable_v<RunResult>);

using Clock = std::chrono::steady_clock;

double Since(Clock::time_point start) { return std::chrono::duration<double>(Clock::now() - start).count(); }

double ProcessSeconds() {
  timespec now{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

void SetFailed(std::string_view what, RunResult* result) {
  std::snprintf(result->failed, sizeof result->failed, "%.*s", static_cast<int>(what.size()), what.data());
}

double Quantile(std::vector<double>* values, double share) {
  if (values->empty()) return 0;
  const auto nth = values->begin() + static_cast<long>(share * static_cast<double>(values->size() - 1));
  std::nth_element(values->begin(), nth, values->end());
  return *nth;
}

// Waits until the child has something to say or has ended; ends it if it takes more processor time [s] than that, which it
// only does in a single step that does not come back. The clock is read from outside: a timer or a limit inside the child
// would make its own clock of processor time as coarse as the scheduler's ticks.
bool AwaitOrStop(pid_t child, int pipe_end, double seconds) {
  constexpr int kPollMilliseconds = 200;
  clockid_t clock{};
  const bool readable = clock_getcpuclockid(child, &clock) == 0;
  pollfd waiting{.fd = pipe_end, .events = POLLIN, .revents = 0};
  while (poll(&waiting, 1, kPollMilliseconds) == 0) {
    timespec spent{};
    if (!readable || clock_gettime(clock, &spent) != 0) continue;
    if (static_cast<double>(spent.tv_sec) < seconds) continue;
    kill(child, SIGKILL);
    return false;
  }
  return true;
}

// `all_measures`: also those that are costly to take; a repeat ends in the same states, so it need not.
RunResult RunOnce(const ChartScene& scene, const peers::Engine& engine, const peers::Setting& setting,
                  const Limits& limits, bool all_measures) {
  const peers::WorldPlan plan = PlanOf(scene, limits.start);
  const std::unique_ptr<peers::Peer> peer = engine.make(plan, setting);
  Judge judge(plan);
  std::vector<peers::State> before(plan.bodies.size()), states(plan.bodies.size());
  const auto read = [&](std::vector<peers::State>* all) {
    for (size_t i = 0; i < all->size(); ++i) (*all)[i] = peer->Read(static_cast<int>(i));
  };
  read(&states);
  judge.Sample(0, states);

  // Steps longer than the distance of samples: one sample a step.
  const int steps_per_sample = std::max(1, static_cast<int>(std::lround(1 / (setting.dt * kSamplesPerSecond))));
  const int samples = static_cast<int>(std::lround(scene.seconds / (steps_per_sample * setting.dt)));
  RunResult result;
  std::vector<double> step_seconds;
  step_seconds.reserve(static_cast<size_t>(samples) * steps_per_sample);
  double contacts = 0;
  int done = 0;
  while (done < samples && std::min(result.wall, result.cpu) < limits.stepping && judge.Result().finite) {
    const bool whole_step = all_measures && judge.WantsStep();
    double cpu_before = ProcessSeconds();
    for (int i = 0; i < steps_per_sample; ++i) {
      if (whole_step && i + 1 == steps_per_sample) {
        result.cpu += ProcessSeconds() - cpu_before;
        read(&before);
        cpu_before = ProcessSeconds();
      }
      const Clock::time_point start = Clock::now();
      peer->Step(setting.dt);
      step_seconds.push_back(Since(start));
      result.wall += step_seconds.back();
    }
    result.cpu += ProcessSeconds() - cpu_before;
    contacts += peer->Contacts();
    const double time = ++done * steps_per_sample * setting.dt;
    read(&states);
    if (whole_step) judge.SampleStep(time, before, states, setting.dt);
    judge.Sample(time, states);
  }

  result.simulated = done * steps_per_sample * setting.dt;
  result.step_median = Quantile(&step_seconds, 0.5);
  result.step_p99 = Quantile(&step_seconds, 0.99);
  if (contacts >= 0) result.contacts_mean = contacts / std::max(1, done);
  result.measures = judge.Result();
  result.hash = judge.StateHash();
  result.repeats = 1;
  const Outcome outcome = scene.judge(plan, judge.last(), result.measures);
  result.error = outcome.error;
  SetFailed(!outcome.failed.empty() ? outcome.failed : done < samples ? "time limit" : "", &result);
  return result;
}

}  // namespace

RunResult Run(const ChartScene& scene, const peers::Engine& engine, const peers::Setting& setting,
              const Limits& limits) {
  RunResult best = RunOnce(scene, engine, setting, limits, /*all_measures=*/true);
  const Measures measures = best.measures;
  int repeats = 1;
  bool repeatable = true;
  double spent = best.wall;
  while (repeats < limits.repeats && spent < limits.repeat_until) {
    const RunResult again = RunOnce(scene, engine, setting, limits, /*all_measures=*/false);
    ++repeats;
    spent += again.wall;
    repeatable = repeatable && again.hash == best.hash;
    if (again.wall < best.wall) best = again;
  }
  best.measures.coulomb_error = measures.coulomb_error;
  best.measures.coulomb_end = measures.coulomb_end;
  best.measures.coulomb_told = measures.coulomb_told;
  best.measures.coulomb_judged = measures.coulomb_judged;
  best.repeats = repeats;
  best.repeatable = repeatable;
  return best;
}

RunResult RunApart(const ChartScene& scene, const peers::Engine& engine, const peers::Setting& setting,
                   const Limits& limits) {
  RunResult result;
  int ends[2];
  if (pipe(ends) != 0) {
    SetFailed("no pipe", &result);
    return result;
  }
  std::fflush(nullptr);
  const pid_t child = fork();
  if (child == 0) {
    prctl(PR_SET_PDEATHSIG, SIGKILL);  // who stops the program stops its run
    close(ends[0]);
    try {
      const RunResult own = Run(scene, engine, setting, limits);
      const bool written = write(ends[1], &own, sizeof own) == static_cast<ssize_t>(sizeof own);
      std::_Exit(written ? EXIT_SUCCESS : EXIT_FAILURE);
    } catch (const std::exception& error) {
      std::fprintf(stderr, "%s: %s\n", engine.name.c_str(), error.what());
      std::_Exit(peers::kRefusedExit);
    }
  }
  close(ends[1]);
  const bool in_time = child > 0 && AwaitOrStop(child, ends[0], setting.threads * (1.5 * limits.stepping + 10));
  const bool whole = in_time && read(ends[0], &result, sizeof result) == static_cast<ssize_t>(sizeof result);
  close(ends[0]);
  int status = 0;
  rusage usage{};
  if (child > 0) wait4(child, &status, 0, &usage);
  if (!whole) {
    const bool refused = WIFEXITED(status) && WEXITSTATUS(status) == peers::kRefusedExit;
    result = {};
    SetFailed(refused ? "refused" : !in_time ? "time limit" : "crashed", &result);
  }
  result.memory_kib = usage.ru_maxrss;
  return result;
}

}  // namespace islet::charts
