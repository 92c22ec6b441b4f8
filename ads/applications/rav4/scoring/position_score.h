#pragma once

#include <algorithm>
#include <cstdint>
#include <optional>
#include <vector>

#include <Eigen/Core>
#include <fastcycle/fastcycle.h>

#include "common/geodesy.h"
#include "reference.h"

namespace rav4 {

/// A position and the car's true position at that time, both in the plane of the score.
struct Comparison {
  fastcycle::Duration offset{};
  Eigen::Vector2d position_m{0.0, 0.0};
  Eigen::Vector2d reference_m{0.0, 0.0};

  /// The horizontal error.
  [[nodiscard]] double error_m() const { return (position_m - reference_m).norm(); }
};

/// Mean and maximum of errors.
struct ErrorSum {
  std::int64_t count = 0;
  double sum_m = 0.0;
  double max_m = 0.0;

  void add(double error_m) {
    ++count;
    sum_m += error_m;
    max_m = std::max(max_m, error_m);
  }
  /// @pre  `count > 0`
  [[nodiscard]] double mean_m() const { return sum_m / static_cast<double>(count); }
};

/// An estimated position and velocity, in the plane of the score.
struct Motion {
  fastcycle::Duration offset{};
  Eigen::Vector2d position_m{0.0, 0.0};
  Eigen::Vector2d velocity_mps{0.0, 0.0};
};

/// Compares fixes and estimates with the reference, horizontally, in the tangential plane of the
/// first fix.
///
/// A fix is compared with the reference at its time of arrival. The estimate is compared at the
/// time of each frame of the reference from the first fix on: it is the last estimate made before
/// that time, extrapolated with its velocity. Later estimates are not used.
///
/// @threads  Confined.
class PositionScore {
 public:
  explicit PositionScore(Reference reference) : reference_(std::move(reference)) {}

  /// The plane; none before the first fix.
  [[nodiscard]] const std::optional<ads::LocalFrame>& plane() const { return plane_; }
  [[nodiscard]] const Reference& reference() const { return reference_; }

  /// None if the reference does not cover the time of the fix.
  std::optional<Comparison> on_fix(fastcycle::Duration offset, const ads::GeodeticPosition& place);

  /// Call it in the order of time, after the first fix. The result is valid until the next call.
  const std::vector<Comparison>& on_motion(const Motion& motion);

  /// Ends the score: compares the frames until shortly after the last estimate with it.
  const std::vector<Comparison>& finish();

  [[nodiscard]] const ErrorSum& fix_errors() const { return fix_errors_; }
  [[nodiscard]] const ErrorSum& estimate_errors() const { return estimate_errors_; }

 private:
  void compare_frames_before(fastcycle::Duration end);

  const Reference reference_;

  std::optional<ads::LocalFrame> plane_;
  fastcycle::Duration first_fix_{};
  std::optional<Motion> last_motion_;
  std::size_t next_frame_ = 0;
  std::vector<Comparison> compared_;
  ErrorSum fix_errors_;
  ErrorSum estimate_errors_;
};

}  // namespace rav4
