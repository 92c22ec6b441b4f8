// The code of docs/guides/writing_a_driver.md.

#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <mutex>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "demo/speed.pb.h"
#include "fastcycle/fastcycle.h"
#include "fastcycle/testing.h"

namespace {

using namespace std::chrono_literals;

struct Reading {
  double mps = 0.0;
  std::chrono::steady_clock::time_point taken;
};

// A sensor that is gone after three readings.
class Device {
 public:
  explicit Device(const std::string& path) {
    if (path.empty()) {
      throw std::runtime_error("there is no device");
    }
  }

  // Blocks; nothing, once the device is closed.
  std::optional<Reading> read() {
    std::unique_lock lock(mutex_);
    if (read_ < 3) {
      return Reading{.mps = 1.0 * ++read_, .taken = std::chrono::steady_clock::now()};
    }
    closed_.wait(lock, [this] { return is_closed_; });
    return std::nullopt;
  }
  void close() {
    const std::lock_guard lock(mutex_);
    is_closed_ = true;
    closed_.notify_all();
  }

 private:
  std::mutex mutex_;
  std::condition_variable closed_;
  int read_ = 0;
  bool is_closed_ = false;
};

class SpeedSensor final : public fastcycle::Component {
 public:
  explicit SpeedSensor(fastcycle::Context& context)
      : Component(context),
        path_(context.param<std::string>("path", {.fallback = "/dev/ttyS0"})),
        speed_(context.create_external_publisher<demo::Speed>("speed")) {
    context.create_thread("speed_sensor", [this](const std::stop_token& stop) { receive(stop); });
  }

  void start() override {
    device_.emplace(path_.get());
    steady_to_ours_ =
        now().time_since_epoch() - std::chrono::steady_clock::now().time_since_epoch();
  }
  void stop() override { device_->close(); }

 private:
  void receive(const std::stop_token& stop) {
    while (!stop.stop_requested()) {
      const auto reading = device_->read();
      if (!reading) {
        return;
      }
      auto speed = speed_.loan();
      speed->set_mps(reading->mps);
      const auto taken = fastcycle::Time(reading->taken.time_since_epoch() + steady_to_ours_);
      speed_.publish(std::move(speed), taken);
    }
  }

  fastcycle::Param<std::string> path_;
  fastcycle::ExternalPublisher<demo::Speed> speed_;
  std::optional<Device> device_;
  fastcycle::Duration steady_to_ours_{};
};

TEST(ManyReadings, AThreadReadsItsDeviceUntilItIsClosed) {
  fastcycle::testing::Bench bench;
  bench.add<SpeedSensor>("sensor");
  auto speeds = bench.output<demo::Speed>("speed");
  bench.start();

  std::vector<demo::Speed> received;
  const auto limit = std::chrono::steady_clock::now() + 60s;
  while (received.size() < 3 && std::chrono::steady_clock::now() < limit) {
    bench.advance(1ms);
    for (demo::Speed& speed : speeds.take()) {
      received.push_back(std::move(speed));
    }
  }
  bench.stop();

  ASSERT_EQ(received.size(), 3U);
  EXPECT_EQ(received.back().mps(), 3.0);
}

TEST(TheGuideToDrivers, ADeviceThatIsNotThereIsAFault) {
  fastcycle::testing::Bench bench;
  bench.add<SpeedSensor>("sensor", R"({"params": {"path": ""}})");
  bench.start();

  EXPECT_THAT(bench.faults("sensor"),
              testing::ElementsAre(testing::HasSubstr("there is no device")));
}

// What can be asked without waiting.
struct Counter {
  int wheel_ticks() { return ticks += 7; }
  int ticks = 0;
};

class Odometer final : public fastcycle::Component {
 public:
  explicit Odometer(fastcycle::Context& context)
      : Component(context), speed_(context.create_publisher<demo::Speed>("speed")) {}

  void serve() override {
    const int ticks = observe("wheel_ticks", [this] { return counter_.wheel_ticks(); });
    auto speed = speed_.loan();
    speed->set_mps(0.1 * (ticks - last_ticks_));
    last_ticks_ = ticks;
    speed_.publish(std::move(speed), {.taken_at = now()});
  }

 private:
  fastcycle::Publisher<demo::Speed> speed_;
  Counter counter_;
  int last_ticks_ = 0;
};

struct Motor {
  void drive(double mps) { last_mps = mps; }
  double last_mps = -1.0;
};

class Drive final : public fastcycle::Component {
 public:
  explicit Drive(fastcycle::Context& context) : Component(context) {
    context.create_subscriber<demo::Speed>(
        "control/speed",
        {.depth = 1,
         .deadline = 200ms,
         .lifespan = 100ms,
         .on_event =
             [this](const fastcycle::QosEvent& event) {
               if (event.kind == fastcycle::QosKind::kDeadlineMissed) {
                 motor_.drive(0.0);
                 health(fastcycle::Health::kDegraded, "no commands");
               }
             }},
        [this](const demo::Speed& speed) { motor_.drive(speed.mps()); });
  }

  void deactivate() override { motor_.drive(0.0); }
  void stop() override { report("last_mps", motor_.last_mps); }

 private:
  Motor motor_;
};

TEST(TheGuideToDrivers, PollsAndDrives) {
  fastcycle::testing::Bench bench;
  bench.add<Odometer>("odometer", R"({"serve_period_ms": 50})");
  bench.add<Drive>("drive");
  auto speeds = bench.output<demo::Speed>("speed");
  auto commands = bench.input<demo::Speed>("control/speed");
  bench.start();

  demo::Speed command;
  command.set_mps(5.0);
  commands.publish(command);
  bench.advance(50ms);
  EXPECT_NEAR(speeds.take().at(0).mps(), 0.7, 1e-9);
  bench.stop();

  EXPECT_EQ(std::get<double>(bench.result("drive", "last_mps")), 0.0);
}

}  // namespace
