// A page and the frames of a live run over HTTP, to this machine alone; the only file of the program that sees cpp-httplib.
//
//   GET  /TOKEN/          the page
//   GET  /TOKEN/stream    server-sent events, see LiveEvent: the newest head and state and all frames that are kept for who comes, or those
//                         behind `Last-Event-ID` for who comes again; then what is new (what is slow to read skips some), at last `end`
//   POST /TOKEN/command   a message, see command.h: 204 done, 400 and why not, 503 too late
//
// What has no token, or names another host (a foreign page that was told this address is ours), gets 403. It listens at 127.0.0.1 alone.
// A request is one connection, and is answered or refused within a second, in a few ten kilobytes; only a message to a run that is in a
// long step waits for that. Of frames so many are kept as a page keeps (kMostFrames, kMostLetters); then every second one of the older
// half is forgotten.
//   threads: the server runs on its own; the functions below are for one thread, which owns the run
//   errors: std::runtime_error where the port cannot be had
#pragma once

#include <chrono>
#include <cstddef>
#include <functional>
#include <memory>
#include <string>

#include "scenes/live/command.h"

namespace islet {

// As src/live_source.js of the page has them.
inline constexpr size_t kMostFrames = 20'000, kMostLetters = 128'000'000;

// In the order in which a page has to hear of them.
enum class LiveEvent {
  kHead,   // `head`: the scene and its bodies
  kState,  // `state`: whether it runs, and what can be changed
  kFrame,  // `frame`: where the bodies are
};

class LiveServer {
 public:
  LiveServer(std::string page, int port);  // 0: any that is free
  ~LiveServer();                           // ends the streams
  LiveServer(const LiveServer&) = delete;
  LiveServer& operator=(const LiveServer&) = delete;

  const std::string& address() const;            // http://127.0.0.1:PORT/TOKEN/
  void Show(LiveEvent event, std::string text);  // one line

  // Does what messages ask, for so long or until there was one. do_it throws std::invalid_argument for what it refuses.
  void Serve(std::chrono::milliseconds wait, const std::function<void(const LiveCommand&)>& do_it);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

std::string HttplibVersion();

}  // namespace islet
