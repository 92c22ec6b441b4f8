#include "supervision.h"

#include <chrono>
#include <string>
#include <variant>

#include <fastcycle/testing.h>
#include <gtest/gtest.h>

#include "can/frame.pb.h"
#include "gnss/fix.pb.h"
#include "motion/motion.pb.h"
#include "radar/tracks.pb.h"
#include "vehicle/motion.pb.h"

namespace rav4 {
namespace {

using fastcycle::testing::Bench;
using std::chrono_literals::operator""ms;

class SupervisionTest : public ::testing::Test {
 protected:
  SupervisionTest() {
    bench_.add<Supervision>("supervision", R"({"params": {"can": {"rate_min_hz": 50}}})");
  }

  // All streams at 100 Hz.
  void run(int milliseconds) {
    for (int elapsed = 0; elapsed < milliseconds; elapsed += 10) {
      publish(frames_);
      publish(fixes_);
      publish(turn_rates_);
      publish(wheels_);
      publish(tracks_);
      if (has_poses_) {
        publish(poses_);
      }
      bench_.advance(10ms);
    }
  }

  template <typename Message>
  void publish(Bench::Input<Message>& input) {
    Message message;
    message.mutable_header()->set_taken_ns(bench_.now().time_since_epoch().count());
    input.publish(message);
  }

  [[nodiscard]] supervision::Judgement judgement() {
    const auto statuses = statuses_.take();
    return statuses.empty() ? supervision::STARTING : statuses.back().judgement();
  }

  bool has_poses_ = true;
  Bench bench_;
  Bench::Input<can::Frame> frames_ = bench_.input<can::Frame>("can/frames");
  Bench::Input<gnss::Fix> fixes_ = bench_.input<gnss::Fix>("gnss/fix");
  Bench::Input<motion::Imu> turn_rates_ = bench_.input<motion::Imu>("imu/gyro");
  Bench::Input<vehicle::WheelSpeeds> wheels_ =
      bench_.input<vehicle::WheelSpeeds>("vehicle/wheel_speeds");
  Bench::Input<radar::Tracks> tracks_ = bench_.input<radar::Tracks>("radar/tracks");
  Bench::Input<localization::Pose> poses_ = bench_.input<localization::Pose>("localization/pose");
  Bench::Output<supervision::Status> statuses_ =
      bench_.output<supervision::Status>("supervision/status");
};

TEST_F(SupervisionTest, SystemWithAllStreamsIsReady) {
  bench_.start();
  bench_.advance(200ms);
  EXPECT_EQ(judgement(), supervision::STARTING);

  run(2'000);

  EXPECT_EQ(judgement(), supervision::READY);
}

TEST_F(SupervisionTest, SystemWithoutPosesIsDegradedThenLost) {
  bench_.start();
  run(2'000);
  has_poses_ = false;

  run(1'000);
  EXPECT_EQ(judgement(), supervision::DEGRADED);
  run(2'000);
  EXPECT_EQ(judgement(), supervision::LOST);
}

TEST_F(SupervisionTest, AtTheEndItReportsFramesAndJudgement) {
  bench_.start();
  run(1'000);
  bench_.stop();

  EXPECT_EQ(std::get<std::int64_t>(bench_.result("supervision", "frames")), 100);
  EXPECT_EQ(std::get<std::string>(bench_.result("supervision", "judgement")), "ready");
}

}  // namespace
}  // namespace rav4
