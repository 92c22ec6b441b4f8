#pragma once

#include <cstddef>
#include <filesystem>
#include <optional>
#include <vector>

#include <Eigen/Core>
#include <fastcycle/fastcycle.h>

#include "applications/rav4/drive/drive_clock.h"

namespace rav4 {

/// The true positions of the car: the post-processed poses that come with a drive.
///
/// @threads  Compatible.
class Reference {
 public:
  struct Frame {
    fastcycle::Duration offset{};  ///< Since the application's start; may be negative.
    Eigen::Vector3d ecef_m{0.0, 0.0, 0.0};
  };

  /// @errors  Throws `std::runtime_error` if times do not increase.
  explicit Reference(std::vector<Frame> frames);

  /// Reads `global_pose` of the drive's folder.
  static Reference read(const DriveClock& clock, const std::filesystem::path& data);

  [[nodiscard]] const std::vector<Frame>& frames() const { return frames_; }

  /// The position at `offset`, interpolated linearly between two frames; none outside of the
  /// frames.
  [[nodiscard]] std::optional<Eigen::Vector3d> ecef_at(fastcycle::Duration offset) const;

 private:
  std::vector<Frame> frames_;
};

}  // namespace rav4
