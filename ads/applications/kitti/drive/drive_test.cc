#include <cstdint>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include <gtest/gtest.h>
#include <unistd.h>

#include "applications/kitti/drive/calibration.h"
#include "applications/kitti/drive/frames.h"
#include "applications/kitti/drive/small_drive.h"
#include "applications/kitti/drive/sweep_file.h"

namespace kitti {
namespace {

using testing::SmallDrive;

template <typename Read>
std::string error_of(const Read& read) {
  try {
    read();
  } catch (const std::exception& error) {
    return error.what();
  }
  return "";
}

TEST(SweepFile, PointsAreThoseThatWerePacked) {
  const SmallDrive drive("sweep");
  const auto file = drive.sweep(7, {{1.0F, -2.0F, 3.0F, 0.5F}, {4.0F, 5.0F, 6.0F, 0.0F}});
  const std::vector<Point> points = read_sweep(file);
  ASSERT_EQ(points.size(), 2U);
  EXPECT_EQ(points[0].y_m, -2.0F);
  EXPECT_EQ(points[0].reflectance, 0.5F);
  EXPECT_EQ(points[1].z_m, 6.0F);
}

TEST(SweepFile, FileThatEndsEarlyIsNamedWithItsEnd) {
  const SmallDrive drive("short");
  const auto file = drive.sweep(7, {{1.0F, 2.0F, 3.0F, 0.0F}});
  const auto size = std::filesystem::file_size(file) - 9;
  std::filesystem::resize_file(file, size);
  const std::string error = error_of([&] { (void)read_sweep(file); });
  EXPECT_NE(error.find(file.string() + ": byte " + std::to_string(size)), std::string::npos)
      << error;
  EXPECT_NE(error.find("the end of the file"), std::string::npos) << error;
}

TEST(SweepFile, WhatIsNoXzFileIsRefused) {
  const SmallDrive drive("no_xz");
  const auto file = drive.write("velodyne/0000000001.bin.xz", "these are no points at all");
  EXPECT_NE(error_of([&] { (void)read_sweep(file); }).find("expected xz data, found no xz file"),
            std::string::npos);
}

TEST(SweepFile, EveryDamagedByteIsNoticedOrHarmless) {
  const SmallDrive drive("damaged");
  const auto file = drive.sweep(1, std::vector<Point>(50, Point{1.0F, 2.0F, 3.0F, 0.5F}));
  std::ifstream stream(file, std::ios::binary);
  const std::string packed((std::istreambuf_iterator<char>(stream)), {});
  for (std::size_t at = 0; at < packed.size(); ++at) {
    std::string damaged = packed;
    damaged[at] = static_cast<char>(damaged[at] ^ 0x55);
    drive.write("velodyne/0000000001.bin.xz", damaged);
    EXPECT_NE(error_of([&] { (void)read_sweep(file); }), "") << "byte " << at;
  }
}

TEST(SweepFile, HalfAPointIsNoPoint) {
  const SmallDrive drive("half");
  const auto file = drive.packed("velodyne/0000000001.bin.xz", std::string(24, 'x'));
  EXPECT_NE(error_of([&] {
              (void)read_sweep(file);
            }).find("expected points of 16 bytes each, found 24 bytes"),
            std::string::npos);
}

TEST(Frames, AreInTheOrderOfTheirNumbers) {
  const SmallDrive drive("frames");
  drive.write("velodyne/0000000012.bin.xz", "");
  drive.write("velodyne/0000000003.bin.xz", "");
  drive.write("velodyne/timestamps.txt", "");
  const auto frames = list_frames(drive.folder() / "velodyne", ".bin.xz");
  ASSERT_EQ(frames.size(), 2U);
  EXPECT_EQ(frames[0].number, 3);
  EXPECT_EQ(frames[1].number, 12);
}

TEST(Frames, WrongFolderOrNameIsNamed) {
  const SmallDrive drive("no_frames");
  EXPECT_NE(error_of([] { (void)list_frames("/no/such/drive", ".xz"); }).find("/no/such/drive"),
            std::string::npos);
  drive.write("velodyne/first.bin.xz", "");
  EXPECT_NE(error_of([&] {
              (void)list_frames(drive.folder() / "velodyne", ".bin.xz");
            }).find("first.bin.xz: expected a file named by the number"),
            std::string::npos);
  std::filesystem::remove(drive.folder() / "velodyne/first.bin.xz");
  EXPECT_NE(error_of([&] {
              (void)list_frames(drive.folder() / "velodyne", ".bin.xz");
            }).find("found none"),
            std::string::npos);
}

TEST(Calibration, PointAheadIsInTheMiddleOfThePicture) {
  const SmallDrive drive("calibration");
  const Calibration calibration = Calibration::read(drive.folder() / "calib.txt");
  const auto ahead = calibration.pixel_of({20.0, 0.0, 0.0});
  ASSERT_TRUE(ahead);
  EXPECT_NEAR(ahead->x(), 600.0, 1e-9);
  const auto left = calibration.pixel_of({20.0, 2.0, 0.0});
  ASSERT_TRUE(left);
  EXPECT_NEAR(left->x(), 530.0, 1e-9);
  EXPECT_FALSE(calibration.pixel_of({-5.0, 0.0, 0.0}));
  const Eigen::Vector3d place_m = calibration.from_camera({-2.0, 1.0, 20.0});
  EXPECT_TRUE(place_m.isApprox(Eigen::Vector3d(20.0, 2.0, -1.0), 1e-9)) << place_m.transpose();
}

TEST(Calibration, MissingAndWrongLinesAreNamed) {
  const SmallDrive drive("wrong_calibration");
  const auto error_with = [&](const std::string& text) {
    const auto file = drive.write("calib.txt", text);
    return error_of([&] { (void)Calibration::read(file); });
  };
  EXPECT_NE(error_with("").find("calib.txt: expected a line P2, found none"), std::string::npos);
  EXPECT_NE(
      error_with("P0: 1\nP2: 1 2 3\n").find("line 2: P2: expected 12 finite numbers, found 3"),
      std::string::npos);
  EXPECT_NE(error_with("P2: 1 0 0 0 0 1 0 0 0 0 1 0\nR0_rect: 0 0 0 0 0 0 0 0 0\n"
                       "Tr_velo_to_cam: 1 0 0 0 0 1 0 0 0 0 1 0\n")
                .find("expected rotations"),
            std::string::npos);
  EXPECT_NE(error_with("P2: 0 0 0 0 0 0 0 0 0 0 0 0\nR0_rect: 1 0 0 0 1 0 0 0 1\n"
                       "Tr_velo_to_cam: 1 0 0 0 0 1 0 0 0 0 1 0\n")
                .find("P2: expected a projection"),
            std::string::npos);
}

}  // namespace
}  // namespace kitti
