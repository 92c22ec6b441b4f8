#include "reference.h"

#include <algorithm>
#include <chrono>
#include <stdexcept>
#include <utility>

#include <fmt/format.h>

#include "common/npy.h"

namespace rav4 {
namespace {

constexpr std::size_t kAxes = 3;

}  // namespace

Reference::Reference(std::vector<Frame> frames) : frames_(std::move(frames)) {
  for (std::size_t index = 1; index < frames_.size(); ++index) {
    if (frames_[index].offset <= frames_[index - 1].offset) {
      throw std::runtime_error(
          fmt::format("reference: expected times that grow, found none at row {}", index));
    }
  }
}

Reference Reference::read(const DriveClock& clock, const std::filesystem::path& data) {
  const auto folder = data / "global_pose";
  const ads::NumberTable times = ads::read_npy_numbers(folder / "frame_times.npy", 1);
  const ads::NumberTable positions = ads::read_npy_numbers(folder / "frame_positions.npy", kAxes);
  if (times.rows() != positions.rows()) {
    throw std::runtime_error(
        fmt::format("{}: expected as many rows in frame_times and frame_positions, found {} and {}",
                    folder.string(), times.rows(), positions.rows()));
  }
  std::vector<Frame> frames;
  frames.reserve(times.rows());
  for (std::size_t row = 0; row < times.rows(); ++row) {
    frames.push_back(
        {.offset = clock.offset_of(times.at(row, 0)),
         .ecef_m = {positions.at(row, 0), positions.at(row, 1), positions.at(row, 2)}});
  }
  return Reference(std::move(frames));
}

std::optional<Eigen::Vector3d> Reference::ecef_at(fastcycle::Duration offset) const {
  const auto after = std::ranges::lower_bound(frames_, offset, {}, &Frame::offset);
  if (after == frames_.end()) {
    return std::nullopt;
  }
  if (after->offset == offset) {
    return after->ecef_m;
  }
  if (after == frames_.begin()) {
    return std::nullopt;
  }
  const auto before = after - 1;
  const std::chrono::duration<double> passed = offset - before->offset;
  const std::chrono::duration<double> whole = after->offset - before->offset;
  return before->ecef_m + passed / whole * (after->ecef_m - before->ecef_m);
}

}  // namespace rav4
