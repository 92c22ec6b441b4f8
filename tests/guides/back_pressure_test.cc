// The code of docs/guides/back_pressure.md.

#include <chrono>
#include <cstdint>
#include <stop_token>
#include <string>
#include <utility>
#include <variant>

#include <gtest/gtest.h>

#include "fastcycle/fastcycle.h"
#include "fastcycle/testing.h"
#include "localization/pose.pb.h"

namespace {

using namespace std::chrono_literals;

// [snippet callbacks]
class MapLoader final : public fastcycle::Component {
 public:
  explicit MapLoader(fastcycle::Context& context)
      : Component(context),
        tiles_(context.create_publisher<localization::Pose>(
            "map/tiles", {.credits = 8, .on_credits = [this] { send(); }})),
        source_(context.create_source()) {}

  void start() override { send(); }

 private:
  void send() {
    while (next_ < kTiles && tiles_.credits() > 0) {
      auto tile = tiles_.loan();
      tile->set_east_m(100.0 * next_++);
      tiles_.publish(std::move(tile));
    }
    if (next_ == kTiles) {
      source_.finish();
    }
  }

  static constexpr int kTiles = 1000;
  fastcycle::Publisher<localization::Pose> tiles_;
  fastcycle::Source source_;
  int next_ = 0;
};
// [end]

// [snippet threads]
class Reader final : public fastcycle::Component {
 public:
  explicit Reader(fastcycle::Context& context)
      : Component(context),
        fixes_(
            context.create_external_publisher<localization::Pose>("file/poses", {.credits = 16})),
        source_(context.create_source()) {
    context.create_thread("reader", [this](const std::stop_token& stop) {
      for (int i = 0; i < 100 && fixes_.wait_for_credit(stop); ++i) {
        auto fix = fixes_.loan();
        fix->set_north_m(i);
        fixes_.publish(std::move(fix), fastcycle::kSimulatedStart + i * 1ms);
      }
      source_.finish();
    });
  }

 private:
  fastcycle::ExternalPublisher<localization::Pose> fixes_;
  fastcycle::Source source_;
};
// [end]

/// Counts what comes on `topic`.
class Counter final : public fastcycle::Component {
 public:
  explicit Counter(fastcycle::Context& context) : Component(context) {
    context.create_subscriber<localization::Pose>(
        context.param<std::string>("topic").get(), {.depth = 16},
        [this](const localization::Pose&) { report("count", ++count_); });
  }

  void start() override { report("count", count_); }

 private:
  std::int64_t count_ = 0;
};

TEST(BackPressure, AMapArrivesWhole) {
  fastcycle::testing::Bench bench;
  bench.configure(R"({"topics": {"map/tiles": {"credits": 4}}})");
  bench.add<MapLoader>("loader");
  bench.add<Counter>("counter", R"({"params": {"topic": "map/tiles"}})");
  bench.start();

  EXPECT_EQ(std::get<std::int64_t>(bench.result("counter", "count")), 1000);
}

TEST(BackPressure, MessagesOfAThreadAreReceivedToTheEnd) {
  fastcycle::testing::Bench bench;
  bench.add<Reader>("reader");
  bench.add<Counter>("counter", R"({"params": {"topic": "file/poses"}})");
  bench.start();

  const auto count = [&] {
    bench.advance(1ms);
    return std::get<std::int64_t>(bench.result("counter", "count"));
  };
  const auto limit = std::chrono::steady_clock::now() + 60s;
  while (count() < 100 && std::chrono::steady_clock::now() < limit) {
  }
  EXPECT_EQ(count(), 100);
}

}  // namespace
