#include "rav4_visualization.h"

#include <fastcycle/testing.h>
#include <gtest/gtest.h>

namespace ads {
namespace {

using fastcycle::testing::Bench;

TEST(Rav4Visualization, FixEstimateAndRadarAreDrawn) {
  Bench bench;
  bench.add<Rav4Visualization>("visualization");
  auto fixes_in = bench.input<gnss::Fix>("gnss/fix");
  auto poses_in = bench.input<localization::Pose>("localization/pose");
  auto tracks_in = bench.input<radar::Tracks>("radar/tracks");
  auto fixes = bench.output<foxglove::LocationFix>("visualization/fix");
  auto estimates = bench.output<foxglove::LocationFix>("visualization/estimate");
  auto transforms = bench.output<foxglove::FrameTransforms>("visualization/transforms");
  auto radars = bench.output<foxglove::SceneUpdate>("visualization/radar");
  bench.start();
  gnss::Fix fix;
  fix.set_latitude_deg(37.72);
  localization::Pose pose;
  pose.mutable_header()->set_frame("local");
  pose.set_origin_latitude_deg(37.0);
  pose.set_origin_longitude_deg(-122.0);
  radar::Tracks tracks;
  tracks.mutable_header()->set_frame("radar");
  tracks.add_tracks()->set_forward_m(30.0);

  fixes_in.publish(fix);
  poses_in.publish(pose);
  tracks_in.publish(tracks);

  EXPECT_EQ(fixes.take().at(0).latitude(), 37.72);
  EXPECT_NEAR(estimates.take().at(0).longitude(), -122.0, 1e-9);
  const auto frames = transforms.take().at(0);
  EXPECT_EQ(frames.transforms(0).parent_frame_id(), "local");
  EXPECT_EQ(frames.transforms(0).child_frame_id(), frames.transforms(1).parent_frame_id());
  EXPECT_EQ(frames.transforms(1).child_frame_id(), "radar");
  EXPECT_EQ(radars.take().at(0).entities(0).cubes(0).pose().position().x(), 30.0);
}

}  // namespace
}  // namespace ads
