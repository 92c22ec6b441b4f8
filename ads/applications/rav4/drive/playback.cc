#include "applications/rav4/drive/playback.h"

#include <algorithm>
#include <stdexcept>

#include <fmt/format.h>

#include "common/npy.h"

namespace rav4 {

Playback::Playback(const DriveClock& clock, const std::vector<double>& times_s,
                   std::string_view name) {
  offsets_.reserve(times_s.size());
  for (const double time_s : times_s) {
    const fastcycle::Duration offset = clock.offset_of(time_s);
    if (!offsets_.empty() && offset < offsets_.back()) {
      throw std::runtime_error(
          fmt::format("{}: expected times that never decrease, found {} s at row {}", name, time_s,
                      offsets_.size()));
    }
    offsets_.push_back(offset);
  }
}

Playback Playback::read(const DriveClock& clock, const std::filesystem::path& folder) {
  const std::filesystem::path file = folder / "t.npy";
  return {clock, ads::read_npy_numbers(file, 1).values(), file.string()};
}

std::optional<Playback::Row> Playback::take_due(fastcycle::Duration elapsed) {
  if (next_ == offsets_.size() || offsets_[next_] > elapsed) {
    return std::nullopt;
  }
  const Row row{.index = next_, .offset = offsets_[next_]};
  ++next_;
  return row;
}

std::optional<fastcycle::Duration> Playback::next_due() const {
  return next_ < offsets_.size() ? std::optional(offsets_[next_]) : std::nullopt;
}

std::optional<fastcycle::Duration> earlier(const std::optional<fastcycle::Duration>& a,
                                           const std::optional<fastcycle::Duration>& b) {
  if (!a || !b) {
    return a ? a : b;
  }
  return std::min(*a, *b);
}

}  // namespace rav4
