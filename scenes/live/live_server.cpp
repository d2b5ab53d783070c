#include "scenes/live/live_server.h"

#include <httplib.h>
#include <poll.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <charconv>
#include <chrono>
#include <condition_variable>
#include <deque>
#include <future>
#include <mutex>
#include <random>
#include <stdexcept>
#include <thread>
#include <utility>
#include <vector>

namespace islet {
namespace {

constexpr int kMostStreams = 4;
constexpr int kServerThreads = 12;                    // a stream keeps one
constexpr auto kPatience = std::chrono::seconds(20);  // for a run that is in a step
constexpr auto kBeat =
    std::chrono::seconds(2);         // between signs of life to a stream, which tell whether it is still there
constexpr size_t kMostWaiting = 64;  // messages
constexpr std::array kEventNames{"head", "state"};  // as LiveEvent counts; frames are kept
constexpr size_t kMostAtOnce = 1 << 20;             // [bytes] of frames that who comes has not seen

constexpr size_t kLongestRequest = 32 << 10;                   // [bytes] a head as browsers send it, and a message
constexpr auto kRequestTime = std::chrono::milliseconds(900);  // in which a request must be there
constexpr int kWriteTime = 5000;                               // [ms] for who reads slowly

// A connection for one request. The library reads lines of any length: what comes here ends at kLongestRequest, and after kRequestTime.
class RequestStream final : public httplib::Stream {
 public:
  explicit RequestStream(socket_t socket) : socket_(socket) {}

  bool is_readable() const override { return begin_ < end_ || Wait(POLLIN, TimeLeft()); }
  bool is_writable() const override { return Wait(POLLOUT, kWriteTime); }
  ssize_t read(char* to, size_t size) override {
    if (begin_ == end_) {
      if (!Wait(POLLIN, TimeLeft())) return -1;
      const ssize_t got = ::recv(socket_, buffer_.data(), std::min(buffer_.size(), left_), 0);
      if (got <= 0) return got;
      begin_ = 0, end_ = static_cast<size_t>(got);
      left_ -= end_;
    }
    size = std::min(size, end_ - begin_);
    std::copy_n(buffer_.data() + begin_, size, to);
    begin_ += size;
    return static_cast<ssize_t>(size);
  }
  using Stream::write;
  ssize_t write(const char* from, size_t size) override {
    return is_writable() ? ::send(socket_, from, size, MSG_NOSIGNAL) : -1;
  }
  void get_remote_ip_and_port(std::string&, int&) const override {}
  void get_local_ip_and_port(std::string&, int&) const override {}
  socket_t socket() const override { return socket_; }

  // Who still sends would not hear the answer if the connection were closed at once.
  void Close() {
    ::shutdown(socket_, SHUT_WR);
    while (Wait(POLLIN, TimeLeft()) && ::recv(socket_, buffer_.data(), buffer_.size(), 0) > 0) {
    }
    ::close(socket_);
  }

 private:
  int TimeLeft() const {
    const auto left = std::chrono::ceil<std::chrono::milliseconds>(end_time_ - std::chrono::steady_clock::now());
    return static_cast<int>(std::max<long>(left.count(), 0));
  }
  bool Wait(short event, int milliseconds) const {
    pollfd wanted{socket_, event, 0};
    return ::poll(&wanted, 1, milliseconds) > 0 && (wanted.revents & event);
  }

  socket_t socket_;
  std::chrono::steady_clock::time_point end_time_ = std::chrono::steady_clock::now() + kRequestTime;
  std::array<char, 4096> buffer_;
  size_t begin_ = 0, end_ = 0, left_ = kLongestRequest;
};

class BoundedServer final : public httplib::Server {
  bool process_and_close_socket(socket_t socket) override {
    RequestStream stream(socket);
    bool closed = false;
    const bool good = process_request(stream, /*close_connection=*/true, closed, nullptr);
    stream.Close();
    return good;
  }
};

std::string NewToken() {
  std::random_device device;
  std::string token;
  for (int k = 0; k < 32; ++k) token += "0123456789abcdef"[device() % 16];
  return token;
}

}  // namespace

struct LiveServer::Impl {
  struct Message {
    LiveCommand command;
    std::promise<std::string> answer;  // empty: done
  };

  std::string page, token = NewToken(), address;
  int port = 0;
  BoundedServer server;
  std::thread thread;

