#include "fix.h"

#include <array>
#include <charconv>
#include <cmath>
#include <numbers>
#include <vector>

#include <fmt/format.h>

#include "stream.h"

namespace ads {
namespace {

constexpr std::uint8_t kNav = 0x01;
constexpr std::uint8_t kPvt = 0x07;
constexpr std::size_t kPvtBytes = 92;
constexpr double kDay_s = 86'400.0;
// A GST of the epoch before is as good as one of this.
constexpr double kSameAccuracy_s = 2.5;

std::vector<std::string_view> fields_of(std::string_view body) {
  std::vector<std::string_view> fields;
  while (true) {
    const std::size_t comma = body.find(',');
    fields.push_back(body.substr(0, comma));
    if (comma == std::string_view::npos) {
      return fields;
    }
    body.remove_prefix(comma + 1);
  }
}

std::optional<double> number_of(std::string_view text) {
  double value = 0.0;
  const auto read = std::from_chars(text.data(), text.data() + text.size(), value);
  const bool is_number =
      !text.empty() && read.ec == std::errc() && read.ptr == text.data() + text.size();
  return is_number && std::isfinite(value) ? std::optional(value) : std::nullopt;
}

// "123519.50" is 12:35:19.5.
std::optional<double> second_of_day(std::string_view text) {
  const auto value = number_of(text);
  if (!value || *value < 0.0 || *value >= 240'000.0) {
    return std::nullopt;
  }
  const double hours = std::floor(*value / 10'000.0);
  const double minutes = std::floor((*value - hours * 10'000.0) / 100.0);
  return hours * 3600.0 + minutes * 60.0 + (*value - hours * 10'000.0 - minutes * 100.0);
}

// "4807.038" and "N" are 48 degrees and 7.038 minutes.
std::optional<double> degrees_of(std::string_view text, std::string_view side, char positive,
                                 char negative, double max_deg) {
  const auto value = number_of(text);
  if (!value || *value < 0.0 || side.size() != 1 || (side[0] != positive && side[0] != negative)) {
    return std::nullopt;
  }
  const double whole = std::floor(*value / 100.0);
  const double minutes = *value - 100.0 * whole;
  const double degrees = whole + minutes / 60.0;
  if (minutes >= 60.0 || degrees > max_deg) {
    return std::nullopt;
  }
  return side[0] == positive ? degrees : -degrees;
}

std::optional<GeodeticPosition> place_of(std::span<const std::string_view> fields) {
  const auto latitude = degrees_of(fields[0], fields[1], 'N', 'S', 90.0);
  const auto longitude = degrees_of(fields[2], fields[3], 'E', 'W', 180.0);
  if (!latitude || !longitude) {
    return std::nullopt;
  }
  return GeodeticPosition{.latitude_deg = *latitude, .longitude_deg = *longitude};
}

std::uint32_t unsigned_at(std::span<const std::uint8_t> content, std::size_t at) {
  return content[at] | static_cast<std::uint32_t>(content[at + 1]) << 8 |
         static_cast<std::uint32_t>(content[at + 2]) << 16 |
         static_cast<std::uint32_t>(content[at + 3]) << 24;
}

double signed_at(std::span<const std::uint8_t> content, std::size_t at) {
  return static_cast<std::int32_t>(unsigned_at(content, at));
}

void write_at(std::string& content, std::size_t at, std::uint32_t value) {
  for (std::size_t index = 0; index < 4; ++index) {
    content[at + index] = static_cast<char>(value >> (8 * index));
  }
}

struct Clock {
  int hour;
  int minute;
  double second;
};

Clock clock_of(const GnssFix& fix) {
  const double seconds = fix.second_of_day.value_or(0.0);
  const int hour = static_cast<int>(seconds / 3600.0);
  const int minute = static_cast<int>(seconds / 60.0) % 60;
  return {.hour = hour, .minute = minute, .second = seconds - 3600.0 * hour - 60.0 * minute};
}

std::string angle_text(double degrees, int digits, char positive, char negative) {
  // Rounded before the split into degrees and minutes, so that there are no 60 minutes.
  const auto units = std::llround(std::abs(degrees) * 60e7);
  const auto whole = units / 600'000'000;
  const double minutes = static_cast<double>(units % 600'000'000) * 1e-7;
  return fmt::format("{:0{}}{:010.7f},{}", whole, digits, minutes,
                     degrees < 0.0 ? negative : positive);
}

}  // namespace

bool FixReader::counts(Source source) {
  if (source < best_) {
    return false;
  }
  best_ = source;
  return true;
}

double FixReader::stddev_of(double second_of_day, double hdop) const {
  const double apart_s = std::abs(std::remainder(second_of_day - stddev_s_, kDay_s));
  return stddev_m_ && apart_s <= kSameAccuracy_s ? *stddev_m_ : hdop * range_error_m_;
}

std::optional<GnssFix> FixReader::take_sentence(std::string_view body) {
  const auto fields = fields_of(body);
  if (fields[0].size() != 5) {
    return std::nullopt;  // Of a manufacturer.
  }
  const std::string_view kind = fields[0].substr(2);
  const bool is_gga = kind == "GGA";
  const bool is_rmc = kind == "RMC";
  const bool is_gst = kind == "GST";
  if (!is_gga && !is_rmc && !is_gst) {
    return std::nullopt;
  }
  const std::size_t count_min = is_gga ? 12 : is_rmc ? 10 : 9;
  if (fields.size() < count_min) {
    ++malformed_;
    return std::nullopt;
  }
  const bool has_fix = is_gga ? fields[6] != "0" && !fields[6].empty() : fields[2] == "A";
  if (!is_gst && !has_fix) {
    ++without_fix_;
    return std::nullopt;
  }
  const auto time = second_of_day(fields[1]);
  if (is_gst) {
    const auto north = number_of(fields[6]);
    const auto east = number_of(fields[7]);
    if (time && north && east) {
      stddev_m_ = std::hypot(*north, *east) / std::numbers::sqrt2;
      stddev_s_ = *time;
    } else if (!fields[6].empty()) {
      ++malformed_;
    }
    return std::nullopt;
  }
  auto place = place_of(std::span(fields).subspan(is_gga ? 2 : 3));
  if (!time || !place) {
    ++malformed_;
    return std::nullopt;
  }
  double hdop = 1.0;
  if (is_gga) {
    const auto its_hdop = number_of(fields[8]);
    const auto altitude_m = number_of(fields[9]);
    if (!its_hdop || !altitude_m) {
      ++malformed_;
      return std::nullopt;
    }
    hdop = *its_hdop;
    place->altitude_m = *altitude_m + number_of(fields[11]).value_or(0.0);
  }
  if (!counts(is_gga ? Source::kGga : Source::kRmc)) {
    return std::nullopt;
  }
  return GnssFix{.position = *place, .stddev_m = stddev_of(*time, hdop), .second_of_day = time};
}

std::optional<GnssFix> FixReader::take_frame(std::uint8_t message_class, std::uint8_t message,
                                             std::span<const std::uint8_t> content) {
  if (message_class != kNav || message != kPvt) {
    return std::nullopt;
  }
  if (content.size() != kPvtBytes) {
    ++malformed_;
    return std::nullopt;
  }
  const std::uint8_t kind = content[20];
  const bool has_fix = (content[21] & 1U) != 0 && kind >= 2 && kind <= 4;
  if (!has_fix) {
    ++without_fix_;
    return std::nullopt;
  }
  GnssFix fix{.position = {.latitude_deg = 1e-7 * signed_at(content, 28),
                           .longitude_deg = 1e-7 * signed_at(content, 24),
                           .altitude_m = 1e-3 * signed_at(content, 32)},
              // Its accuracy is that of a radius.
              .stddev_m = 1e-3 * unsigned_at(content, 40) / std::numbers::sqrt2,
              .second_of_day = {}};
  if (std::abs(fix.position.latitude_deg) > 90.0 || std::abs(fix.position.longitude_deg) > 180.0) {
    ++malformed_;
    return std::nullopt;
  }
  constexpr unsigned kTimeIsValid = 0x02;
  if ((content[11] & kTimeIsValid) != 0) {
    fix.second_of_day =
        3600.0 * content[8] + 60.0 * content[9] + content[10] + 1e-9 * signed_at(content, 16);
  }
  return counts(Source::kPvt) ? std::optional(fix) : std::nullopt;
}

std::string encode_nmea(const GnssFix& fix) {
  const Clock clock = clock_of(fix);
  const std::string time = fmt::format("{:02}{:02}{:06.3f}", clock.hour, clock.minute,
                                       std::floor(clock.second * 1e3) * 1e-3);
  return gnss_stream::encode_sentence(
             fmt::format("GNGST,{},,,,,{:.3f},{:.3f},", time, fix.stddev_m, fix.stddev_m)) +
         gnss_stream::encode_sentence(fmt::format(
             "GNGGA,{},{},{},4,12,0.8,{:.3f},M,0.0,M,,", time,
             angle_text(fix.position.latitude_deg, 2, 'N', 'S'),
             angle_text(fix.position.longitude_deg, 3, 'E', 'W'), fix.position.altitude_m));
}

std::string encode_nav_pvt(const GnssFix& fix) {
  const Clock clock = clock_of(fix);
  std::string content(kPvtBytes, '\0');
  content[8] = static_cast<char>(clock.hour);
  content[9] = static_cast<char>(clock.minute);
  content[10] = static_cast<char>(clock.second);
  content[11] = fix.second_of_day ? '\x07' : '\0';
  const double fraction_s = clock.second - std::floor(clock.second);
  write_at(content, 16, static_cast<std::uint32_t>(fraction_s * 1e9));
  content[20] = '\x03';
  content[21] = '\x01';
  const auto scaled = [](double value, double factor) {
    return static_cast<std::uint32_t>(static_cast<std::int32_t>(std::lround(value * factor)));
  };
  write_at(content, 24, scaled(fix.position.longitude_deg, 1e7));
  write_at(content, 28, scaled(fix.position.latitude_deg, 1e7));
  write_at(content, 32, scaled(fix.position.altitude_m, 1e3));
  write_at(content, 40, scaled(fix.stddev_m * std::numbers::sqrt2, 1e3));
  return gnss_stream::encode_frame(kNav, kPvt, content);
}

}  // namespace ads
