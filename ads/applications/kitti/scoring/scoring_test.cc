#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "applications/kitti/drive/calibration.h"
#include "applications/kitti/drive/small_drive.h"
#include "labels.h"
#include "score.h"

namespace kitti {
namespace {

Calibration calibration() {
  const testing::SmallDrive drive("scoring");
  return Calibration::read(drive.folder() / "calib.txt");
}

Label label(std::int64_t track, Kind kind, double x_m, double y_m) {
  return {.track = track, .kind = kind, .center_m = {x_m, y_m, 0.0}};
}

FoundBox box(std::uint64_t id, Kind kind, double x_m, double y_m) {
  return {.id = id, .kind = kind, .center_m = {x_m, y_m, 0.0}};
}

TEST(Labels, LineBecomesABoxInTheLidarsFrame) {
  const auto frames = parse_labels(
      "112 5 Van 0 1 -1.5 500 100 600 200 2.0 1.8 4.4 -3 1.5 20 -1.5707963\n"
      "112 -1 DontCare -1 -1 -10 1 2 3 4 -1000 -1000 -1000 -10 -1 -1 -1\n",
      calibration(), "labels");
  ASSERT_EQ(frames.at(112).labels.size(), 1U);
  const Label& its = frames.at(112).labels[0];
  EXPECT_EQ(its.track, 5);
  EXPECT_EQ(its.kind, Kind::kVehicle);
  EXPECT_NEAR(its.center_m.x(), 20.0, 1e-6);
  EXPECT_NEAR(its.center_m.y(), 3.0, 1e-6);
  EXPECT_NEAR(its.center_m.z(), -0.5, 1e-6);
  EXPECT_NEAR(its.heading_rad, 0.0, 1e-6);
  EXPECT_EQ(its.length_m, 4.4);
  ASSERT_EQ(frames.at(112).dont_care.size(), 1U);
  EXPECT_EQ(frames.at(112).dont_care[0].most.y(), 4.0);
}

TEST(Labels, ShortLineAndWordsInPlaceOfNumbersAreNamed) {
  for (const auto& [text, expected] : std::vector<std::pair<std::string, std::string>>{
           {"1 2 Car 0 0\n", "file: line 1: expected 17 words, found 5"},
           {"\nx 2 Car\n", "file: line 2: word 1: expected a number, found 'x'"},
           {"1 2 Car 0 nan\n", "file: line 1: word 5: expected a number, found 'nan'"}}) {
    try {
      (void)parse_labels(text, calibration(), "file");
      ADD_FAILURE() << text;
    } catch (const std::exception& error) {
      EXPECT_EQ(error.what(), expected);
    }
  }
}

TEST(Score, NearestBoxesMatchOneToOne) {
  Score score({}, calibration(), Kind::kVehicle);
  LabelledFrame frame;
  frame.labels = {label(1, Kind::kVehicle, 20.0, 0.0), label(2, Kind::kVehicle, 30.0, 0.0)};
  const std::vector<FoundBox> boxes{box(1, Kind::kVehicle, 21.0, 0.0),
                                    box(2, Kind::kVehicle, 20.5, 0.0),
                                    box(3, Kind::kVehicle, 32.5, 0.0)};
  const auto verdicts = score.add(frame, boxes);
  EXPECT_EQ(verdicts, (std::vector{Verdict::kFalse, Verdict::kRight, Verdict::kFalse}));
  EXPECT_DOUBLE_EQ(score.recall(), 0.5);
  EXPECT_DOUBLE_EQ(score.precision(), 1.0 / 3.0);
  EXPECT_DOUBLE_EQ(score.false_boxes_per_frame(), 2.0);
  EXPECT_DOUBLE_EQ(score.mota(), 1.0 - 3.0 / 2.0);
}

TEST(Score, AnotherIdIsASwitchUnlessTheOldOneIsStillThere) {
  Score score({}, calibration(), Kind::kVehicle);
  LabelledFrame frame;
  frame.labels = {label(1, Kind::kVehicle, 20.0, 0.0)};
  score.add(frame, std::vector{box(1, Kind::kVehicle, 20.0, 0.0)});
  score.add(frame,
            std::vector{box(1, Kind::kVehicle, 21.0, 0.0), box(2, Kind::kVehicle, 20.0, 0.0)});
  EXPECT_EQ(score.id_switches(), 0);
  score.add(frame, std::vector{box(2, Kind::kVehicle, 20.0, 0.0)});
  EXPECT_EQ(score.id_switches(), 1);
}

TEST(Score, WhatNobodyCaresForIsNeitherRightNorWrong) {
  Score score({}, calibration(), Kind::kVehicle);
  LabelledFrame frame;
  frame.labels = {label(1, Kind::kCyclist, 15.0, 0.0), label(2, Kind::kVehicle, 41.0, 0.0)};
  frame.dont_care = {{.least = {400.0, 100.0}, .most = {500.0, 200.0}}};
  const std::vector<FoundBox> boxes{
      box(1, Kind::kVehicle, 15.5, 0.0),   // On a cyclist.
      box(2, Kind::kVehicle, 20.0, 4.0),   // In the DontCare part.
      box(3, Kind::kVehicle, -10.0, 0.0),  // Behind the camera.
      box(4, Kind::kVehicle, 60.0, 0.0),   // Out of range.
      box(5, Kind::kVehicle, 39.5, 0.0),   // At a label that is out of range.
      box(6, Kind::kOther, 10.0, 0.0)};
  const auto verdicts = score.add(frame, boxes);
  EXPECT_EQ(verdicts, std::vector(6, Verdict::kNeither));
  EXPECT_EQ(score.labels(), 0);
  EXPECT_EQ(score.false_boxes(), 0);
}

}  // namespace
}  // namespace kitti
