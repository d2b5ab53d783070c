#include "parallel/fork.h"

#include <chrono>
#include <thread>

namespace islet::parallel {
namespace {

constexpr int kSpins = 4000;   // looks for work before the thread offers its core to others
constexpr int kYields = 2000;  // of those offers before it sleeps between looks

thread_local ForkTeam* current_team = nullptr;
thread_local int current_worker = 0;

void Pause() {
#if defined(__x86_64__) || defined(__i386__)
  __builtin_ia32_pause();
#endif
}

}  // namespace

void Fork(int num_pieces, PieceRef piece, From from) {
  ForkTeam* team = current_team;
  if (!team || num_pieces <= 1) {
    for (int i = 0; i < num_pieces; ++i) piece(i);
    return;
  }
  ForkTeam::Job job{piece, num_pieces, from};
  team->Run(&job);
}

ForkTeam::Member::Member(ForkTeam* team, int worker) : outer_(current_team), outer_worker_(current_worker) {
  current_team = team;
  current_worker = worker;
}
ForkTeam::Member::~Member() {
  current_team = outer_;
  current_worker = outer_worker_;
}

ForkTeam* ForkTeam::Of(const void* pool) { return current_team && current_team->of_ == pool ? current_team : nullptr; }

int ForkTeam::Worker() { return current_worker; }

void ForkTeam::ForEach(int count, PieceRef task) {
  Job job{task, count};
  {
    const std::lock_guard lock(mutex_);
    tasks_.store(&job, std::memory_order_relaxed);
  }
  Job* taken;
  for (int index; TakeTask(&taken, &index);) {
    task(index);
    job.done.fetch_add(1, std::memory_order_release);
  }
  HelpUntil(job.done, count, false);
}

bool ForkTeam::TakeTask(Job** job, int* index) {
  const std::lock_guard lock(mutex_);
  *job = tasks_.load(std::memory_order_relaxed);
  if (!*job) return false;
  *index = (*job)->next++;
  if ((*job)->next == (*job)->count) tasks_.store(nullptr, std::memory_order_relaxed);
  return true;
}

void ForkTeam::Run(Job* job) {
  {
    const std::lock_guard lock(mutex_);
    job->before = latest_.load(std::memory_order_relaxed);
    latest_.store(job, std::memory_order_relaxed);
  }
  for (int piece; TakePiece(job, &piece);) {
    job->piece(piece);
    job->done.fetch_add(1, std::memory_order_release);
  }
  HelpUntil(job->done, job->count, false);
}

// The next piece of the job, or false if all were taken. Whoever takes the last one takes the job off the list.
bool ForkTeam::TakePiece(Job* job, int* piece) {
  const std::lock_guard lock(mutex_);
  if (job->next == job->last) return false;
  *piece = job->next++;
  if (job->next < job->last) return true;
  if (latest_.load(std::memory_order_relaxed) == job) {
    latest_.store(job->before, std::memory_order_relaxed);
  } else {
    Job* after = latest_.load(std::memory_order_relaxed);
    while (after->before != job) after = after->before;
    after->before = job->before;
  }
  return true;
}

bool ForkTeam::HelpOnce(bool tasks_too) {
  Job* job = nullptr;
  int piece;
  if (latest_.load(std::memory_order_relaxed)) {
    const std::lock_guard lock(mutex_);
    job = latest_.load(std::memory_order_relaxed);
    if (job) {
      piece = job->from == From::kFirst ? job->next++ : --job->last;
      if (job->next == job->last) latest_.store(job->before, std::memory_order_relaxed);
    }
  }
  if (!job && !(tasks_too && tasks_.load(std::memory_order_relaxed) && TakeTask(&job, &piece))) return false;
  job->piece(piece);
  job->done.fetch_add(1, std::memory_order_release);  // from here on the job may be gone
  return true;
}

void ForkTeam::HelpUntil(const std::atomic<int>& done, int target, bool tasks_too) {
  for (int idle = 0; done.load(std::memory_order_acquire) != target;) {
    if (HelpOnce(tasks_too)) {
      idle = 0;
    } else if (++idle < kSpins) {
      Pause();
    } else if (idle < kSpins + kYields) {
      std::this_thread::yield();
    } else {
      std::this_thread::sleep_for(std::chrono::microseconds(50));
    }
  }
}

}  // namespace islet::parallel
