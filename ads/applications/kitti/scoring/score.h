#pragma once

#include <cstdint>
#include <map>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "labels.h"

namespace kitti {

/// A detected box, in the lidar's frame.
struct FoundBox {
  std::uint64_t id = 0;
  Kind kind = Kind::kOther;
  Eigen::Vector3d center_m = Eigen::Vector3d::Zero();
};

enum class Verdict : std::uint8_t { kRight, kFalse, kNeither };

struct ScoreConfig {
  double range_max_m = 40.0;
  /// Nearer centres match.
  double distance_max_m = 2.0;
  /// Of the picture, pixels.
  Eigen::Vector2d image_size{1242.0, 375.0};
};

/// Counts how many objects of a kind were detected, frame by frame.
///
/// Boxes of one kind are matched with labels of the kind, one to one: first those that were matched
/// in the previous frame, then the nearest (Bernardin, Stiefelhagen, "Evaluating Multiple Object
/// Tracking Performance: The CLEAR MOT Metrics", EURASIP 2008). Only boxes and labels with their
/// centre in the picture and within the range are counted. An unmatched box whose centre lies in a
/// DontCare part, or that is at a label of another kind, or whose own label is not counted, is
/// neither right nor wrong.
///
/// @threads  Confined.
class Score {
 public:
  Score(const ScoreConfig& config, const Calibration& calibration, Kind kind)
      : config_(config), calibration_(calibration), kind_(kind) {}

  /// One verdict for each box; boxes of other kinds get `kNeither`.
  std::vector<Verdict> add(const LabelledFrame& frame, std::span<const FoundBox> boxes);
  /// For each counted label of the last frame, whether it was missed.
  [[nodiscard]] const std::vector<bool>& missed() const { return missed_; }

  [[nodiscard]] std::int64_t frames() const { return frames_; }
  [[nodiscard]] std::int64_t labels() const { return labels_; }
  [[nodiscard]] std::int64_t found() const { return found_; }
  [[nodiscard]] std::int64_t false_boxes() const { return false_boxes_; }
  [[nodiscard]] std::int64_t id_switches() const { return id_switches_; }
  // 0 where the denominator is 0.
  [[nodiscard]] double precision() const;
  [[nodiscard]] double recall() const;
  [[nodiscard]] double false_boxes_per_frame() const;
  [[nodiscard]] double mota() const;
  [[nodiscard]] double distance_mean_m() const;

 private:
  [[nodiscard]] bool counts(const Eigen::Vector3d& center_m) const;
  [[nodiscard]] bool is_excused(const LabelledFrame& frame, const Eigen::Vector3d& center_m) const;

  const ScoreConfig config_;
  const Calibration calibration_;
  const Kind kind_;
  std::map<std::int64_t, std::uint64_t> box_of_;  // The last one of each labelled track.
  std::vector<bool> missed_;
  std::int64_t frames_ = 0;
  std::int64_t labels_ = 0;
  std::int64_t found_ = 0;
  std::int64_t false_boxes_ = 0;
  std::int64_t id_switches_ = 0;
  double distance_sum_m_ = 0.0;
};

}  // namespace kitti
