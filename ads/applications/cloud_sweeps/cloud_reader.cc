#include "cloud_reader.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <limits>
#include <numbers>
#include <optional>
#include <span>
#include <stdexcept>
#include <string_view>

#include <fmt/format.h>

namespace ads {
namespace {

using foxglove::PackedElementField;

constexpr std::size_t kReturnBytes = 16;
constexpr double kSpanMax_s = 1.0;
// Larger times are not relative to the cloud but since 1970; still larger ones are nanoseconds.
constexpr double kAbsolute_s = 1e6;
constexpr double kAbsolute_ns = 1e15;

constexpr std::array<std::string_view, 5> kTimeNames = {"time", "t", "timestamp", "offset_time",
                                                        "time_stamp"};
constexpr std::array<std::string_view, 4> kRingNames = {"ring", "channel", "line", "laser_id"};
constexpr std::array<std::string_view, 3> kIntensityNames = {"intensity", "reflectivity", "i"};

std::size_t size_of(PackedElementField::NumericType type) {
  switch (type) {
    case PackedElementField::UINT8:
    case PackedElementField::INT8:
      return 1;
    case PackedElementField::UINT16:
    case PackedElementField::INT16:
      return 2;
    case PackedElementField::UINT32:
    case PackedElementField::INT32:
    case PackedElementField::FLOAT32:
      return 4;
    case PackedElementField::FLOAT64:
      return 8;
    default:
      return 0;
  }
}

template <typename T>
double value_at(const char* at) {
  T value;
  std::memcpy(&value, at, sizeof value);
  return static_cast<double>(value);
}

// Where a number lies in each point.
struct Field {
  std::size_t offset = 0;
  PackedElementField::NumericType type = PackedElementField::UNKNOWN;

  [[nodiscard]] bool is_float() const {
    return type == PackedElementField::FLOAT32 || type == PackedElementField::FLOAT64;
  }

