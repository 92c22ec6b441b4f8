#include "distance_keeper.h"

#include <chrono>

#include <fastcycle/testing.h>
#include <gtest/gtest.h>

namespace {

using namespace std::chrono_literals;

example::Scan scan(double nearest_m) {
  example::Scan scan;
  scan.set_nearest_m(nearest_m);
  return scan;
}

TEST(DistanceKeeper, KeepsItsGap) {
  fastcycle::testing::Bench bench;
  bench.add<DistanceKeeper>("keeper", R"({"params": {"gap_s": 4}})");
  auto scans = bench.input<example::Scan>("scan");
  auto speeds = bench.output<example::Speed>("speed");
  bench.start();

  scans.publish(scan(40.0));

  EXPECT_EQ(speeds.take().at(0).mps(), 10.0);
}

TEST(DistanceKeeper, StopsWhenItIsBlind) {
  fastcycle::testing::Bench bench;
  bench.add<DistanceKeeper>("keeper");
  auto scans = bench.input<example::Scan>("scan");
  auto speeds = bench.output<example::Speed>("speed");
  bench.start();
  scans.publish(scan(40.0));
  EXPECT_EQ(speeds.take().at(0).mps(), 20.0);

  bench.advance(299ms);
  EXPECT_TRUE(speeds.take().empty());
  bench.advance(1ms);

  EXPECT_EQ(speeds.take().at(0).mps(), 0.0);
}

TEST(DistanceKeeper, RefusesAGapThatNobodyShouldKeep) {
  fastcycle::testing::Bench bench;
  bench.add<DistanceKeeper>("keeper", R"({"params": {"gap_s": 0.1}})");

  EXPECT_THROW(bench.start(), std::runtime_error);
}

}  // namespace
