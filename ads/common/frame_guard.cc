#include "common/frame_guard.h"

#include <algorithm>
#include <array>
#include <stdexcept>

#include <fmt/format.h>

namespace ads {
namespace {

// The raw bits of a signal, whatever its factor: a counter or a checksum has no unit.
DbcSignal raw_signal(const DbcMessage& message, std::string_view name, std::size_t bits_min,
                     std::size_t bits_max) {
  DbcSignal signal = message.signal(name);
  if (signal.bit_count < bits_min || signal.bit_count > bits_max) {
    throw std::runtime_error(fmt::format("{}: expected {} of {} to {} bits, found {}",
                                         message.place, name, bits_min, bits_max,
                                         signal.bit_count));
  }
  signal.is_signed = false;
  signal.factor = 1.0;
  signal.offset = 0.0;
  return signal;
}

}  // namespace

std::uint8_t crc8(std::span<const std::uint8_t> bytes, std::uint8_t before) {
  constexpr unsigned kPolynomial = 0x1d;
  // The remainder begins with ones, and its complement is the checksum.
  unsigned remainder = before ^ 0xffU;
  for (const std::uint8_t byte : bytes) {
    remainder ^= byte;
    for (int bit = 0; bit < 8; ++bit) {
      remainder = ((remainder << 1U) ^ ((remainder & 0x80U) != 0 ? kPolynomial : 0U)) & 0xffU;
    }
  }
  return static_cast<std::uint8_t>(remainder ^ 0xffU);
}

FrameGuard::FrameGuard(const DbcMessage& message)
    : address_(message.address),
      byte_count_(message.byte_count),
      counter_(raw_signal(message, "COUNTER", 2, 8)),
      checksum_(raw_signal(message, "CHECKSUM", 8, 8)),
      counter_range_(1U << counter_.bit_count) {}

void FrameGuard::seal(std::span<std::uint8_t> payload) {
  last_ = last_ ? (*last_ + 1) % counter_range_ : 0;
  counter_.encode(*last_, payload);
  checksum_.encode(checksum_of(payload), payload);
}

FrameGuard::Verdict FrameGuard::check(std::span<const std::uint8_t> payload) {
  if (payload.size() != byte_count_) {
    return Verdict::kWrongLength;
  }
  if (checksum_.decode(payload) != checksum_of(payload)) {
    return Verdict::kWrongChecksum;
  }
  const auto counter = static_cast<std::uint32_t>(counter_.decode(payload));
  if (last_) {
    const std::uint32_t step = (counter + counter_range_ - *last_) % counter_range_;
    if (step == 0) {
      return Verdict::kRepeated;
    }
    lost_ += step - 1;
  }
  last_ = counter;
  return Verdict::kGood;
}

std::uint8_t FrameGuard::checksum_of(std::span<const std::uint8_t> payload) const {
  const std::array<std::uint8_t, 4> address{
      static_cast<std::uint8_t>(address_), static_cast<std::uint8_t>(address_ >> 8U),
      static_cast<std::uint8_t>(address_ >> 16U), static_cast<std::uint8_t>(address_ >> 24U)};
  std::array<std::uint8_t, 64> bytes{};
  std::copy(payload.begin(), payload.end(), bytes.begin());
  checksum_.encode(0.0, bytes);
  return crc8(std::span(bytes).first(payload.size()), crc8(address));
}

std::string_view text_of(FrameGuard::Verdict verdict) {
  switch (verdict) {
    case FrameGuard::Verdict::kGood:
      return "good";
    case FrameGuard::Verdict::kWrongLength:
      return "wrong length";
    case FrameGuard::Verdict::kWrongChecksum:
      return "wrong checksum";
    case FrameGuard::Verdict::kRepeated:
      return "repeated counter";
  }
  return "good";
}

}  // namespace ads
