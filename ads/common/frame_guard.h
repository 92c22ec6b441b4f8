#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string_view>

#include "common/dbc.h"

namespace ads {

/// The checksum CRC-8 of SAE J1850, continued from that of preceding bytes.
std::uint8_t crc8(std::span<const std::uint8_t> bytes, std::uint8_t before = 0);

/// Protects the frames of one message of a bus, as the profiles for end-to-end protection of
/// AUTOSAR do: the signal COUNTER is incremented from frame to frame, and CHECKSUM is a CRC over
/// the message's address and all other bits. One guard seals frames, or checks those of one sender.
///
/// @threads  Confined to its owner.
class FrameGuard {
 public:
  enum class Verdict : std::uint8_t {
    kGood,
    kWrongLength,
    kWrongChecksum,
    kRepeated,  ///< The counter has not changed: a repeated frame, or a hung sender.
  };

  /// @errors  Throws `std::runtime_error` if the message has no COUNTER of 2 to 8 bits, or no
  ///          CHECKSUM of 8 bits, or if they do not fit.
  explicit FrameGuard(const DbcMessage& message);

  /// Sets counter and checksum. @pre `payload.size()` is that of the message.
  void seal(std::span<std::uint8_t> payload);

  [[nodiscard]] Verdict check(std::span<const std::uint8_t> payload);

  /// The number of lost frames, from the counters of the good frames.
  [[nodiscard]] std::uint64_t lost() const { return lost_; }

 private:
  [[nodiscard]] std::uint8_t checksum_of(std::span<const std::uint8_t> payload) const;

  std::uint32_t address_;
  std::size_t byte_count_;
  DbcSignal counter_;
  DbcSignal checksum_;
  std::uint32_t counter_range_;
  std::optional<std::uint32_t> last_;
  std::uint64_t lost_ = 0;
};

/// As text: "wrong checksum".
std::string_view text_of(FrameGuard::Verdict verdict);

}  // namespace ads
