// The server of a live run as a browser, and as somebody who has no business there, sees it.
#include "scenes/live/live_server.h"

#include <gtest/gtest.h>
#include <httplib.h>

#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <fstream>
#include <memory>
#include <stdexcept>
#include <string>
#include <thread>
#include <tuple>
#include <vector>

namespace islet {
namespace {

using std::chrono::milliseconds;

// Serves from a thread of its own what the commands are.
class LiveServerTest : public ::testing::Test {
 protected:
  LiveServerTest() : server_("<p>page</p>", 0) {
    const std::string& address = server_.address();
    const size_t host = address.find("//") + 2, path = address.find('/', host);
    host_ = address.substr(host, path - host);
    path_ = address.substr(path);
    loop_ = std::thread([this] {
      while (!end_)
        server_.Serve(milliseconds(5), [this](const LiveCommand& command) {
          if (command.kind == LiveCommand::Kind::kRelease) throw std::invalid_argument("nothing is held");
          ++done_;
        });
    });
  }
  ~LiveServerTest() override {
    end_ = true;
    loop_.join();
  }
  httplib::Client Client() const {
    httplib::Client client("http://" + host_);
    client.set_read_timeout(5);
    return client;
  }

  LiveServer server_;
  std::string host_, path_;
  std::thread loop_;
  std::atomic<bool> end_ = false;
  std::atomic<int> done_ = 0;
};

TEST_F(LiveServerTest, ServesThePageToWhoHasTheAddress) {
  httplib::Client client = Client();
  const auto page = client.Get(path_);
  ASSERT_TRUE(page);
  EXPECT_EQ(page->status, 200);
  EXPECT_EQ(page->body, "<p>page</p>");
  EXPECT_EQ(client.Get(path_ + "other")->status, 404);
}

TEST_F(LiveServerTest, RefusesStrangers) {
  httplib::Client client = Client();
  for (const std::string path : {"/", "/stream", "/command", "/0123456789abcdef0123456789abcdef/", "//", "/../"})
    EXPECT_EQ(client.Get(path)->status, 403) << path;
  EXPECT_EQ(client.Post("/command", R"({"do": "run"})", "application/json")->status, 403);
  EXPECT_EQ(client.Get(path_, {{"Host", "example.org"}})->status, 403);
  EXPECT_EQ(client.Post(path_ + "command", {{"Host", "evil.test:80"}}, R"({"do": "run"})", "text/plain")->status, 403);
  EXPECT_EQ(done_, 0);
}

TEST_F(LiveServerTest, DoesWhatMessagesAskOrSaysWhyNot) {
  httplib::Client client = Client();
  const auto post = [&](const std::string& text) { return client.Post(path_ + "command", text, "application/json"); };
  EXPECT_EQ(post(R"({"do": "run"})")->status, 204);
  EXPECT_EQ(done_, 1);
  const auto refused = post(R"({"do": "release"})");
  EXPECT_EQ(refused->status, 400);
  EXPECT_EQ(refused->body, "nothing is held");
  const auto wrong = post(R"({"do": "friction", "value": -3})");
  EXPECT_EQ(wrong->status, 400);
  EXPECT_NE(wrong->body.find("got -3"), std::string::npos) << wrong->body;
  const auto start = std::chrono::steady_clock::now();
  EXPECT_EQ(post(std::string(1 << 20, '['))->status, 413);
  EXPECT_EQ(post(std::string(kLongestCommand, '['))->status, 400);
  EXPECT_LT(std::chrono::steady_clock::now() - start, std::chrono::seconds(5));
  EXPECT_EQ(done_, 1);
}

double MostMemory() {  // [MB] of this process so far
  std::ifstream status("/proc/self/status");
  std::string word;
  while (status >> word)
    if (word == "VmHWM:") break;
  double kilobytes = 0;
  status >> kilobytes;
  return kilobytes / 1e3;
}

// Sends a beginning, then the same piece again and again, to a port; returns the first line of the answer, or what came of it.
std::string Flood(const std::string& host, const std::string& beginning, const std::string& piece, size_t pieces) {
  const int socket = ::socket(AF_INET, SOCK_STREAM, 0);
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(static_cast<std::uint16_t>(std::stoi(host.substr(host.find(':') + 1))));
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  if (::connect(socket, reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0) return "no connection";
  ::send(socket, beginning.data(), beginning.size(), MSG_NOSIGNAL);
  for (size_t k = 0; k < pieces; ++k)
    if (::send(socket, piece.data(), piece.size(), MSG_NOSIGNAL) < 0) break;
  std::array<char, 200> answer;
  const ssize_t size = ::recv(socket, answer.data(), answer.size(), 0);
  ::close(socket);
  const std::string text(answer.data(), static_cast<size_t>(std::max<ssize_t>(size, 0)));
  return text.substr(0, text.find('\r'));
}

// A request without end, and one that claims what it does not send, are refused in a second and 100 MB.
TEST_F(LiveServerTest, RefusesWhatHasNoEnd) {
  const std::string start = "POST " + path_ + "command HTTP/1.1\r\nHost: " + host_ + "\r\n", piece(1 << 16, '[');
  const size_t endless = 3000;  // pieces: 200 MB
  const std::vector<std::tuple<std::string, size_t, std::string>> floods{
      {"GET /", endless, "HTTP/1.1 414"},
      {start + "X: ", endless, "HTTP/1.1 400"},
      {start + "Content-Length: 200000000\r\n\r\n", endless, "HTTP/1.1 413"},
      {start + "Content-Length: 200000000\r\n\r\n", 0, "HTTP/1.1 413"},
      {start + "Transfer-Encoding: chunked\r\n\r\n", endless, "HTTP/1.1 400"},
      {"POST /x HTTP/1.1\r\nContent-Length: 200000000\r\n\r\n", endless, "HTTP/1.1 403"},
      {"", endless, "HTTP/1.1 414"},
  };
  const double before = MostMemory();
  for (const auto& [beginning, pieces, wanted] : floods) {
    const auto begin = std::chrono::steady_clock::now();
    const std::string answer = Flood(host_, beginning, piece, pieces);
    EXPECT_LT(std::chrono::steady_clock::now() - begin, std::chrono::seconds(3)) << beginning;  // 1, on a busy machine
    // Who sends on after the refusal may find the connection gone before the answer is read.
    EXPECT_TRUE(answer.starts_with(wanted) || (answer.empty() && pieces > 0)) << beginning << answer;
  }
  EXPECT_LT(MostMemory() - before, 100);
  EXPECT_EQ(done_, 0);
  EXPECT_EQ(Client().Get(path_)->status, 200);
}

std::string FrameEvent(int id, const std::string& text) {
  return "id: " + std::to_string(id) + "\nevent: frame\ndata: " + text + "\n\n";
}

TEST_F(LiveServerTest, StreamsWhatWasThenTheNewest) {
  server_.Show(LiveEvent::kHead, "HEAD 1");
  server_.Show(LiveEvent::kFrame, "FRAME 0");
  server_.Show(LiveEvent::kFrame, "FRAME 1");
  httplib::Client client = Client();
  std::string text;
  client.Get(path_ + "stream", [&](const char* data, size_t size) {
    text.append(data, size);
    if (text.ends_with("FRAME 1\n\n")) server_.Show(LiveEvent::kFrame, "FRAME 2");
    if (text.ends_with("FRAME 2\n\n")) server_.Show(LiveEvent::kState, "STATE");
    return !text.ends_with("STATE\n\n");
  });
  EXPECT_EQ(text, "event: head\ndata: HEAD 1\n\n" + FrameEvent(1, "FRAME 0") + FrameEvent(2, "FRAME 1") +
                      FrameEvent(3, "FRAME 2") + "event: state\ndata: STATE\n\n");
}

TEST_F(LiveServerTest, WhoComesAgainGetsWhatWasMissed) {
  const auto stream = [&](const std::string& last_id) {
    httplib::Client client = Client();
    std::string text;
    client.Get(path_ + "stream", {{"Last-Event-ID", last_id}}, [&](const char* data, size_t size) {
      text.append(data, size);
      return !text.ends_with("\n\n");
    });
    return text;
  };
  std::string all;
  for (int i = 1; i <= 5; ++i) {
    server_.Show(LiveEvent::kFrame, "FRAME");
    all += FrameEvent(i, "FRAME");
  }
  EXPECT_EQ(stream("3"), FrameEvent(4, "FRAME") + FrameEvent(5, "FRAME"));
  EXPECT_EQ(stream("x"), all);
  EXPECT_EQ(stream("99999999999999999999999"), all);
  EXPECT_EQ(stream("18446744073709551615"), ": here\n\n");
}

// All of a run in bounded memory: what is long ago in larger steps.
TEST_F(LiveServerTest, KeepsTheRunInBoundedMemory) {
  const auto kept = [&] {
    httplib::Client client = Client();
    std::string text;
    client.Get(path_ + "stream", [&](const char* data, size_t size) {
      text.append(data, size);
      return !text.ends_with("\ndata: END\n\n");
    });
    std::vector<int> ids;
    for (size_t at = text.find("id: "); at != std::string::npos; at = text.find("\nid: ", at + 1))
      ids.push_back(std::stoi(text.substr(text.find(' ', at))));
    return ids;
  };
  for (size_t i = 1; i < 3 * kMostFrames; ++i) server_.Show(LiveEvent::kFrame, "FRAME");
  server_.Show(LiveEvent::kFrame, "END");
  std::vector<int> ids = kept();
  EXPECT_LE(ids.size(), kMostFrames);
  EXPECT_GT(ids.size(), kMostFrames / 2);
  EXPECT_EQ(ids.front(), 1);
  EXPECT_EQ(ids.back(), 3 * kMostFrames);
  for (size_t k = 1; k < ids.size(); ++k) {
    ASSERT_LT(ids[k - 1], ids[k]);
    if (k > ids.size() / 2) {
      EXPECT_EQ(ids[k], ids[k - 1] + 1);
    }
  }
  const std::string large(kMostLetters / 10, 'x');
  for (int i = 0; i < 30; ++i) server_.Show(LiveEvent::kFrame, large);
  server_.Show(LiveEvent::kFrame, "END");
  ids = kept();
  EXPECT_LE(ids.size(), 12u);
  EXPECT_GE(ids.size(), 5u);
}

// Also to who is in the middle of a frame.
TEST(LiveServer, TellsItsEnd) {
  for (int round = 0; round < 20; ++round) {
    auto server = std::make_unique<LiveServer>("", 0);
    const std::string address = server->address();
    const size_t path = address.find('/', address.find("//") + 2);
    std::atomic<bool> open = false;
    std::string text;
    std::thread page([&] {
      httplib::Client client(address.substr(0, path));
      client.Get(address.substr(path) + "stream", [&](const char* data, size_t size) {
        text.append(data, size);
        return open = true;
      });
    });
    server->Show(LiveEvent::kFrame, "FIRST");
    while (!open) std::this_thread::sleep_for(milliseconds(1));
    server->Show(LiveEvent::kFrame, std::string(1 << 20, 'x'));
    if (round % 2) std::this_thread::sleep_for(milliseconds(1));
    server.reset();
    page.join();
    EXPECT_TRUE(text.starts_with("id: 1\nevent: frame\ndata: FIRST\n\n"));
    EXPECT_TRUE(text.ends_with("x\n\nevent: end\ndata:\n\n"));
  }
}

TEST_F(LiveServerTest, APortThatIsTakenIsNamed) {
  const int port = std::stoi(host_.substr(host_.find(':') + 1));
  try {
    const LiveServer second("", port);
    ADD_FAILURE() << "two servers at one port";
  } catch (const std::runtime_error& error) {
    EXPECT_NE(std::string(error.what()).find(std::to_string(port)), std::string::npos) << error.what();
  }
}

}  // namespace
}  // namespace islet
