#include "judge.h"

#include <gtest/gtest.h>

namespace rav4 {
namespace {

using std::chrono_literals::operator""ms;
using std::chrono_literals::operator""s;

constexpr fastcycle::Time kStart = fastcycle::kSimulatedStart;

// Two streams of 20 Hz, of which the first one is essential.
class System {
 public:
  System()
      : streams_(
            {StreamWatch(
                 {.name = "wheels", .rate_min_hz = 10.0, .age_max = 200ms, .is_essential = true}),
             StreamWatch({.name = "radar", .rate_min_hz = 10.0, .age_max = 200ms})}) {}

  bool has_wheels = true;
  bool has_radar = true;
  fastcycle::Duration radar_period = 50ms;
  std::optional<double> stddev_m = 1.0;

  void go_on(fastcycle::Duration duration) {
    const fastcycle::Time end = now_ + duration;
    for (; now_ < end; now_ += 50ms) {
      if (has_wheels) {
        streams_[0].on_message(now_);
      }
      if (has_radar && (now_ - kStart) % radar_period == 0ms) {
        streams_[1].on_message(now_);
      }
      if ((now_ - kStart) % StreamWatch::kSlot == 0ms) {
        streams_[0].next_slot();
        streams_[1].next_slot();
      }
    }
  }

  [[nodiscard]] Judgement judged() const { return judge(streams_, stddev_m, {}, now_); }

 private:
  fastcycle::Time now_ = kStart;
  std::vector<StreamWatch> streams_;
};

TEST(Judge, NothingSeenIsStarting) {
  System system;
  system.stddev_m = std::nullopt;

  EXPECT_EQ(system.judged().verdict, Verdict::kStarting);
}

TEST(Judge, StreamsInTimeAreReady) {
  System system;
  system.go_on(3s);

  EXPECT_EQ(system.judged().verdict, Verdict::kReady);
  EXPECT_EQ(system.judged().reason, "");
}

TEST(Judge, MissingRadarIsDegraded) {
  System system;
  system.has_radar = false;
  system.go_on(3s);

  EXPECT_EQ(system.judged().verdict, Verdict::kDegraded);
  EXPECT_EQ(system.judged().reason, "no radar yet");
}

TEST(Judge, SlowRadarIsDegraded) {
  System system;
  system.radar_period = 150ms;
  system.go_on(3s);

  EXPECT_EQ(system.judged().verdict, Verdict::kDegraded);
  EXPECT_EQ(system.judged().reason.substr(0, 8), "radar at");
}

TEST(Judge, EssentialStreamThatStopsIsDegradedThenLost) {
  System system;
  system.go_on(3s);
  system.has_wheels = false;

  system.go_on(1s);
  EXPECT_EQ(system.judged().verdict, Verdict::kDegraded);
  system.go_on(2s);
  EXPECT_EQ(system.judged().verdict, Verdict::kLost);
}

TEST(Judge, OtherStreamThatStopsIsNeverLost) {
  System system;
  system.go_on(3s);
  system.has_radar = false;
  system.go_on(30s);

  EXPECT_EQ(system.judged().verdict, Verdict::kDegraded);
}

TEST(Judge, UncertainPositionIsDegradedThenLost) {
  System system;
  system.go_on(3s);

  system.stddev_m = 6.0;
  EXPECT_EQ(system.judged().verdict, Verdict::kDegraded);
  system.stddev_m = 25.0;
  EXPECT_EQ(system.judged().verdict, Verdict::kLost);
}

}  // namespace
}  // namespace rav4
