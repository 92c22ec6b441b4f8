#include "camera.h"

#include <chrono>
#include <filesystem>
#include <stdexcept>
#include <string>
#include <thread>

#include <fastcycle/testing.h>
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "common/files.h"

namespace ads {
namespace {

using fastcycle::testing::Bench;
using namespace std::chrono_literals;
using ::testing::HasSubstr;

std::string refusal(const std::string& bytes) {
  try {
    (void)read_netpbm(bytes, "picture");
  } catch (const std::runtime_error& error) {
    return error.what();
  }
  return {};
}

TEST(Netpbm, GreyAndColoursAreRead) {
  const Image grey = read_netpbm("P5\n# by hand\n3 2\n255\nabcdef", "grey");
  const Image color = read_netpbm("P6 1 2 255 rgbRGB", "color");
  const Image wide = read_netpbm("P5 1 1 65535 AB", "wide");

  EXPECT_EQ(grey.encoding, "mono8");
  EXPECT_EQ(grey.width, 3U);
  EXPECT_EQ(grey.height, 2U);
  EXPECT_EQ(grey.data, "abcdef");
  EXPECT_EQ(color.encoding, "rgb8");
  EXPECT_EQ(color.row_bytes, 3U);
  EXPECT_EQ(color.data, "rgbRGB");
  EXPECT_EQ(wide.encoding, "mono16");
  EXPECT_EQ(wide.data, "BA");
}

TEST(Netpbm, WhatIsNoneIsRefusedWithItsPlace) {
  EXPECT_EQ(refusal("P7 x"), "picture: byte 0: expected P5 or P6, found \"P7\"");
  EXPECT_THAT(refusal(""), HasSubstr("found \"\""));
  EXPECT_EQ(refusal("P5 x"), "picture: byte 3: expected the width, 1 to 65535, found \"x\"");
  EXPECT_THAT(refusal("P5 -1 2 255 "), HasSubstr("expected the width"));
  EXPECT_THAT(refusal("P5 2 0 255 "), HasSubstr("expected the height"));
  EXPECT_EQ(refusal("P5 3 2 255 abc"),
            "picture: byte 11: expected 6 bytes of 3 x 2 pixels, found 3");
  EXPECT_THAT(refusal("P5 3 2 255"), HasSubstr("found 0"));
  EXPECT_THAT(refusal("P5 60000 60000 255 "), HasSubstr("at most 64000000 pixels"));
  EXPECT_THAT(refusal("P6 1 1 65535 abcdef"), HasSubstr("colours of one byte"));
}

class FolderTest : public ::testing::Test {
 protected:
  FolderTest() {
    std::filesystem::remove_all(folder_);
    std::filesystem::create_directories(folder_);
  }
  ~FolderTest() override { std::filesystem::remove_all(folder_); }

  [[nodiscard]] std::string config() const {
    return fmt::format(R"({{"params": {{"folder": "{}"}}}})", folder_.string());
  }

  std::filesystem::path folder_ =
      std::filesystem::path(::testing::TempDir()) /
      (std::string("camera_") + ::testing::UnitTest::GetInstance()->current_test_info()->name());
  Bench bench_;
};

TEST_F(FolderTest, PicturesComeAtTheirTimes) {
  // The later one is the shorter name.
  write_file(folder_ / "1000000000.ppm", "P6 1 1 255 rgb");
  write_file(folder_ / "950000000.pgm", "P5 1 1 255 a");
  bench_.add<Camera>("camera", config());
  auto images = bench_.output<foxglove::RawImage>("camera/image");
  bench_.start();
  bench_.advance(40ms);
  const auto first = images.take();
  bench_.advance(20ms);
  const auto second = images.take();

  ASSERT_EQ(first.size(), 1U);
  EXPECT_EQ(first[0].encoding(), "mono8");
  EXPECT_EQ(first[0].data(), "a");
  EXPECT_EQ(first[0].frame_id(), "camera");
  ASSERT_EQ(second.size(), 1U);
  EXPECT_EQ(second[0].encoding(), "rgb8");
  EXPECT_EQ(second[0].step(), 3U);
  const auto nanoseconds = [](const foxglove::RawImage& image) {
    return image.timestamp().seconds() * 1'000'000'000LL + image.timestamp().nanos();
  };
  EXPECT_EQ(nanoseconds(second[0]) - nanoseconds(first[0]), 50'000'000);
}

TEST_F(FolderTest, WithoutPicturesIsRefused) {
  bench_.add<Camera>("camera", config());
  bench_.start();

  EXPECT_THAT(bench_.faults("camera").at(0),
              HasSubstr("expected files *.pgm or *.ppm, found none"));
}

TEST_F(FolderTest, APictureWithoutATimeIsRefused) {
  write_file(folder_ / "first.pgm", "P5 1 1 255 a");
  bench_.add<Camera>("camera", config());
  bench_.start();

  EXPECT_THAT(bench_.faults("camera").at(0),
              HasSubstr("first.pgm: expected a name that is its time"));
}

TEST(V4l2, ACameraThatIsNotThereIsNoFault) {
  Bench bench;
  bench.add<Camera>("camera",
                    R"({"params": {"device": "/dev/no_such_camera", "retry_first_s": 0.001}})");
  bench.start();
  bench.advance(200ms);
  std::this_thread::sleep_for(20ms);
  bench.advance(200ms);
  bench.stop();

  EXPECT_TRUE(bench.faults("camera").empty());
  EXPECT_EQ(std::get<std::int64_t>(bench.result("camera", "pictures")), 0);
}

TEST(V4l2, WhatIsNoCameraIsALoss) {
  V4l2Device device({.path = "/dev/null"}, [](const V4l2Frame&) {});

  EXPECT_THROW(device.open(), std::system_error);
}

TEST(V4l2, PicturesComeFromACamera) {
  if (!std::filesystem::exists("/dev/video0")) {
    GTEST_SKIP() << "there is no /dev/video0";
  }
  Bench bench;
  bench.add<Camera>("camera");
  auto images = bench.output<foxglove::RawImage>("camera/image");
  bench.start();
  const auto limit = std::chrono::steady_clock::now() + 60s;
  std::vector<foxglove::RawImage> received;
  while (received.empty() && std::chrono::steady_clock::now() < limit) {
    bench.advance(10ms);
    received = images.take();
    std::this_thread::sleep_for(1ms);
  }

  ASSERT_FALSE(received.empty());
  EXPECT_EQ(received[0].data().size(), std::size_t{received[0].step()} * received[0].height());
}

}  // namespace
}  // namespace ads
