#include "parallel/fork.h"

#include <chrono>
#include <thread>

namespace islet::parallel {
namespace {

constexpr int kSpins = 4000;   // looks for work before the thread offers its core to others
constexpr int kYields = 2000;  // of those offers before it sleeps between looks

thread_local ForkTeam* current_team = nullptr;

void Pause() {
#if defined(__x86_64__) || defined(__i386__)
  __builtin_ia32_pause();
#endif
}

}  // namespace

int ForkWidth() { return current_team ? current_team->width_ : 1; }

void Fork(int num_pieces, PieceRef piece) {
  ForkTeam* team = current_team;
  if (!team || num_pieces <= 1) {
    for (int i = 0; i < num_pieces; ++i) piece(i);
    return;
  }
  ForkTeam::Job job{piece, num_pieces, 0, {}, nullptr};
  team->Run(&job);
}

ForkTeam::Member::Member(ForkTeam* team) : outer_(current_team) { current_team = team; }
ForkTeam::Member::~Member() { current_team = outer_; }

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
  HelpUntil(job->done, job->count);
}

// The next piece of the job, or false if all were taken. Whoever takes the last one takes the job off the list.
bool ForkTeam::TakePiece(Job* job, int* piece) {
  const std::lock_guard lock(mutex_);
  if (job->next == job->count) return false;
  *piece = job->next++;
  if (job->next < job->count) return true;
  if (latest_.load(std::memory_order_relaxed) == job) {
    latest_.store(job->before, std::memory_order_relaxed);
  } else {
    Job* after = latest_.load(std::memory_order_relaxed);
    while (after->before != job) after = after->before;
    after->before = job->before;
  }
  return true;
}

bool ForkTeam::HelpOnce() {
  if (!latest_.load(std::memory_order_relaxed)) return false;
  Job* job;
  int piece;
  {
    const std::lock_guard lock(mutex_);
    job = latest_.load(std::memory_order_relaxed);
    if (!job) return false;
    piece = job->next++;
    if (job->next == job->count) latest_.store(job->before, std::memory_order_relaxed);
  }
  job->piece(piece);
  job->done.fetch_add(1, std::memory_order_release);  // from here on the job may be gone
  return true;
}

void ForkTeam::HelpUntil(const std::atomic<int>& done, int target) {
  for (int idle = 0; done.load(std::memory_order_acquire) != target;) {
    if (HelpOnce()) {
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
