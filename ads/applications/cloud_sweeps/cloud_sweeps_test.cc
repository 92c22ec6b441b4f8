#include "cloud_sweeps.h"

#include <array>
#include <cmath>
#include <cstring>
#include <limits>
#include <numbers>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

#include <fastcycle/testing.h>
#include <gmock/gmock.h>

namespace ads {
namespace {

using fastcycle::testing::Bench;
using foxglove::PackedElementField;
using ::testing::HasSubstr;
using ::testing::ThrowsMessage;
using std::chrono_literals::operator""ms;

constexpr std::int64_t kStamp_ns = 1'700'000'000'250'000'000;

struct LidarReturn {
  std::array<float, 3> place_m{};
  std::uint16_t time = 0;
  std::uint8_t ring = 0;
  std::uint8_t intensity = 0;
};
static_assert(sizeof(LidarReturn) == 16);

// Clouds field by field, as drivers have them.
class CloudMaker {
 public:
  CloudMaker& field(std::string_view name, PackedElementField::NumericType type) {
    auto& field = *cloud_.add_fields();
    field.set_name(std::string(name));
    field.set_type(type);
    field.set_offset(cloud_.point_stride());
    const std::size_t size = type == PackedElementField::FLOAT64  ? 8
                             : type == PackedElementField::UINT16 ? 2
                             : type == PackedElementField::UINT8  ? 1
                                                                  : 4;
    cloud_.set_point_stride(cloud_.point_stride() + static_cast<std::uint32_t>(size));
    return *this;
  }

  CloudMaker& places() {
    return field("x", PackedElementField::FLOAT32)
        .field("y", PackedElementField::FLOAT32)
        .field("z", PackedElementField::FLOAT32);
  }

  template <typename... Ts>
  CloudMaker& point(Ts... values) {
    (cloud_.mutable_data()->append(reinterpret_cast<const char*>(&values), sizeof values), ...);
    return *this;
  }

