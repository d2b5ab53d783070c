// The server of a live run as a browser, and as somebody who has no business there, sees it.
#include "scenes/live/live_server.h"

#include <gtest/gtest.h>
#include <httplib.h>

#include <atomic>
#include <memory>
#include <stdexcept>
#include <string>
#include <thread>
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

TEST_F(LiveServerTest, StreamsTheNewest) {
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
  EXPECT_EQ(text,
            "event: head\ndata: HEAD 1\n\nevent: frame\ndata: FRAME 1\n\n"
            "event: frame\ndata: FRAME 2\n\nevent: state\ndata: STATE\n\n");
}

TEST(LiveServer, TellsItsEnd) {
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
  server->Show(LiveEvent::kFrame, "FRAME");
  while (!open) std::this_thread::sleep_for(milliseconds(1));
  server.reset();
  page.join();
  EXPECT_EQ(text, "event: frame\ndata: FRAME\n\nevent: end\ndata:\n\n");
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
