// The code of docs/guides/transforms.md.

#include "fastcycle/transforms.h"

#include <chrono>
#include <cmath>
#include <utility>
#include <variant>

#include <gtest/gtest.h>

#include "fastcycle/testing.h"
#include "localization/pose.pb.h"
#include "radar/tracks.pb.h"

namespace {

using fastcycle::transforms::from_roll_pitch_yaw;
using fastcycle::transforms::Pose;
using fastcycle::transforms::to_message;
using fastcycle::transforms::Transform;
using fastcycle::transforms::Vector;
using namespace std::chrono_literals;

// [snippet tracker]
class Tracker final : public fastcycle::Component {
 public:
  explicit Tracker(fastcycle::Context& context)
      : Component(context),
        tree_(context, {.moving = {{"localization/base", "map", "base_link"}}, .max_hold = 50ms}) {
    context.create_subscriber<radar::Tracks>(
        "radar/tracks", [this](const radar::Tracks& tracks) { on_tracks(tracks); });
  }

 private:
  void on_tracks(const radar::Tracks& tracks) {
    const fastcycle::Time time{fastcycle::Duration(tracks.header().taken_ns())};
    const auto radar_to_map = tree_.a_to_b("radar", "map", time);
    if (!radar_to_map) {
      log().warning("{}", radar_to_map.error().why);
      return;
    }
    for (const radar::Track& track : tracks.tracks()) {
      const auto in_map = *radar_to_map * Vector{track.forward_m(), track.left_m(), 0.0};
      report("east_m", in_map.x);
      report("north_m", in_map.y);
    }
  }

  fastcycle::transforms::Tree tree_;
};
// [end]

class Localization final : public fastcycle::Component {
 public:
  explicit Localization(fastcycle::Context& context)
      : Component(context),
        poses_(context.create_publisher<transform::Transform>("localization/base")) {}

  // [snippet moving]
  void serve() override {
    auto message = poses_.loan();
    const Transform base_to_map{{east_m_, north_m_, 0.0}, from_roll_pitch_yaw(0.0, 0.0, yaw_)};
    to_message("map", "base_link", {.taken = now(), .child_to_parent = base_to_map}, *message);
    poses_.publish(std::move(message));
  }
  // [end]

 private:
  double east_m_ = 100.0;
  double north_m_ = 50.0;
  double yaw_ = M_PI / 2;
  fastcycle::Publisher<transform::Transform> poses_;
};

// [snippet static]
class Calibration final : public fastcycle::Component {
 public:
  explicit Calibration(fastcycle::Context& context) : Component(context), frames_(context) {}

  void start() override {
    frames_.set("base_link", "radar", {{3.6, 0.0, 0.5}, {}});
    frames_.set("base_link", "camera", {{1.2, 0.0, 1.4}, from_roll_pitch_yaw(0.0, 0.1, 0.0)});
    frames_.publish();
  }

 private:
  fastcycle::transforms::StaticBroadcaster frames_;
};
// [end]

/// Reads poses that come as another message, and reports where the radar is.
class Converter final : public fastcycle::Component {
 public:
  explicit Converter(fastcycle::Context& context) : Component(context), tree_(context) {
    // [snippet convert]
    tree_.add<localization::Pose>(
        context, {"localization/pose", "map", "base_link"}, [](const localization::Pose& pose) {
          return Pose{.taken = fastcycle::Time(fastcycle::Duration(pose.header().taken_ns())),
                      .child_to_parent = {{pose.east_m(), pose.north_m(), 0.0},
                                          from_roll_pitch_yaw(0.0, 0.0, pose.yaw_rad())}};
        });
    // [end]
  }

  void serve() override {
    const auto radar_to_map = tree_.a_to_b("radar", "map");
    if (radar_to_map) {
      report("east_m", radar_to_map->translation.x);
      report("north_m", radar_to_map->translation.y);
    }
  }

 private:
  fastcycle::transforms::Tree tree_;
};

// [snippet topics]
constexpr const char* kTopics = R"(
{"topics": {"transforms/static": {"latched": 1, "multiple_publishers": true}}}
)";
// [end]

TEST(TheGuideOfTransforms, TakesTracksToTheMap) {
  fastcycle::testing::Bench bench;
  bench.configure(kTopics);
  bench.add<Calibration>("calibration");
  bench.add<Localization>("localization", R"({"serve_period_ms": 10})");
  bench.add<Tracker>("tracker");
  auto tracks = bench.input<radar::Tracks>("radar/tracks");
  bench.start();
  bench.advance(100ms);

  radar::Tracks seen;
  seen.mutable_header()->set_taken_ns(bench.now().time_since_epoch().count());
  radar::Track& track = *seen.add_tracks();
  track.set_forward_m(10.0);
  tracks.publish(seen);

  EXPECT_NEAR(std::get<double>(bench.result("tracker", "east_m")), 100.0, 1e-9);
  EXPECT_NEAR(std::get<double>(bench.result("tracker", "north_m")), 63.6, 1e-9);
}

TEST(TheGuideOfTransforms, ReadsPosesOfAnyMessage) {
  fastcycle::testing::Bench bench;
  bench.configure(kTopics);
  bench.add<Calibration>("calibration");
  bench.add<Converter>("converter", R"({"serve_period_ms": 10})");
  auto poses = bench.input<localization::Pose>("localization/pose");
  bench.start();

  localization::Pose pose;
  pose.mutable_header()->set_taken_ns(bench.now().time_since_epoch().count());
  pose.set_east_m(100.0);
  pose.set_north_m(50.0);
  pose.set_yaw_rad(M_PI / 2);
  poses.publish(pose);
  bench.advance(20ms);

  EXPECT_NEAR(std::get<double>(bench.result("converter", "east_m")), 100.0, 1e-9);
  EXPECT_NEAR(std::get<double>(bench.result("converter", "north_m")), 53.6, 1e-9);
}

}  // namespace
