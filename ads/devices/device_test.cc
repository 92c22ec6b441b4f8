#include "device.h"

#include <atomic>
#include <cerrno>
#include <chrono>
#include <functional>
#include <string>
#include <system_error>
#include <thread>

#include <gtest/gtest.h>
#include <sys/socket.h>
#include <unistd.h>

#include "descriptor.h"

namespace ads {
namespace {

using namespace std::chrono_literals;

// One end of a pair of sockets; the test has the other one.
class SocketDevice final : public Device {
 public:
  [[nodiscard]] std::string name() const override { return "the device"; }

  int open() override {
    ++opened;
    if (opened <= failures) {
      throw std::system_error(ENODEV, std::generic_category(), name());
    }
    int ends[2];
    if (::socketpair(AF_UNIX, SOCK_SEQPACKET | SOCK_NONBLOCK | SOCK_CLOEXEC, 0, ends) < 0) {
      throw_errno("socketpair");
    }
    ours_ = Descriptor(ends[0]);
    theirs = ends[1];
    return ours_.get();
  }

  bool read() override {
    char byte = 0;
    const auto size = ::recv(ours_.get(), &byte, 1, 0);
    if (size < 0 && errno != EAGAIN) {
      throw_errno(name());
    }
    ++reads;
    return size > 0 && byte == 'y';
  }

  void close() noexcept override {
    ours_.reset();
    if (const int other = theirs.exchange(-1); other >= 0) {
      ::close(other);
    }
  }

  std::atomic<int> failures = 0;
  std::atomic<int> opened = 0;
  std::atomic<int> reads = 0;
  std::atomic<int> theirs = -1;

 private:
  Descriptor ours_;
};

void wait_until(const std::function<bool()>& holds) {
  const auto limit = std::chrono::steady_clock::now() + 60s;
  while (!holds() && std::chrono::steady_clock::now() < limit) {
    std::this_thread::sleep_for(1ms);
  }
  EXPECT_TRUE(holds());
}

class DeviceTest : public ::testing::Test {
 protected:
  void serve(double silence_s) {
    const DeviceConfig config{.retry_first_s = 0.001, .retry_max_s = 0.002, .silence_s = silence_s};
    thread_ = std::jthread([this, config](const std::stop_token& stop) {
      serve_device(device_, config, trouble_, stop);
    });
  }

  SocketDevice device_;
  DeviceTrouble trouble_;
  std::jthread thread_;
};

TEST_F(DeviceTest, IsOpenedAgainUntilItIsThere) {
  device_.failures = 3;
  serve(60.0);

  wait_until([this] { return device_.theirs >= 0; });

  EXPECT_EQ(device_.opened, 4);
  EXPECT_EQ(trouble_.get(), "the device: No such device");
  EXPECT_EQ(::send(device_.theirs, "y", 1, 0), 1);
  wait_until([this] { return trouble_.get().empty(); });
}

TEST_F(DeviceTest, ThatIsClosedByTheOtherSideIsLostAndTriedAgain) {
  serve(60.0);
  wait_until([this] { return device_.theirs >= 0; });

  ::close(device_.theirs.exchange(-1));

  wait_until([this] { return device_.opened >= 2 && device_.theirs >= 0; });
  EXPECT_EQ(trouble_.get(), "the device: Input/output error");
}

TEST_F(DeviceTest, ThatSaysNothingUsableIsReported) {
  serve(0.01);
  wait_until([this] { return device_.theirs >= 0; });

  EXPECT_EQ(::send(device_.theirs, "n", 1, 0), 1);

  wait_until([this] { return trouble_.get() == "the device: nothing usable has come for 0.01 s"; });
  EXPECT_EQ(device_.opened, 1);
}

TEST_F(DeviceTest, WaitingEndsWhenItIsAskedTo) {
  serve(3600.0);
  wait_until([this] { return device_.theirs >= 0; });

  thread_.request_stop();
  thread_.join();

  EXPECT_EQ(device_.reads, 0);
}

}  // namespace
}  // namespace ads
