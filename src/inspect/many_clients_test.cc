// What hostile clients do to an application that runs: nothing.
#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <memory>
#include <random>
#include <string>
#include <string_view>
#include <thread>
#include <vector>

#include <google/protobuf/wrappers.pb.h>
#include <gtest/gtest.h>
#include <sys/socket.h>
#include <unistd.h>

#include "base/clock.h"
#include "fastcycle/fastcycle.h"
#include "fastcycle/version.h"
#include "host/test_application.h"
#include "inspect/address.h"
#include "inspect/client.h"
#include "inspect/frame.h"
#include "inspect/server.h"

namespace fastcycle::inspect {
namespace {

using namespace std::chrono_literals;
using google::protobuf::BytesValue;

std::atomic<std::int64_t> worst_ns{0};  ///< That a callback took, clocks included.

/// Publishes 1 kHz, and measures how long that takes.
class Ticker final : public Component {
 public:
  explicit Ticker(Context& context)
      : Component(context), blobs_(context.create_publisher<BytesValue>("blobs")) {}

  void serve() override {
    const std::int64_t begin_ns = base::monotonic_ns();
    auto blob = blobs_.loan();
    blob->mutable_value()->assign(10'000, 'x');
    blobs_.publish(std::move(blob));
    worst_ns.store(std::max(worst_ns.load(), base::monotonic_ns() - begin_ns));
  }

 private:
  Publisher<BytesValue> blobs_;
};

/// Publishes messages of 1 MB, 100 a second.
class Pump final : public Component {
 public:
  explicit Pump(Context& context)
      : Component(context), large_(context.create_publisher<BytesValue>("large")) {}

  void serve() override {
    auto blob = large_.loan();
    blob->mutable_value()->assign(1'000'000, 'x');
    large_.publish(std::move(blob));
  }

 private:
  Publisher<BytesValue> large_;
};

std::size_t count_of(const char* variable, std::size_t usual) {
  const char* given = std::getenv(variable);
  return given == nullptr ? usual : std::strtoull(given, nullptr, 10);
}

std::int64_t rss_kib() {
  long pages = 0;
  if (std::FILE* file = std::fopen("/proc/self/statm", "re")) {
    static_cast<void>(!std::fscanf(file, "%*d %ld", &pages));
    std::fclose(file);
  }
  return pages * (::sysconf(_SC_PAGESIZE) / 1024);
}

/// The address sanitizer keeps what was freed for a while, so it shows no bound.
void expect_grown_less(std::int64_t before_kib, std::int64_t kib) {
  if (std::string_view(FASTCYCLE_SANITIZER) != "address") {
    EXPECT_LT(rss_kib() - before_kib, kib);
  }
}

class ManyHostileClients : public testing::Test {
 protected:
  void SetUp() override {
    folder_ = std::filesystem::temp_directory_path() /
              ("fastcycle_hostile_" + std::to_string(::getpid()));
    std::filesystem::remove_all(folder_);
    classes_.with<Ticker>("ticker").with<Pump>("pump");
    config::Problems problems;
    application_ = std::make_unique<host::Application>(
        host::describe_text(R"({"name": "attacked", "components": [
          {"name": "ticker", "library": "ticker", "serve_period_ms": 1},
          {"name": "pump", "library": "pump", "serve_period_ms": 10}]})",
                            problems),
        host::ClockOptions{});
    config::InspectDescription allowed;
    allowed.allows_params = allowed.allows_publish = allowed.allows_lifecycle = true;
    server_ = std::make_unique<Server>(*application_, allowed, folder_);
    application_->add(*server_);
    application_->build(classes_, problems, host::ConstructorFault::kFault);
    ASSERT_FALSE(problems.has_errors());
    application_->start();
  }
  void TearDown() override {
    application_.reset();
    server_.reset();
    std::filesystem::remove_all(folder_);
  }

  [[nodiscard]] int connect() const {
    const int descriptor = ::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
    const sockaddr_un address = address_of(server_->file());
    EXPECT_EQ(::connect(descriptor, reinterpret_cast<const sockaddr*>(&address), sizeof(address)),
              0);
    return descriptor;
  }
  static bool send(int descriptor, const std::string& bytes) {
    return ::send(descriptor, bytes.data(), bytes.size(), MSG_NOSIGNAL) ==
           static_cast<ssize_t>(bytes.size());
  }
  static std::string frame_of(const std::string& body) {
    std::string bytes;
    append_size(bytes, body.size());
    return bytes + body;
  }
  static std::string hello() {
    protocol::Request request;
    request.set_id(1);
    request.mutable_hello()->set_version(kProtocolVersion);
    return frame_of(request.SerializeAsString());
  }
  /// Empties what was said to `descriptor`.
  static void drain(int descriptor) {
    std::string piece(65536, '\0');
    while (::recv(descriptor, piece.data(), piece.size(), MSG_DONTWAIT) > 0) {
    }
  }
  /// Somebody who means well is served, however busy the server was.
  void expect_alive() const {
    const auto end = std::chrono::steady_clock::now() + 60s;
    for (;;) {
      try {
        Client client(server_->file(), "test");
        protocol::Request request;
        request.mutable_overview();
        const protocol::Overview overview = client.ask(std::move(request), 60s).overview();
        EXPECT_EQ(overview.components(0).state(), "active");
        EXPECT_EQ(overview.components(0).faults(), 0U);
        return;
      } catch (const ClientError& error) {
        ASSERT_LT(std::chrono::steady_clock::now(), end) << error.what();
        std::this_thread::sleep_for(10ms);
      }
    }
  }
  static void print_count(const char* what, std::size_t count) {
    std::printf("%s: %zu, longest callback %.3f ms, %.1f MiB\n", what, count,
                static_cast<double>(worst_ns.exchange(0)) / 1e6,
                static_cast<double>(rss_kib()) / 1024);
  }

