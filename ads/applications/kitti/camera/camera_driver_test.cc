#include "camera_driver.h"

#include <filesystem>

#include <fastcycle/testing.h>
#include <gmock/gmock.h>

#include "applications/kitti/camera/picture.h"
#include "applications/kitti/drive/small_drive.h"

namespace kitti {
namespace {

using fastcycle::testing::Bench;
using ::testing::HasSubstr;
using std::chrono_literals::operator""ms;

TEST(CameraDriver, PicturesComeInTheMiddleOfTheirTurn) {
  const testing::SmallDrive drive("camera_driver");
  drive.sweep(5, {{10.0F, 1.0F, 0.5F, 1.0F}});
  std::filesystem::create_directories(drive.folder() / "image_02");
  const std::string png = encode_png(Picture(4, 3));
  drive.write("image_02/0000000004.png", "is before the first sweep");
  drive.write("image_02/0000000005.png", png);
  drive.write("image_02/0000000007.png", png);
  Bench bench;
  bench.add<CameraDriver>("camera_driver", drive.configuration());
  auto images = bench.output<foxglove::CompressedImage>("camera/image");
  auto calibrations = bench.output<foxglove::CameraCalibration>("camera/calibration");
  auto transforms = bench.output<foxglove::FrameTransforms>("camera/transforms");
  bench.start();

  bench.advance(49ms);
  EXPECT_TRUE(images.take().empty());
  bench.advance(2ms);
  const auto first = images.take();
  bench.advance(200ms);
  const auto second = images.take();

  ASSERT_EQ(first.size(), 1U);
  ASSERT_EQ(second.size(), 1U);
  EXPECT_EQ(first[0].data(), png);
  EXPECT_EQ(first[0].format(), "png");
  EXPECT_EQ(second[0].timestamp().nanos() - first[0].timestamp().nanos(), 2 * kFrame_ns);
  const auto calibration = calibrations.take().at(0);
  EXPECT_EQ(calibration.width(), 4U);
  EXPECT_EQ(calibration.p_size(), 12);
  EXPECT_EQ(calibration.k(0), 700.0);
  const auto transform = transforms.take().at(0).transforms(0);
  EXPECT_EQ(transform.parent_frame_id(), "lidar");
  // The camera's z is ahead, its x to the right.
  EXPECT_NEAR(transform.rotation().w(), 0.5, 1e-9);
  EXPECT_NEAR(transform.rotation().x(), -0.5, 1e-9);
  EXPECT_NEAR(transform.rotation().y(), 0.5, 1e-9);
  EXPECT_NEAR(transform.rotation().z(), -0.5, 1e-9);
}

TEST(CameraDriver, WhatIsNoPictureIsNamed) {
  const testing::SmallDrive drive("camera_driver_bad");
  drive.sweep(5, {{10.0F, 1.0F, 0.5F, 1.0F}});
  std::filesystem::create_directories(drive.folder() / "image_02");
  drive.write("image_02/0000000005.png", "no picture");
  Bench bench;
  bench.add<CameraDriver>("camera_driver", drive.configuration());
  bench.start();
  bench.advance(60ms);

  const auto faults = bench.faults("camera_driver");

  ASSERT_EQ(faults.size(), 1U);
  EXPECT_THAT(faults[0], HasSubstr("0000000005.png: expected a PNG"));
}

}  // namespace
}  // namespace kitti
