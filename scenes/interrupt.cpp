#include "scenes/interrupt.h"

#include <unistd.h>

#include <array>
#include <atomic>
#include <csignal>
#include <cstring>
#include <utility>

#include "scenes/output_file.h"

namespace islet {
namespace {

constexpr std::array<int, 2> kSignals{SIGINT, SIGTERM};

std::atomic<bool> asked{false}, obeyed{false};
static_assert(std::atomic<bool>::is_always_lock_free);  // or a handler could not use it
std::array<struct sigaction, kSignals.size()> before;
const char* message = "";

// Only what a signal handler may do: no allocation, no stdio.
void Say(const char* text) {
  const ssize_t written = ::write(STDERR_FILENO, text, std::strlen(text));
  static_cast<void>(written);
}

void Handle(int) {
  if (asked.exchange(true)) {
    RemoveTemporaries();
    ::_exit(Interrupt::kExitStatus);
  }
  Say("\nislet: ");
  Say(message);
  Say("; once more ends it at once\n");
}

}  // namespace

Interrupt::Interrupt(const char* what) {
  message = what;
  asked = obeyed = false;
  struct sigaction action = {};
  action.sa_handler = Handle;
  sigemptyset(&action.sa_mask);
  action.sa_flags = SA_RESTART;  // no write of ours is cut short
  for (size_t i = 0; i < kSignals.size(); ++i) {
    ::sigaction(kSignals[i], nullptr, &before[i]);
    if (before[i].sa_handler != SIG_IGN) ::sigaction(kSignals[i], &action, nullptr);
  }
}

Interrupt::~Interrupt() {
  for (size_t i = 0; i < kSignals.size(); ++i) ::sigaction(kSignals[i], &before[i], nullptr);
}

bool Interrupt::Asked() {
  if (asked) obeyed = true;
  return asked;
}

bool Interrupt::Obeyed() { return obeyed; }

}  // namespace islet
