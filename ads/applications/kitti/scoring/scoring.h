#pragma once

#include <cstdint>
#include <fstream>
#include <map>
#include <optional>
#include <string>

#include <fastcycle/fastcycle.h>

#include "labels.h"
#include "localization/ego.pb.h"
#include "perception/objects.pb.h"
#include "score.h"

namespace kitti {

/// Compares recognized objects with the labels of the drive. No other component reads the labels.
///
/// In:   `perception/objects`, `localization/ego` (history)
class Scoring final : public fastcycle::Component {
 public:
  explicit Scoring(fastcycle::Context& context);
  void start() override;
  void stop() override;

 private:
  void on_objects(const perception::Objects& objects);
  void report_score(const std::string& kind, const Score& score);

  fastcycle::Param<fastcycle::Path> data_;
  fastcycle::Param<double> mount_forward_m_;
  fastcycle::Param<double> mount_height_m_;
  fastcycle::Param<std::string> details_;
  fastcycle::History<localization::Ego> ego_;

  std::map<std::int64_t, LabelledFrame> frames_;
  std::int64_t first_ = 0;
  std::optional<Score> vehicles_;
  std::optional<Score> cyclists_;
  std::int64_t unlabelled_ = 0;
  std::ofstream details_file_;
};

}  // namespace kitti
