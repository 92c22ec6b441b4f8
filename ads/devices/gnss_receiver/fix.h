#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "common/geodesy.h"

namespace ads {

/// A position as reported by a receiver.
struct GnssFix {
  GeodeticPosition position;
  double stddev_m = 0.0;                ///< Of each axis in the plane, one sigma.
  std::optional<double> second_of_day;  ///< UTC, for which it holds.
};

/// Decodes fixes from NMEA sentences and UBX messages. Only the best source received so far is
/// used: NAV-PVT, else GGA, else RMC.
///
/// @threads  Confined.
class FixReader {
 public:
  /// @param  range_error_m  the error assumed for a sentence without an accuracy, times its HDOP
  explicit FixReader(double range_error_m) : range_error_m_(range_error_m) {}

  /// Decodes "GPGGA,…", "GNRMC,…", "GNGST,…" of any talker; none if it contains no usable fix.
  std::optional<GnssFix> take_sentence(std::string_view body);
  /// Decodes NAV-PVT (u-blox 8 receiver description, UBX-13003221, UBX-NAV-PVT).
  std::optional<GnssFix> take_frame(std::uint8_t message_class, std::uint8_t message,
                                    std::span<const std::uint8_t> content);

  /// The numbers of messages that could not be decoded, and of those that reported no fix.
  [[nodiscard]] std::int64_t malformed() const { return malformed_; }
  [[nodiscard]] std::int64_t without_fix() const { return without_fix_; }

 private:
  enum class Source : std::uint8_t { kNone, kRmc, kGga, kPvt };

  [[nodiscard]] bool counts(Source source);
  [[nodiscard]] double stddev_of(double second_of_day, double hdop) const;

  double range_error_m_;
  Source best_ = Source::kNone;
  std::optional<double> stddev_m_;  // Of the newest GST,
  double stddev_s_ = 0.0;           // which is of that second of the day.
  std::int64_t malformed_ = 0;
  std::int64_t without_fix_ = 0;
};

/// GGA and GST of a fix, in the format of a receiver.
std::string encode_nmea(const GnssFix& fix);
/// NAV-PVT of a fix.
std::string encode_nav_pvt(const GnssFix& fix);

}  // namespace ads
