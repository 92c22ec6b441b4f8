#include "applications/kitti/drive/frames.h"

#include <algorithm>
#include <charconv>
#include <stdexcept>
#include <string>
#include <system_error>
#include <tuple>

#include <fmt/format.h>

namespace kitti {
namespace {

// More than three years: what is larger is no number of a frame.
constexpr std::int64_t kNumberMax = 1'000'000'000;

}  // namespace

std::vector<Frame> list_frames(const std::filesystem::path& folder, std::string_view suffix) {
  std::error_code error;
  std::vector<Frame> frames;
  for (const auto& entry : std::filesystem::directory_iterator(folder, error)) {
    const std::string name = entry.path().filename().string();
    if (!name.ends_with(suffix)) {
      continue;
    }
    const std::string_view digits = std::string_view(name).substr(0, name.size() - suffix.size());
    Frame frame{.number = 0, .file = entry.path()};
    const auto [end, failure] =
        std::from_chars(digits.data(), digits.data() + digits.size(), frame.number);
    if (failure != std::errc() || end != digits.data() + digits.size() || frame.number < 0 ||
        frame.number > kNumberMax) {
      throw std::runtime_error(fmt::format("{}: expected a file named by the number of its frame",
                                           entry.path().string()));
    }
    frames.push_back(std::move(frame));
  }
  if (error) {
    throw std::runtime_error(
        fmt::format("{}: expected a folder, found {}", folder.string(), error.message()));
  }
  if (frames.empty()) {
    throw std::runtime_error(
        fmt::format("{}: expected files NUMBER{}, found none", folder.string(), suffix));
  }
  std::ranges::sort(frames, [](const Frame& a, const Frame& b) {
    return std::tie(a.number, a.file) < std::tie(b.number, b.file);
  });
  const auto twice = std::ranges::adjacent_find(
      frames, [](const Frame& a, const Frame& b) { return a.number == b.number; });
  if (twice != frames.end()) {
    throw std::runtime_error(fmt::format("{}: expected one file for frame {}, found two",
                                         folder.string(), twice->number));
  }
  return frames;
}

}  // namespace kitti