  foxglove::PointCloud done() {
    cloud_.mutable_timestamp()->set_seconds(kStamp_ns / 1'000'000'000);
    cloud_.mutable_timestamp()->set_nanos(static_cast<int>(kStamp_ns % 1'000'000'000));
    cloud_.set_frame_id("velodyne");
    return cloud_;
  }

 private:
  foxglove::PointCloud cloud_;
};

std::vector<LidarReturn> returns_of(const lidar::Sweep& sweep) {
  EXPECT_EQ(sweep.points().size(),
            std::size_t{sweep.columns()} * sweep.rings() * sizeof(LidarReturn));
  std::vector<LidarReturn> returns(sweep.points().size() / sizeof(LidarReturn));
  std::memcpy(returns.data(), sweep.points().data(), sweep.points().size());
  std::erase_if(returns, [](const LidarReturn& beam_return) {
    return beam_return.place_m == LidarReturn().place_m;
  });
  return returns;
}

lidar::Sweep read(const foxglove::PointCloud& cloud, const CloudConfig& config = {}) {
  lidar::Sweep sweep;
  read_cloud(cloud, config, sweep);
  return sweep;
}

TEST(CloudReader, PointsWithSecondsBeforeTheStampAreASweepThatEndsWithIt) {
  const auto cloud = CloudMaker()
                         .places()
                         .field("intensity", PackedElementField::FLOAT32)
                         .field("ring", PackedElementField::UINT16)
                         .field("time", PackedElementField::FLOAT32)
                         .point(1.0F, 2.0F, 3.0F, 100.0F, std::uint16_t{5}, -0.1F)
                         .point(4.0F, 5.0F, 6.0F, 300.0F, std::uint16_t{31}, -0.05F)
                         .point(7.0F, 8.0F, 9.0F, -1.0F, std::uint16_t{300}, 0.0F)
                         .done();

  const lidar::Sweep sweep = read(cloud);

  EXPECT_NEAR(static_cast<double>(sweep.header().taken_ns() - kStamp_ns), -1e8, 10.0);
  EXPECT_NEAR(static_cast<double>(sweep.duration_ns()), 1e8, 10.0);
  EXPECT_EQ(sweep.header().frame(), "velodyne");
  const auto returns = returns_of(sweep);
  ASSERT_EQ(returns.size(), 3U);
  EXPECT_EQ(returns[1].place_m, (std::array{4.0F, 5.0F, 6.0F}));
  EXPECT_EQ(returns[0].time, 0);
  EXPECT_NEAR(returns[1].time, 32768, 2);
  EXPECT_EQ(returns[2].time, 65535);
  EXPECT_EQ(returns[0].ring, 5);
  EXPECT_EQ(returns[2].ring, 255);
  EXPECT_EQ(returns[0].intensity, 100);
  EXPECT_EQ(returns[1].intensity, 255);
  EXPECT_EQ(returns[2].intensity, 0);
}

TEST(CloudReader, TimesAreUnderstoodAsDriversWriteThem) {
  const auto sweep_of = [](std::string_view name, PackedElementField::NumericType type, auto first,
                           auto second) {
    return read(CloudMaker()
                    .places()
                    .field(name, type)
                    .point(1.0F, 0.0F, 0.0F, first)
                    .point(2.0F, 0.0F, 0.0F, second)
                    .done());
  };
  const double utc_s = static_cast<double>(kStamp_ns) * 1e-9;
  const lidar::Sweep sweeps[] = {
      sweep_of("t", PackedElementField::UINT32, std::uint32_t{20'000'000},
               std::uint32_t{70'000'000}),
      sweep_of("offset_time", PackedElementField::UINT32, std::uint32_t{20'000'000},
               std::uint32_t{70'000'000}),
      sweep_of("timestamp", PackedElementField::FLOAT64, utc_s + 0.02, utc_s + 0.07),
      sweep_of("timestamp", PackedElementField::FLOAT64, utc_s * 1e9 + 2e7, utc_s * 1e9 + 7e7),
      sweep_of("time", PackedElementField::FLOAT64, 0.02, 0.07),
  };

  for (const lidar::Sweep& sweep : sweeps) {
    EXPECT_NEAR(static_cast<double>(sweep.header().taken_ns() - kStamp_ns), 2e7, 1000.0);
    EXPECT_NEAR(static_cast<double>(sweep.duration_ns()), 5e7, 1000.0);
  }
}

TEST(CloudReader, SweepHasAsManyRingsAsTheSensor) {
  CloudMaker with_rings = CloudMaker().places().field("ring", PackedElementField::UINT8);
  for (int point = 0; point < 40; ++point) {
    with_rings.point(10.0F, 0.1F * static_cast<float>(point), 0.0F,
                     static_cast<std::uint8_t>(point % 16));
  }
  const lidar::Sweep sweep = read(with_rings.done());
  EXPECT_EQ(sweep.rings(), 16U);
  EXPECT_EQ(sweep.columns(), 3U);
  EXPECT_EQ(returns_of(sweep).size(), 40U);

  EXPECT_EQ(read(CloudMaker().places().point(1.0F, 0.0F, 0.0F).done()).rings(), 64U);
}

TEST(CloudReader, WhatIsNoReturnIsLeftOut) {
  const float nan = std::numeric_limits<float>::quiet_NaN();
  const auto cloud = CloudMaker()
                         .places()
                         .point(nan, 0.0F, 0.0F)
                         .point(0.0F, 0.0F, 0.0F)
                         .point(1.0F, 0.0F, 0.0F)
                         .done();

  EXPECT_EQ(returns_of(read(cloud)).size(), 1U);
}

TEST(CloudReader, PointsWithoutTimesAreOfOneMomentOrOfATurn) {
  const auto cloud = CloudMaker()
                         .places()
                         .point(-1.0F, -1e-6F, 0.0F)
                         .point(0.0F, -1.0F, 0.0F)
                         .point(1.0F, 0.0F, 0.0F)
                         .point(0.0F, 1.0F, 0.0F)
                         .done();

  const lidar::Sweep still = read(cloud);
  EXPECT_EQ(still.header().taken_ns() + still.duration_ns(), kStamp_ns);
  EXPECT_EQ(still.duration_ns(), 1);

  CloudConfig config;
  config.turn = Turn::kCounterClockwise;
  config.begin_rad = std::numbers::pi;
  const auto left = returns_of(read(cloud, config));
  EXPECT_NEAR(left[0].time, 0, 1);
  EXPECT_NEAR(left[1].time, 16384, 1);
  EXPECT_NEAR(left[2].time, 32768, 1);
  EXPECT_NEAR(left[3].time, 49152, 1);

  config.turn = Turn::kClockwise;
  config.is_stamp_at_end = true;
  const lidar::Sweep turned = read(cloud, config);
  EXPECT_EQ(turned.header().taken_ns() + turned.duration_ns(), kStamp_ns);
  EXPECT_NEAR(returns_of(turned)[1].time, 49152, 1);
}

TEST(CloudReader, CloudsThatAreNotWhatTheySayAreErrors) {
  const auto message = [](const char* text) {
    return ThrowsMessage<std::runtime_error>(HasSubstr(text));
  };
  auto cloud = CloudMaker().places().point(1.0F, 2.0F, 3.0F).done();
  cloud.mutable_data()->pop_back();
  EXPECT_THAT([&] { read(cloud); }, message("expected points of 12 bytes each, found 11 bytes"));

  cloud = CloudMaker().places().point(1.0F, 2.0F, 3.0F).done();
  cloud.mutable_fields(2)->set_offset(9);
  EXPECT_THAT([&] { read(cloud); }, message("field \"z\": expected within the 12 bytes"));
  cloud.mutable_fields(2)->set_offset(0xFFFFFFFF);
  EXPECT_THAT([&] { read(cloud); }, message("found 4 bytes at 4294967295"));
  cloud.mutable_fields(2)->set_offset(8);
  cloud.mutable_fields(2)->set_type(PackedElementField::INT32);
  EXPECT_THAT([&] { read(cloud); },
              message("field \"z\": expected FLOAT32 or FLOAT64, found INT32"));
  cloud.mutable_fields(2)->set_name("height");
  EXPECT_THAT([&] { read(cloud); }, message("expected a field \"z\", found none"));
  EXPECT_THAT([] { read(foxglove::PointCloud()); }, message("expected points of 0 bytes"));

  const auto far = CloudMaker()
                       .places()
                       .field("t", PackedElementField::UINT32)
                       .point(1.0F, 2.0F, 3.0F, std::uint32_t{0})
                       .point(1.0F, 2.0F, 3.0F, std::uint32_t{2'000'000'000})
                       .done();
  EXPECT_THAT([&] { read(far); }, message("expected times of points within 1 s"));
  CloudConfig config;
  config.time_field = "when";
  EXPECT_THAT([&] { read(far, config); }, message("expected a field \"when\""));
}

TEST(CloudSweeps, CloudsOfASensorThatIsMountedTurnedAreSweepsOfTheVehicle) {
  Bench bench;
  bench.add<CloudSweeps>(
      "cloud_sweeps",
      R"({"params": {"mount_height_m": 1.7, "mount_forward_m": 0.5, "mount_yaw_rad": 1.5707963}})");
  auto clouds = bench.input<foxglove::PointCloud>("points");
  auto sweeps = bench.output<lidar::Sweep>("lidar/points");
  bench.start();

  clouds.publish(CloudMaker().places().point(1.0F, 0.0F, 3.0F).done());
  bench.advance(1ms);

  const auto made = sweeps.take();
  ASSERT_EQ(made.size(), 1U);
  EXPECT_EQ(made[0].mount_height_m(), 1.7);
  EXPECT_EQ(made[0].mount_forward_m(), 0.5);
  const auto returns = returns_of(made[0]);
  ASSERT_EQ(returns.size(), 1U);
  EXPECT_NEAR(returns[0].place_m[0], 0.0, 1e-6);
  EXPECT_NEAR(returns[0].place_m[1], 1.0, 1e-6);
  EXPECT_NEAR(returns[0].place_m[2], 3.0, 1e-6);
}

TEST(CloudSweeps, ACloudThatCannotBeReadIsSaidAndTheNextOneIsRead) {
  Bench bench;
  bench.add<CloudSweeps>("cloud_sweeps", R"({"params": {"mount_height_m": 1.7}})");
  auto clouds = bench.input<foxglove::PointCloud>("points");
  auto sweeps = bench.output<lidar::Sweep>("lidar/points");
  bench.start();

  clouds.publish(foxglove::PointCloud());
  bench.advance(1ms);
  EXPECT_TRUE(sweeps.take().empty());
  clouds.publish(CloudMaker().places().point(1.0F, 0.0F, 3.0F).done());
  bench.advance(1ms);
  EXPECT_EQ(sweeps.take().size(), 1U);
}

}  // namespace
}  // namespace ads