  [[nodiscard]] double of(const char* point) const {
    const char* const at = point + offset;
    switch (type) {
      case PackedElementField::UINT8:
        return value_at<std::uint8_t>(at);
      case PackedElementField::INT8:
        return value_at<std::int8_t>(at);
      case PackedElementField::UINT16:
        return value_at<std::uint16_t>(at);
      case PackedElementField::INT16:
        return value_at<std::int16_t>(at);
      case PackedElementField::UINT32:
        return value_at<std::uint32_t>(at);
      case PackedElementField::INT32:
        return value_at<std::int32_t>(at);
      case PackedElementField::FLOAT32:
        return value_at<float>(at);
      default:
        return value_at<double>(at);
    }
  }
};

const PackedElementField* find_field(const foxglove::PointCloud& cloud,
                                     std::span<const std::string_view> names) {
  for (const std::string_view name : names) {
    for (const PackedElementField& field : cloud.fields()) {
      if (field.name() == name) {
        return &field;
      }
    }
  }
  return nullptr;
}

Field checked(const foxglove::PointCloud& cloud, const PackedElementField& field) {
  const std::size_t size = size_of(field.type());
  if (size == 0) {
    throw std::runtime_error(fmt::format("field \"{}\": expected a type of number, found {}",
                                         field.name(), static_cast<int>(field.type())));
  }
  if (std::size_t{field.offset()} + size > cloud.point_stride()) {
    throw std::runtime_error(
        fmt::format("field \"{}\": expected within the {} bytes of a point, "
                    "found {} bytes at {}",
                    field.name(), cloud.point_stride(), size, field.offset()));
  }
  return {.offset = field.offset(), .type = field.type()};
}

Field place_field(const foxglove::PointCloud& cloud, std::string_view name) {
  const PackedElementField* const field = find_field(cloud, {&name, 1});
  if (field == nullptr) {
    throw std::runtime_error(fmt::format("expected a field \"{}\", found none", name));
  }
  const Field its = checked(cloud, *field);
  if (!its.is_float()) {
    throw std::runtime_error(fmt::format("field \"{}\": expected FLOAT32 or FLOAT64, found {}",
                                         name, PackedElementField::NumericType_Name(its.type)));
  }
  return its;
}

std::optional<Field> optional_field(const foxglove::PointCloud& cloud,
                                    std::span<const std::string_view> names) {
  const PackedElementField* const field = find_field(cloud, names);
  return field == nullptr ? std::nullopt : std::optional(checked(cloud, *field));
}

const PackedElementField* find_time(const foxglove::PointCloud& cloud, const CloudConfig& config) {
  if (config.time_field.empty()) {
    return find_field(cloud, kTimeNames);
  }
  const std::string_view name = config.time_field;
  return find_field(cloud, {&name, 1});
}

std::optional<Field> time_field(const foxglove::PointCloud& cloud, const CloudConfig& config) {
  const PackedElementField* const field = find_time(cloud, config);
  if (field == nullptr) {
    if (!config.time_field.empty()) {
      throw std::runtime_error(
          fmt::format("expected a field \"{}\" with times, found none", config.time_field));
    }
    return std::nullopt;
  }
  const Field its = checked(cloud, *field);
  if (!its.is_float() && size_of(its.type) != 4) {
    throw std::runtime_error(
        fmt::format("field \"{}\": expected UINT32, INT32 (ns), FLOAT32 or FLOAT64 (s), found {}",
                    field->name(), PackedElementField::NumericType_Name(its.type)));
  }
  return its;
}

// Seconds since the cloud's timestamp.
double seconds_since(const Field& time, const char* point, std::int64_t stamp_ns) {
  const double value = time.of(point);
  if (!time.is_float()) {
    return value * 1e-9;
  }
  const auto stamp = static_cast<double>(stamp_ns);
  if (std::abs(value) > kAbsolute_ns) {
    return (value - stamp) * 1e-9;
  }
  return std::abs(value) > kAbsolute_s ? value - stamp * 1e-9 : value;
}

// From 0 to 1: how far a sensor has turned when it looks there.
double share_of_turn(double x_m, double y_m, const CloudConfig& config) {
  const double azimuth_rad = std::atan2(y_m, x_m) - config.begin_rad;
  const double turns = azimuth_rad / (2.0 * std::numbers::pi);
  const double passed = config.turn == Turn::kClockwise ? -turns : turns;
  return passed - std::floor(passed);
}

struct Span {
  double begin_s = std::numeric_limits<double>::infinity();
  double end_s = -std::numeric_limits<double>::infinity();
};

Span span_of(const foxglove::PointCloud& cloud, const Field& time, std::int64_t stamp_ns) {
  Span span;
  const std::string& data = cloud.data();
  for (std::size_t at = 0; at < data.size(); at += cloud.point_stride()) {
    const double time_s = seconds_since(time, data.data() + at, stamp_ns);
    if (std::isfinite(time_s)) {
      span.begin_s = std::min(span.begin_s, time_s);
      span.end_s = std::max(span.end_s, time_s);
    }
  }
  if (!(span.begin_s <= span.end_s)) {
    return {.begin_s = 0.0, .end_s = 0.0};
  }
  if (span.end_s - span.begin_s > kSpanMax_s || std::abs(span.begin_s) > kSpanMax_s) {
    throw std::runtime_error(
        fmt::format("expected times of points within {} s of the cloud, found {:.3f} s to {:.3f} s",
                    kSpanMax_s, span.begin_s, span.end_s));
  }
  return span;
}

}  // namespace

bool has_times(const foxglove::PointCloud& cloud, const CloudConfig& config) {
  return find_time(cloud, config) != nullptr;
}

void read_cloud(const foxglove::PointCloud& cloud, const CloudConfig& config, lidar::Sweep& sweep) {
  const std::size_t stride = cloud.point_stride();
  const std::string& data = cloud.data();
  if (stride == 0 || data.size() % stride != 0) {
    throw std::runtime_error(
        fmt::format("expected points of {} bytes each, found {} bytes", stride, data.size()));
  }
  const std::array<Field, 3> places = {place_field(cloud, "x"), place_field(cloud, "y"),
                                       place_field(cloud, "z")};
  const std::optional<Field> time = time_field(cloud, config);
  const std::optional<Field> ring = optional_field(cloud, kRingNames);
  const std::optional<Field> intensity = optional_field(cloud, kIntensityNames);

  const std::int64_t stamp_ns =
      cloud.timestamp().seconds() * 1'000'000'000 + cloud.timestamp().nanos();
  std::int64_t begin_ns = stamp_ns - (config.is_stamp_at_end ? config.turn_ns : 0);
  std::int64_t duration_ns = config.turn_ns;
  Span span;
  if (time) {
    span = span_of(cloud, *time, stamp_ns);
    begin_ns = stamp_ns + std::llround(span.begin_s * 1e9);
    duration_ns = std::max<std::int64_t>(1, std::llround((span.end_s - span.begin_s) * 1e9));
  } else if (config.turn == Turn::kNone) {
    begin_ns = stamp_ns - 1;
    duration_ns = 1;
  }
  sweep.mutable_header()->set_taken_ns(begin_ns);
  sweep.mutable_header()->set_frame(cloud.frame_id());
  sweep.set_duration_ns(duration_ns);

  std::string& points = *sweep.mutable_points();
  points.resize(data.size() / stride * kReturnBytes);
  std::size_t returns = 0;
  std::uint32_t rings = ring ? 1 : config.rings;
  for (std::size_t at = 0; at < data.size(); at += stride) {
    const char* const point = data.data() + at;
    const Eigen::Vector3f seen_m(static_cast<float>(places[0].of(point)),
                                 static_cast<float>(places[1].of(point)),
                                 static_cast<float>(places[2].of(point)));
    if (!seen_m.allFinite() || seen_m.isZero(0.0F)) {
      continue;
    }
    double share = 0.0;
    if (time) {
      share = (seconds_since(*time, point, stamp_ns) - span.begin_s) * 1e9 /
              static_cast<double>(duration_ns);
    } else if (config.turn != Turn::kNone) {
      share = share_of_turn(seen_m.x(), seen_m.y(), config);
    }
    if (!std::isfinite(share)) {
      continue;
    }
    const Eigen::Vector3f place_m = config.rotation * seen_m;
    const auto its_time = static_cast<std::uint16_t>(std::clamp(share * 65536.0, 0.0, 65535.0));
    const auto its_ring =
        static_cast<std::uint8_t>(ring ? std::clamp(ring->of(point), 0.0, 255.0) : 0.0);
    rings = std::max(rings, its_ring + 1U);
    const double brightness = intensity ? intensity->of(point) / config.intensity_max * 255.0 : 0.0;
    const auto its_intensity = static_cast<std::uint8_t>(
        std::isfinite(brightness) ? std::clamp(brightness, 0.0, 255.0) : 0.0);
    char* const beam_return = points.data() + kReturnBytes * returns++;
    std::memcpy(beam_return, place_m.data(), 12);
    std::memcpy(beam_return + 12, &its_time, 2);
    std::memcpy(beam_return + 14, &its_ring, 1);
    std::memcpy(beam_return + 15, &its_intensity, 1);
  }
  // The last column is filled up with what is no return.
  const std::size_t columns = (returns + rings - 1) / rings;
  points.resize(returns * kReturnBytes);
  points.resize(columns * rings * kReturnBytes, '\0');
  sweep.set_columns(static_cast<std::uint32_t>(columns));
  sweep.set_rings(rings);
}

}  // namespace ads
