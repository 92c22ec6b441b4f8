#include "rosbag/cdr.h"

#include <fmt/format.h>

#include "base/utf8.h"

namespace fastcycle::rosbag {

CdrReader::CdrReader(std::span<const std::byte> message) : message_(message) {
  if (message.size() < kHeadBytes) {
    throw CdrError(
        fmt::format("expected {} bytes of encapsulation, found {}", kHeadBytes, message.size()));
  }
  const auto kind = static_cast<unsigned>(message[0]) << 8U | static_cast<unsigned>(message[1]);
  if (kind > 1) {
    throw CdrError(
        fmt::format("byte 0: expected plain CDR, 0x0000 or 0x0001, found {:#06x}", kind));
  }
  is_swapped_ = (kind == 1) != (std::endian::native == std::endian::little);
}

std::string CdrReader::text(std::string_view field) {
  const std::uint32_t size = count(field, 1);
  const auto bytes = aligned(1, size, field);
  std::string_view text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  if (!text.empty() && text.back() == '\0') {
    text.remove_suffix(1);
  }
  if (!base::is_utf8(text)) {
    fail(field, "UTF-8", "other bytes");
  }
  return std::string(text);
}

std::span<const std::byte> CdrReader::bytes(std::string_view field) {
  const std::uint32_t size = count(field, 1);
  return aligned(1, size, field);
}

std::uint32_t CdrReader::count(std::string_view field, std::size_t least_bytes) {
  const auto count = number<std::uint32_t>(field);
  const std::size_t rest = message_.size() - position_;
  if (count > rest / least_bytes) {
    fail(field, fmt::format("{} elements of {} bytes", count, least_bytes),
         fmt::format("{} bytes", rest));
  }
  return count;
}

void CdrReader::end() const {
  constexpr std::size_t kFillMax = 7;
  if (message_.size() - position_ > kFillMax) {
    fail("", "the end of the message", fmt::format("{} bytes more", message_.size() - position_));
  }
}

void CdrReader::fail(std::string_view field, const std::string& expected,
                     const std::string& found) const {
  throw CdrError(fmt::format("byte {}: {}{}expected {}, found {}", position_, field,
                             field.empty() ? "" : ": ", expected, found));
}

std::span<const std::byte> CdrReader::aligned(std::size_t alignment, std::size_t size,
                                              std::string_view field) {
  const std::size_t beyond = (position_ - kHeadBytes) % alignment;
  const std::size_t fill = beyond == 0 ? 0 : alignment - beyond;
  const std::size_t rest = message_.size() - position_;
  if (fill > rest || size > rest - fill) {
    fail(field, fmt::format("{} bytes", fill + size), fmt::format("{}", rest));
  }
  position_ += fill + size;
  return message_.subspan(position_ - size, size);
}

}  // namespace fastcycle::rosbag
