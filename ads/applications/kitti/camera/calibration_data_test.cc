// What is drawn must lie where it was seen: the returns in a labelled box, in the part of the
// picture that people have marked for the same object. The data are named by FASTCYCLE_DATA.

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <map>
#include <sstream>
#include <string>
#include <vector>

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include "applications/kitti/drive/calibration.h"
#include "applications/kitti/drive/frames.h"
#include "applications/kitti/drive/sweep_file.h"
#include "common/files.h"
#include "labels.h"

namespace kitti {
namespace {

/// Of each frame, in the order of the labels.
std::map<std::int64_t, std::vector<Eigen::AlignedBox2d>> boxes_in_picture(const std::string& text) {
  std::map<std::int64_t, std::vector<Eigen::AlignedBox2d>> boxes;
  std::istringstream lines(text);
  for (std::string line; std::getline(lines, line);) {
    std::istringstream words(line);
    std::int64_t frame = 0;
    std::string word;
    std::string kind;
    Eigen::Vector2d least;
    Eigen::Vector2d most;
    words >> frame >> word >> kind >> word >> word >> word >> least.x() >> least.y() >> most.x() >>
        most.y();
    if (kind != "DontCare" && words) {
      boxes[frame].emplace_back(least, most);
    }
  }
  return boxes;
}

bool is_inside(const Label& label, const Eigen::Vector3d& place_m) {
  const Eigen::Vector3d from_center =
      Eigen::AngleAxisd(-label.heading_rad, Eigen::Vector3d::UnitZ()) * (place_m - label.center_m);
  return std::abs(from_center.x()) < 0.5 * label.length_m &&
         std::abs(from_center.y()) < 0.5 * label.width_m &&
         std::abs(from_center.z()) < 0.5 * label.height_m;
}

TEST(ManyCalibrations, ReturnsInLabelledBoxesAreInTheirPartOfThePicture) {
  const char* const named = std::getenv("FASTCYCLE_DATA");
  const auto data =
      std::filesystem::path(named == nullptr ? "/nowhere" : named) / "kitti_0005_lidar_labels";
  if (!std::filesystem::is_directory(data / "velodyne")) {
    GTEST_SKIP() << "no " << data;
  }
  const Calibration calibration = Calibration::read(data / "calib.txt");
  const std::string text = ads::read_file(data / "label_02.txt");
  const auto labels = parse_labels(text, calibration, "label_02.txt");
  const auto boxes = boxes_in_picture(text);
  const Eigen::AlignedBox2d picture(Eigen::Vector2d(0.0, 0.0), Eigen::Vector2d(1242.0, 375.0));
  std::int64_t inside = 0;
  std::int64_t all = 0;
  for (const Frame& frame : list_frames(data / "velodyne", ".bin.xz")) {
    const auto labelled = labels.find(frame.number);
    if (labelled == labels.end() || frame.number % 6 != 0) {
      continue;
    }
    const std::vector<Label>& of_frame = labelled->second.labels;
    ASSERT_EQ(of_frame.size(), boxes.at(frame.number).size());
    for (const Point& point : read_sweep(frame.file)) {
      const Eigen::Vector3d place_m(point.x_m, point.y_m, point.z_m);
      const auto pixel = calibration.pixel_of(place_m);
      if (!pixel || !picture.contains(*pixel)) {
        continue;  // The marked part ends where the picture does.
      }
      for (std::size_t index = 0; index < of_frame.size(); ++index) {
        if (is_inside(of_frame[index], place_m)) {
          const Eigen::AlignedBox2d& box = boxes.at(frame.number)[index];
          const Eigen::Vector2d some_pixels(3.0, 3.0);
          inside +=
              Eigen::AlignedBox2d(box.min() - some_pixels, box.max() + some_pixels).contains(*pixel)
                  ? 1
                  : 0;
          ++all;
        }
      }
    }
  }
  EXPECT_GT(all, 1000);
  EXPECT_GT(static_cast<double>(inside), 0.99 * static_cast<double>(all));
}

}  // namespace
}  // namespace kitti
