// The code of docs/guides/synchronized_inputs.md.

#include <chrono>
#include <cmath>
#include <utility>
#include <variant>

#include <gtest/gtest.h>

#include "fastcycle/fastcycle.h"
#include "fastcycle/testing.h"
#include "localization/pose.pb.h"
#include "radar/tracks.pb.h"

namespace {

using namespace std::chrono_literals;

double to_ms(fastcycle::Duration duration) {
  return std::chrono::duration<double, std::milli>(duration).count();
}

// [snippet fusion]
class Fusion final : public fastcycle::Component {
 public:
  explicit Fusion(fastcycle::Context& context)
      : Component(context), fused_(context.create_publisher<radar::Tracks>("fused/tracks")) {
    context.create_synchronizer<radar::Tracks, localization::Pose>(
        {"radar/tracks", "localization/pose"},
        {.policy = fastcycle::SyncPolicy::kApproximate, .max_difference = 10ms},
        [this](const radar::Tracks& tracks, const localization::Pose& pose) {
          on_scan(tracks, pose);
        });
  }

 private:
  void on_scan(const radar::Tracks& tracks, const localization::Pose& pose) {
    auto fused = fused_.loan();
    fused->mutable_header()->set_frame("map");
    for (const radar::Track& track : tracks.tracks()) {
      auto& placed = *fused->add_tracks();
      placed.set_forward_m(pose.east_m() + track.forward_m() * std::cos(pose.yaw_rad()));
      placed.set_left_m(pose.north_m() + track.forward_m() * std::sin(pose.yaw_rad()));
    }
    fused_.publish(std::move(fused));
  }

  fastcycle::Publisher<radar::Tracks> fused_;
};
// [end]

class Three final : public fastcycle::Component {
 public:
  explicit Three(fastcycle::Context& context) : Component(context) {
    // [snippet samples]
    context.create_synchronizer<radar::Tracks, radar::Tracks, localization::Pose>(
        {"radar/left", "radar/right", "localization/pose"},
        {.policy = fastcycle::SyncPolicy::kApproximate, .max_difference = 20ms, .depth = 4},
        [this](const fastcycle::Sample<radar::Tracks>& left,
               const fastcycle::Sample<radar::Tracks>& right,
               const fastcycle::Sample<localization::Pose>&) {
          report("apart_ms", to_ms(left.info().origin.taken - right.info().origin.taken));
        });
    // [end]
  }
};

radar::Tracks one_track(double forward_m) {
  radar::Tracks tracks;
  tracks.add_tracks()->set_forward_m(forward_m);
  return tracks;
}

localization::Pose pose_at(double east_m) {
  localization::Pose pose;
  pose.set_east_m(east_m);
  return pose;
}

TEST(SynchronizedInputs, ScansMeetPoses) {
  // [snippet bench]
  fastcycle::testing::Bench bench;
  bench.add<Fusion>("fusion");
  auto tracks = bench.input<radar::Tracks>("radar/tracks");
  auto poses = bench.input<localization::Pose>("localization/pose");
  auto fused = bench.output<radar::Tracks>("fused/tracks");
  bench.start();

  tracks.publish(one_track(50.0));
  bench.advance(4ms);
  EXPECT_TRUE(fused.take().empty());
  poses.publish(pose_at(100.0));

  EXPECT_EQ(fused.take().at(0).tracks(0).forward_m(), 150.0);
  // [end]
}

TEST(SynchronizedInputs, ThreeTopicsMeet) {
  fastcycle::testing::Bench bench;
  bench.add<Three>("three");
  auto left = bench.input<radar::Tracks>("radar/left");
  auto right = bench.input<radar::Tracks>("radar/right");
  auto poses = bench.input<localization::Pose>("localization/pose");
  bench.start();

  right.publish(one_track(1.0));
  bench.advance(12ms);
  poses.publish(pose_at(1.0));
  left.publish(one_track(2.0));

  EXPECT_EQ(std::get<double>(bench.result("three", "apart_ms")), 12.0);
}

}  // namespace