  std::mutex lock;
  std::condition_variable news, work;
  struct Event {
    std::string text;
    std::uint64_t count = 0;  // of those that there were
  };
  std::array<Event, kEventNames.size()> events;
  struct Frame {
    std::shared_ptr<const std::string> text;
    std::uint64_t count;  // from 1; its id in the stream
  };
  std::vector<Frame> frames;  // that are kept, the newest at last
  std::uint64_t frame_count = 0;
  size_t letters = 0;  // of frames
  std::deque<std::shared_ptr<Message>> waiting;
  bool ending = false;
  std::atomic<int> streams = 0;

  bool IsOurs(const httplib::Request& request) const;
  // What one page has been sent.
  struct Seen {
    std::array<std::uint64_t, kEventNames.size()> events{};
    std::uint64_t frame = 0;  // count of the last
    bool all = false;         // that was kept: from now on it gets the newest alone
  };
  void Keep(std::string text);
  std::vector<Frame> NewsFor(Seen* seen) const;
  void Stream(const httplib::Request& request, httplib::Response& response);
  void Command(const httplib::Request& request, httplib::Response& response);
};

bool LiveServer::Impl::IsOurs(const httplib::Request& request) const {
  const std::string host = request.get_header_value("Host"), port_text = std::string(":").append(std::to_string(port));
  const bool here = host == "127.0.0.1" + port_text || host == "localhost" + port_text;
  return here && request.path.starts_with("/" + token + "/");
}

void LiveServer::Impl::Keep(std::string text) {
  letters += text.size();
  frames.push_back({std::make_shared<const std::string>(std::move(text)), ++frame_count});
  while (frames.size() > 2 && (frames.size() > kMostFrames || letters > kMostLetters)) {
    const size_t half = frames.size() / 2;
    std::vector<Frame> kept;
    for (size_t i = 0; i < frames.size(); ++i) {
      if (i >= half || i % 2 == 0)
        kept.push_back(std::move(frames[i]));
      else
        letters -= frames[i].text->size();
    }
    frames = std::move(kept);
  }
}

// Frames that a page is to be sent next.
std::vector<LiveServer::Impl::Frame> LiveServer::Impl::NewsFor(Seen* seen) const {
  std::vector<Frame> chosen;
  seen->frame = std::min(seen->frame, frame_count);  // an id may be anything
  if (seen->frame == frame_count) {
    seen->all = true;
    return chosen;
  }
  if (seen->all) {
    chosen.push_back(frames.back());
  } else {
    size_t bytes = 0;
    auto next = std::upper_bound(frames.begin(), frames.end(), seen->frame,
                                 [](std::uint64_t count, const Frame& frame) { return count < frame.count; });
    for (; next != frames.end() && bytes < kMostAtOnce; ++next) {
      bytes += next->text->size();
      chosen.push_back(*next);
    }
    seen->all = next == frames.end();
  }
  seen->frame = chosen.back().count;
  return chosen;
}

void LiveServer::Impl::Stream(const httplib::Request& request, httplib::Response& response) {
  if (streams.fetch_add(1) >= kMostStreams) {
    --streams;
    response.status = 503;
    response.set_content("too many pages look at this run", "text/plain");
    return;
  }
  auto seen = std::make_shared<Seen>();
  const std::string last = request.get_header_value("Last-Event-ID");
  std::from_chars(last.data(), last.data() + last.size(), seen->frame);
  response.set_header("Cache-Control", "no-store");
  response.set_chunked_content_provider(
      "text/event-stream",
      [this, seen](size_t, httplib::DataSink& sink) {
        std::string text;
        std::vector<Frame> coming;
        bool ends = false;
        {
          std::unique_lock guard(lock);
          const auto is_news = [&](size_t k) { return seen->events[k] != events[k].count; };
          news.wait_for(guard, kBeat, [&] { return ending || is_news(0) || is_news(1) || seen->frame != frame_count; });
          for (size_t k = 0; k < events.size(); ++k) {
            if (is_news(k)) text.append("event: ").append(kEventNames[k]).append("\ndata: " + events[k].text + "\n\n");
            seen->events[k] = events[k].count;
          }
          coming = NewsFor(seen.get());
          ends = ending && seen->frame == frame_count;
        }
        for (const Frame& frame : coming)
          text.append("id: " + std::to_string(frame.count) + "\nevent: frame\ndata: ")
              .append(*frame.text)
              .append("\n\n");
        if (ends) {
          text += "event: end\ndata:\n\n";
          sink.write(text.data(), text.size());
          sink.done();
          return true;
        }
        if (text.empty()) text = ": here\n\n";
        return sink.write(text.data(), text.size());
      },
      [this](bool) {
        const std::scoped_lock guard(lock);
        --streams;
        news.notify_all();
      });
}

void LiveServer::Impl::Command(const httplib::Request& request, httplib::Response& response) {
  const auto refuse = [&](int status, const std::string& why) {
    response.status = status;
    response.set_content(why, "text/plain");
  };
  auto message = std::make_shared<Message>();
  try {
    message->command = ParseCommand(request.body);
  } catch (const std::invalid_argument& error) {
    return refuse(400, error.what());
  }
  std::future<std::string> answer = message->answer.get_future();
  {
    const std::scoped_lock guard(lock);
    if (ending) return refuse(503, "the run has ended");
    if (waiting.size() >= kMostWaiting) return refuse(503, "too many messages wait");
    waiting.push_back(message);
  }
  work.notify_one();
  if (answer.wait_for(kPatience) != std::future_status::ready) {
    const std::scoped_lock guard(lock);
    if (std::erase(waiting, message) > 0) return refuse(503, "the run is busy");
  }
  const std::string why = answer.get();
  if (!why.empty()) return refuse(400, why);
  response.status = 204;
}

std::string HttplibVersion() { return CPPHTTPLIB_VERSION; }

LiveServer::LiveServer(std::string page, int port) : impl_(std::make_unique<Impl>()) {
  Impl& s = *impl_;
  s.page = std::move(page);
  s.server.new_task_queue = [] { return new httplib::ThreadPool(kServerThreads); };
  s.server.set_socket_options([](socket_t socket) {  // the library's own would let two programs share a port
    const int yes = 1;
    ::setsockopt(socket, SOL_SOCKET, SO_REUSEADDR, &yes, sizeof yes);
  });
  s.server.set_payload_max_length(kLongestCommand);
  s.server.set_pre_routing_handler([&s](const httplib::Request& request, httplib::Response& response) {
    if (s.IsOurs(request)) return httplib::Server::HandlerResponse::Unhandled;
    response.status = 403;
    response.set_content("not yours\n", "text/plain");
    return httplib::Server::HandlerResponse::Handled;
  });
  s.server.Get("/" + s.token + "/", [&s](const httplib::Request&, httplib::Response& response) {
    response.set_header("Cache-Control", "no-store");
    response.set_content(s.page, "text/html; charset=utf-8");
  });
  s.server.Get("/" + s.token + "/stream",
               [&s](const httplib::Request& request, httplib::Response& response) { s.Stream(request, response); });
  s.server.Post("/" + s.token + "/command",
                [&s](const httplib::Request& request, httplib::Response& response) { s.Command(request, response); });
  s.port = port == 0 ? s.server.bind_to_any_port("127.0.0.1") : s.server.bind_to_port("127.0.0.1", port) ? port : -1;
  if (s.port <= 0)
    throw std::runtime_error("cannot listen at 127.0.0.1:" + std::to_string(port) + "; is another program there?");
  s.address = "http://127.0.0.1:" + std::to_string(s.port) + "/" + s.token + "/";
  s.thread = std::thread([&s] { s.server.listen_after_bind(); });
  while (!s.server.is_running()) std::this_thread::sleep_for(std::chrono::milliseconds(1));
}

LiveServer::~LiveServer() {
  Impl& s = *impl_;
  {
    std::unique_lock guard(s.lock);
    s.ending = true;
    for (const auto& message : s.waiting) message->answer.set_value("the run has ended");
    s.waiting.clear();
    s.news.notify_all();
    s.news.wait_for(guard, kRequestTime, [&] { return s.streams == 0; });  // stop() would cut off what tells them
  }
  s.server.stop();
  s.thread.join();
}

const std::string& LiveServer::address() const { return impl_->address; }

void LiveServer::Show(LiveEvent event, std::string text) {
  {
    const std::scoped_lock guard(impl_->lock);
    if (event == LiveEvent::kFrame) {
      impl_->Keep(std::move(text));
    } else {
      Impl::Event& shown = impl_->events[static_cast<size_t>(event)];
      shown.text = std::move(text);
      ++shown.count;
    }
  }
  impl_->news.notify_all();
}

void LiveServer::Serve(std::chrono::milliseconds wait, const std::function<void(const LiveCommand&)>& do_it) {
  std::deque<std::shared_ptr<Impl::Message>> messages;
  {
    std::unique_lock guard(impl_->lock);
    impl_->work.wait_for(guard, wait, [&] { return !impl_->waiting.empty(); });
    messages.swap(impl_->waiting);
  }
  for (const auto& message : messages) {
    std::string why;
    try {
      do_it(message->command);
    } catch (const std::invalid_argument& error) {
      why = error.what();
    }
    message->answer.set_value(why);
  }
}

}  // namespace islet
