#include "scenes/apart.h"

#include <poll.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <csignal>
#include <cstdint>
#include <cstring>
#include <exception>
#include <stdexcept>

#include "engine/stopwatch.h"
#include "scenes/interrupt.h"

namespace islet {
namespace {

constexpr double kTick = 0.1;  // [s] between two calls of watch
enum Kind : char { kTold = 't', kReturned = 'r', kThrown = 'e' };
constexpr size_t kHead = 1 + sizeof(std::uint64_t);  // of a message: its kind, the length of its text

// The child's side. A parent that is gone ends it.
void Send(int pipe, Kind kind, const std::string& text) {
  const std::uint64_t length = text.size();
  std::string message(1, kind);
  message.append(reinterpret_cast<const char*>(&length), sizeof length);
  message += text;
  for (size_t sent = 0; sent < message.size();) {
    const ssize_t count = ::write(pipe, message.data() + sent, message.size() - sent);
    if (count < 0 && errno == EINTR) continue;
    if (count < 0) ::_exit(1);
    sent += static_cast<size_t>(count);
  }
}

[[noreturn]] void Work(int pipe, pid_t parent, const std::function<std::string(const Tell&)>& work) {
  ::prctl(PR_SET_PDEATHSIG, SIGKILL);
  if (::getppid() != parent) ::_exit(1);  // it died before that
  std::signal(SIGINT, SIG_IGN);           // a terminal sends them to both: the parent decides
  std::signal(SIGTERM, SIG_DFL);
  try {
    Send(pipe, kReturned, work([pipe](const std::string& text) { Send(pipe, kTold, text); }));
  } catch (const std::exception& error) {
    Send(pipe, kThrown, error.what());
  }
  ::_exit(0);  // nothing of the parent's is flushed or destroyed twice
}

// The parent's side. Takes whole messages off the front of what has come; returns whether the end was among them.
bool Receive(std::string* come, ApartEnd* end) {
  while (come->size() >= kHead) {
    std::uint64_t length = 0;
    std::memcpy(&length, come->data() + 1, sizeof length);
    if (come->size() - kHead < length) break;
    const char kind = (*come)[0];
    std::string text = come->substr(kHead, length);
    come->erase(0, kHead + length);
    if (kind == kTold) {
      end->told = std::move(text);
    } else {
      end->how = kind == kReturned ? ApartEnd::How::kDone : ApartEnd::How::kCrash;
      end->text = std::move(text);
      return true;
    }
  }
  return false;
}

// Owns the process and the reading end of its pipe.
class Child {
 public:
  explicit Child(const std::function<std::string(const Tell&)>& work) {
    int ends[2];
    if (::pipe(ends) != 0) throw std::runtime_error(std::string("no pipe: ") + std::strerror(errno));
    const pid_t parent = ::getpid();
    id_ = ::fork();
    if (id_ == 0) {
      ::close(ends[0]);
      Work(ends[1], parent, work);
    }
    const int error = errno;
    ::close(ends[1]);
    pipe_ = ends[0];
    if (id_ > 0) return;
    ::close(pipe_);
    throw std::runtime_error(std::string("no process: ") + std::strerror(error));
  }
  ~Child() {
    Stop();
    ::close(pipe_);
  }
  Child(const Child&) = delete;
  Child& operator=(const Child&) = delete;

  int pipe() const { return pipe_; }

  // Ends it if it has not ended, and says why it did.
  std::string Stop() {
    if (id_ <= 0) return "";
    ::kill(id_, SIGKILL);
    return Wait();
  }
  std::string Wait() {
    int status = 0;
    while (::waitpid(id_, &status, 0) < 0 && errno == EINTR) {
    }
    id_ = 0;
    return WIFSIGNALED(status)
               ? std::string("signal ") + std::to_string(WTERMSIG(status)) + " (" + ::strsignal(WTERMSIG(status)) + ")"
               : "exit status " + std::to_string(WEXITSTATUS(status));
  }

 private:
  pid_t id_ = 0;
  int pipe_ = -1;
};

}  // namespace

ApartEnd RunApart(const std::function<std::string(const Tell& tell)>& work, std::optional<double> limit,
                  const std::function<void(double seconds, const std::string& told)>& watch) {
  const Stopwatch clock;
  ApartEnd end;
  std::string come;
  Child child(work);
  for (;;) {
    const double left = limit ? *limit - clock.seconds() : kTick;
    pollfd wanted{child.pipe(), POLLIN, 0};
    const int ready = ::poll(&wanted, 1, static_cast<int>(1e3 * std::clamp(left, 0.0, kTick)) + 1);
    if (ready > 0) {
      char piece[1 << 16];
      const ssize_t count = ::read(child.pipe(), piece, sizeof piece);
      if (count > 0) come.append(piece, static_cast<size_t>(count));
      if (count == 0) {  // it has closed its end without an answer
        end.text = child.Wait();
        return end;
      }
    }
    if (Receive(&come, &end)) return end;
    watch(clock.seconds(), end.told);
    if (Interrupt::Asked()) end.how = ApartEnd::How::kInterrupt;
    if (limit && clock.seconds() >= *limit) end.how = ApartEnd::How::kTimeLimit;
    if (end.how != ApartEnd::How::kCrash) return end;
  }
}

}  // namespace islet
