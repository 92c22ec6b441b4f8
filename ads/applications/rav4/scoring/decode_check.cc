#include "decode_check.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <utility>

#include <fmt/format.h>

namespace rav4 {
namespace {

using std::chrono_literals::operator""us;

constexpr fastcycle::Duration kSameTime = 1us;

}  // namespace

DecodeCheck DecodeCheck::read(const DriveClock& clock, const std::filesystem::path& folder,
                              std::size_t columns) {
  const ads::NumberTable times = ads::read_npy_numbers(folder / "t.npy", 1);
  ads::NumberTable values = ads::read_npy_numbers(folder / "value.npy", columns);
  if (times.rows() != values.rows()) {
    throw std::runtime_error(
        fmt::format("{}: expected as many rows in t and value, found {} and {}", folder.string(),
                    times.rows(), values.rows()));
  }
  std::vector<fastcycle::Duration> offsets;
  offsets.reserve(times.rows());
  for (const double time_s : times.values()) {
    offsets.push_back(clock.offset_of(time_s));
  }
  return {std::move(offsets), std::move(values)};
}

void DecodeCheck::compare(fastcycle::Duration offset, std::span<const double> values) {
  while (next_ < offsets_.size() && offsets_[next_] < offset - kSameTime) {
    ++next_;
    ++unmatched_;
  }
  if (next_ == offsets_.size() || offsets_[next_] > offset + kSameTime) {
    ++unmatched_;
    return;
  }
  for (std::size_t column = 0; column < std::min(values.size(), values_.columns()); ++column) {
    const double error = std::abs(values[column] - values_.at(next_, column));
    // Not a number is as wrong as can be.
    max_error_ = error <= max_error_ ? max_error_ : error;
  }
  ++next_;
  ++compared_;
}

}  // namespace rav4
