#include "camera_view.h"

#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <vector>

#include <fastcycle/testing.h>
#include <gtest/gtest.h>

#include "applications/kitti/drive/small_drive.h"

namespace kitti {
namespace {

using fastcycle::testing::Bench;

constexpr Rgb kRed = {200, 0, 0};
constexpr Rgb kBlue = {0, 0, 200};
constexpr std::int64_t kBegin_ns = 1'000'000'000;

/// Red on the left, blue on the right of the camera's axis, which is at 600, 180.
std::string two_colors() {
  Picture picture(1200, 360);
  for (int y = 0; y < picture.height; ++y) {
    for (int x = 0; x < picture.width; ++x) {
      picture.set(x, y, x < 600 ? kRed : kBlue);
    }
  }
  return encode_png(picture);
}

struct LidarReturn {
  float place_m[3];
  std::uint16_t time = 32768;
  std::uint8_t ring = 0;
  std::uint8_t intensity = 0;
};

lidar::Sweep sweep(const std::vector<LidarReturn>& returns) {
  lidar::Sweep sweep;
  sweep.mutable_header()->set_taken_ns(kBegin_ns);
  sweep.mutable_header()->set_frame("lidar");
  sweep.set_duration_ns(100'000'000);
  sweep.set_points(std::string(reinterpret_cast<const char*>(returns.data()),
                               returns.size() * sizeof(LidarReturn)));
  return sweep;
}

class CameraViewTest : public ::testing::Test {
 protected:
  void SetUp() override {
    file_ = drive_.folder() / "boxes.png";
    bench_.add<CameraView>("camera_view", R"({"params": {"data": ")" + drive_.folder().string() +
                                              R"(", "picture": ")" + file_.string() +
                                              R"(", "mount_forward_m": 0}})");
    bench_.start();
  }

  void look(std::int64_t time_ns, const std::string& png) {
    foxglove::CompressedImage image;
    image.mutable_timestamp()->set_seconds(time_ns / 1'000'000'000);
    image.mutable_timestamp()->set_nanos(static_cast<std::int32_t>(time_ns % 1'000'000'000));
    image.set_data(png);
    images_.publish(image);
  }

  const testing::SmallDrive drive_{"camera_view"};
  std::filesystem::path file_;
  Bench bench_;
  Bench::Input<foxglove::CompressedImage> images_ =
      bench_.input<foxglove::CompressedImage>("camera/image");
  Bench::Input<lidar::Sweep> sweeps_ = bench_.input<lidar::Sweep>("lidar/points");
  Bench::Input<localization::Ego> egos_ = bench_.input<localization::Ego>("localization/ego");
  Bench::Input<perception::Objects> objects_ =
      bench_.input<perception::Objects>("perception/objects");
  Bench::Output<foxglove::PointCloud> clouds_ =
      bench_.output<foxglove::PointCloud>("camera/points");
  Bench::Output<foxglove::RawImage> drawn_ = bench_.output<foxglove::RawImage>("camera/boxes");
};

TEST_F(CameraViewTest, ReturnsHaveTheColorsOfThePicture) {
  look(kBegin_ns + 50'000'000, two_colors());

  sweeps_.publish(sweep({{{10.0F, 2.0F, 0.0F}},
                         {{10.0F, -2.0F, 0.0F}},
                         {{-10.0F, 2.0F, 0.0F}},
                         {{1.0F, 9.0F, 0.0F}},
                         {{0.0F, 0.0F, 0.0F}}}));

  const auto clouds = clouds_.take();
  ASSERT_EQ(clouds.size(), 1U);
  const std::string& data = clouds[0].data();
  ASSERT_EQ(data.size(), 2U * clouds[0].point_stride())
      << "behind, beside and nothing are left out";
  Rgb color;
  std::memcpy(color.data(), data.data() + clouds[0].fields(3).offset(), 3);
  EXPECT_EQ(color, kRed) << "to the left";
  std::memcpy(color.data(), data.data() + 16 + clouds[0].fields(3).offset(), 3);
  EXPECT_EQ(color, kBlue);
  EXPECT_EQ(clouds[0].timestamp().nanos(), 50'000'000);
}

TEST_F(CameraViewTest, SweepsWithoutAPictureAreCounted) {
  look(kBegin_ns - 50'000'000, two_colors());
  sweeps_.publish(sweep({{{10.0F, 2.0F, 0.0F}}}));
  look(kBegin_ns + 50'000'000, "no picture");
  sweeps_.publish(sweep({{{10.0F, 2.0F, 0.0F}}}));
  EXPECT_TRUE(clouds_.take().empty());
  bench_.stop();

  EXPECT_EQ(std::get<std::int64_t>(bench_.result("camera_view", "sweeps_without_picture")), 2);
  EXPECT_FALSE(std::filesystem::exists(file_));
}

TEST_F(CameraViewTest, BoxesAreDrawnWhereTheyWereThen) {
  look(kBegin_ns + 50'000'000, two_colors());
  sweeps_.publish(sweep({{{10.0F, 2.0F, 0.0F}}}));
  localization::Ego ego;  // It has moved by half a metre since then.
  ego.mutable_header()->set_taken_ns(kBegin_ns + 100'000'000);
  ego.set_x_m(100.5);
  ego.set_speed_mps(10.0);
  egos_.publish(ego);
  perception::Objects objects;
  objects.mutable_header()->set_taken_ns(kBegin_ns + 100'000'000);
  perception::Object& car = *objects.add_objects();
  car.set_object_class(perception::CAR);
  car.set_x_m(113.0);
  car.set_y_m(0.0);
  car.set_length_m(4.0);
  car.set_width_m(2.0);
  car.set_height_m(1.73);
  car.set_speed_mps(20.0);
  objects_.publish(objects);

  const auto drawn = drawn_.take();
  ASSERT_EQ(drawn.size(), 1U);
  EXPECT_EQ(drawn[0].step(), 3600U);
  const auto at = [&](int x, int y) {
    const std::size_t index = static_cast<std::size_t>(y) * 3600 + static_cast<std::size_t>(x) * 3;
    return Rgb{static_cast<std::uint8_t>(drawn[0].data()[index]),
               static_cast<std::uint8_t>(drawn[0].data()[index + 1]),
               static_cast<std::uint8_t>(drawn[0].data()[index + 2])};
  };
  // The camera was at x = 100, the car at 112: its rear at 10 m, a metre to each side, from the
  // height of the camera down to the ground.
  const Rgb orange = {255, 150, 20};
  EXPECT_EQ(at(600 + 70, 250), orange);
  EXPECT_EQ(at(600 - 70, 250), orange);
  EXPECT_EQ(at(650, 180), orange) << "its upper edge";
  EXPECT_EQ(at(650, 301), orange) << "its lower edge, 1.73 m below at 10 m";
  EXPECT_EQ(at(680, 250), kBlue);

  bench_.stop();
  std::ifstream stream(file_, std::ios::binary);
  const std::string png{std::istreambuf_iterator<char>(stream), {}};
  EXPECT_EQ(decode_png(png, "boxes.png").at(670, 250), orange);
}

TEST_F(CameraViewTest, BoxesAroundTheCameraAreCutOff) {
  look(kBegin_ns + 50'000'000, two_colors());
  sweeps_.publish(sweep({{{10.0F, 2.0F, 0.0F}}}));
  egos_.publish({});
  perception::Objects objects;
  objects.mutable_header()->set_taken_ns(kBegin_ns + 100'000'000);
  perception::Object& bus = *objects.add_objects();
  bus.set_length_m(12.0);
  bus.set_width_m(2.5);
  bus.set_height_m(3.0);
  objects_.publish(objects);

  EXPECT_EQ(drawn_.take().size(), 1U);
  EXPECT_TRUE(bench_.faults("camera_view").empty());
}

}  // namespace
}  // namespace kitti
