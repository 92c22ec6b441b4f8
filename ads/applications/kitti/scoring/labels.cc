#include "labels.h"

#include <array>
#include <charconv>
#include <cmath>
#include <numbers>
#include <sstream>
#include <stdexcept>
#include <system_error>

#include <fmt/format.h>

#include "common/plane.h"

namespace kitti {
namespace {

// Of a line: frame, track and type, and the numbers behind them.
constexpr std::size_t kWords = 17;
constexpr std::size_t kType = 2;
enum Column : std::size_t {
  kLeft = 6,
  kTop,
  kRight,
  kBottom,
  kHeight,
  kWidth,
  kLength,
  kX,
  kY,
  kZ,
  kTurn
};

template <typename Number>
bool parse(const std::string& word, Number& number) {
  const char* const end = word.data() + word.size();
  const auto [at, error] = std::from_chars(word.data(), end, number);
  return error == std::errc() && at == end;
}

Kind kind_of(std::string_view type) {
  if (type == "Car" || type == "Van" || type == "Truck") {
    return Kind::kVehicle;
  }
  return type == "Cyclist" ? Kind::kCyclist : Kind::kOther;
}

Label label_from(const std::array<double, kWords>& numbers, const Calibration& calibration) {
  Label label;
  label.height_m = numbers[kHeight];
  label.width_m = numbers[kWidth];
  label.length_m = numbers[kLength];
  const Eigen::Vector3d bottom_m(numbers[kX], numbers[kY], numbers[kZ]);
  // The camera's y axis looks down.
  const Eigen::Vector3d middle_m = bottom_m - Eigen::Vector3d(0.0, 0.5 * label.height_m, 0.0);
  const Eigen::Vector3d ahead_m(std::cos(numbers[kTurn]), 0.0, -std::sin(numbers[kTurn]));
  label.center_m = calibration.from_camera(middle_m);
  const Eigen::Vector3d front_m = calibration.from_camera(middle_m + ahead_m) - label.center_m;
  label.heading_rad = std::atan2(front_m.y(), front_m.x());
  return label;
}

}  // namespace

std::map<std::int64_t, LabelledFrame> parse_labels(std::string_view text,
                                                   const Calibration& calibration,
                                                   const std::string& name) {
  std::map<std::int64_t, LabelledFrame> frames;
  std::istringstream lines{std::string(text)};
  std::string line;
  for (int row = 1; std::getline(lines, line); ++row) {
    std::istringstream words(line);
    std::array<double, kWords> numbers{};
    std::int64_t frame = 0;
    Label label;
    std::string type;
    std::string word;
    std::size_t column = 0;
    for (; words >> word; ++column) {
      if (column == kType) {
        type = word;
        continue;
      }
      const bool is_number = column == 0   ? parse(word, frame) && frame >= 0
                             : column == 1 ? parse(word, label.track)
                             : column < kWords
                                 ? parse(word, numbers[column]) && std::isfinite(numbers[column])
                                 : true;  // A score may follow.
      if (!is_number) {
        throw std::runtime_error(fmt::format("{}: line {}: word {}: expected a number, found '{}'",
                                             name, row, column + 1, word));
      }
    }
    if (column == 0) {
      continue;
    }
    if (column < kWords) {
      throw std::runtime_error(
          fmt::format("{}: line {}: expected {} words, found {}", name, row, kWords, column));
    }
    LabelledFrame& its = frames[frame];
    if (type == "DontCare") {
      its.dont_care.push_back(
          {.least = {numbers[kLeft], numbers[kTop]}, .most = {numbers[kRight], numbers[kBottom]}});
      continue;
    }
    const std::int64_t track = label.track;
    label = label_from(numbers, calibration);
    label.track = track;
    label.kind = kind_of(type);
    its.labels.push_back(label);
  }
  return frames;
}

}  // namespace kitti