  std::filesystem::path folder_;
  host::TestClasses classes_;
  std::unique_ptr<Server> server_;
  std::unique_ptr<host::Application> application_;
};

TEST_F(ManyHostileClients, SayingRandomFramesChangeNothing) {
  const std::size_t frames = count_of("FASTCYCLE_INSPECT_FRAMES", 20'000);
  std::mt19937_64 random(23);
  protocol::Request valid;
  valid.set_id(7);
  valid.mutable_stream()->set_topic("blobs");
  const std::string pattern = valid.SerializeAsString();
  const std::int64_t before_kib = rss_kib();
  int descriptor = -1;
  for (std::size_t i = 0; i < frames; ++i) {
    if (descriptor < 0) {
      descriptor = connect();
      send(descriptor, hello());
    }
    std::string body;
    if (i % 2 == 0) {  // Nearly a request.
      body = pattern;
      body[random() % body.size()] = static_cast<char>(random());
    } else {
      body.resize(random() % 64);
      std::ranges::generate(body, [&] { return static_cast<char>(random()); });
    }
    if (!send(descriptor, frame_of(body))) {
      ::close(descriptor);  // As it should be.
      descriptor = -1;
    } else {
      drain(descriptor);
    }
  }
  ::close(descriptor);
  expect_alive();
  print_count("random frames", frames);
  expect_grown_less(before_kib, 256 * 1024);
}

TEST_F(ManyHostileClients, ThatNeverReadAreBounded) {
  const std::int64_t before_kib = rss_kib();
  std::vector<int> descriptors;
  protocol::Request stream;
  stream.set_id(2);
  stream.mutable_stream()->set_topic("blobs");
  stream.mutable_stream()->set_content(protocol::Stream::CONTENT_FULL);
  protocol::Request overview;
  overview.set_id(3);
  overview.mutable_overview();
  std::string asked;
  for (int i = 0; i < 1000; ++i) {
    asked += frame_of(overview.SerializeAsString());
  }
  for (int i = 0; i < 8; ++i) {
    descriptors.push_back(connect());
    send(descriptors.back(), hello() + frame_of(stream.SerializeAsString()));
    static_cast<void>(
        !::send(descriptors.back(), asked.data(), asked.size(), MSG_NOSIGNAL | MSG_DONTWAIT));
  }
  std::this_thread::sleep_for(300ms);  // 300 messages of 10 kB for each of them.
  expect_alive();
  print_count("who never reads", descriptors.size());
  expect_grown_less(before_kib, 512 * 1024);
  for (const int descriptor : descriptors) {
    ::close(descriptor);
  }
}

TEST_F(ManyHostileClients, ThatNeverReadAreBoundedTogether) {
  const std::int64_t before_kib = rss_kib();
  std::vector<int> descriptors;
  std::string asked = hello();
  for (std::uint32_t id = 2; id < 12; ++id) {
    protocol::Request stream;
    stream.set_id(id);
    stream.mutable_stream()->set_topic("large");
    stream.mutable_stream()->set_content(protocol::Stream::CONTENT_FULL);
    asked += frame_of(stream.SerializeAsString());
  }
  for (int i = 0; i < 30; ++i) {
    descriptors.push_back(connect());
    send(descriptors.back(), asked);
  }
  // Who reads goes on being served: the slowest make room.
  std::int64_t most_kib = 0;
  Client client(server_->file(), "test", 60s);
  const auto end = std::chrono::steady_clock::now() + 60s;
  for (std::uint64_t dropped = 0; dropped == 0 && std::chrono::steady_clock::now() < end;) {
    protocol::Request overview;
    overview.mutable_overview();
    dropped = client.ask(std::move(overview), 60s).overview().clients_dropped();
    most_kib = std::max(most_kib, rss_kib());
    std::this_thread::sleep_for(1ms);
  }
  protocol::Request request;
  request.mutable_stream()->set_topic("large");
  request.mutable_stream()->set_content(protocol::Stream::CONTENT_FULL);
  client.begin(std::move(request), 60s);
  bool is_served = false;
  while (!is_served && std::chrono::steady_clock::now() < end) {
    const auto answer = client.next(1s);
    is_served = answer && answer->messages().messages_size() > 0;
    most_kib = std::max(most_kib, rss_kib());
  }
  EXPECT_TRUE(is_served);
  print_count("who never reads, of large messages", descriptors.size());
  if (std::string_view(FASTCYCLE_SANITIZER) == "none") {  // Others keep memory of their own.
    EXPECT_LT(most_kib - before_kib, 400 * 1024);
  }
  for (const int descriptor : descriptors) {
    ::close(descriptor);
  }
}

TEST_F(ManyHostileClients, ThatComeAndGoLeaveNothing) {
  const std::size_t connects = count_of("FASTCYCLE_INSPECT_CONNECTS", 1000);
  for (std::size_t i = 0; i < connects; ++i) {
    const int descriptor = connect();
    if (i % 3 == 0) {
      send(descriptor, hello());
    } else if (i % 3 == 1) {
      send(descriptor, std::string("\x10\0\0\0half", 8));
    }
    ::close(descriptor);
  }
  expect_alive();
  print_count("connects", connects);
}

}  // namespace
}  // namespace fastcycle::inspect
