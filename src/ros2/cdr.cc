#include "ros2/cdr.h"

#include <cstdint>
#include <limits>

#include <fmt/format.h>

#include "base/utf8.h"

namespace fastcycle::ros2 {
namespace {

std::size_t fill_of(std::size_t position, std::size_t alignment) {
  const std::size_t beyond = position % alignment;
  return beyond == 0 ? 0 : alignment - beyond;
}

std::string place(std::string_view type, std::size_t position, std::string_view field) {
  return fmt::format("{}{}byte {}: {}{}", type, type.empty() ? "" : ": ", position, field,
                     field.empty() ? "" : ": ");
}

}  // namespace

CdrReader::CdrReader(std::span<const std::byte> message, std::string_view type)
    : message_(message), type_(type) {
  if (message.size() < kEncapsulationBytes) {
    throw CdrError(fmt::format("{}{}expected {} bytes of encapsulation, found {}", type,
                               type.empty() ? "" : ": ", kEncapsulationBytes, message.size()));
  }
  const auto kind = static_cast<unsigned>(message[0]) << 8U | static_cast<unsigned>(message[1]);
  if (kind > 1) {
    throw CdrError(place(type_, 0, "") +
                   fmt::format("expected plain CDR, 0x0000 or 0x0001, found {:#06x}", kind));
  }
  is_swapped_ = (kind == 1) != (std::endian::native == std::endian::little);
}

std::string CdrReader::text(std::string_view field) {
  return std::string(view(field));
}

std::string_view CdrReader::view(std::string_view field) {
  const std::uint32_t size = count(field, 1);
  const auto bytes = aligned(1, size, field);
  std::string_view text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  if (!text.empty() && text.back() == '\0') {
    text.remove_suffix(1);
  }
  if (!base::is_utf8(text)) {
    fail(field, "UTF-8", "other bytes");
  }
  return text;
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

std::span<const std::byte> CdrReader::raw(std::string_view field, std::size_t count,
                                          std::size_t size) {
  if (count == 0) {
    return {};
  }
  if (count > (message_.size() - position_) / size) {
    fail(field, fmt::format("{} elements of {} bytes", count, size),
         fmt::format("{} bytes", message_.size() - position_));
  }
  return aligned(size, count * size, field);
}

void CdrReader::end() const {
  constexpr std::size_t kFillMax = 7;
  if (message_.size() - position_ > kFillMax) {
    fail("", "the end of the message", fmt::format("{} bytes more", message_.size() - position_));
  }
}

void CdrReader::fail(std::string_view field, std::string_view expected,
                     std::string_view found) const {
  throw CdrError(place(type_, position_, field) +
                 fmt::format("expected {}, found {}", expected, found));
}

std::span<const std::byte> CdrReader::aligned(std::size_t alignment, std::size_t size,
                                              std::string_view field) {
  const std::size_t fill = fill_of(position_ - kEncapsulationBytes, alignment);
  const std::size_t rest = message_.size() - position_;
  if (fill > rest || size > rest - fill) {
    fail(field, fmt::format("{} bytes", fill + size), fmt::format("{}", rest));
  }
  position_ += fill + size;
  return message_.subspan(position_ - size, size);
}

CdrWriter::CdrWriter(Buffer& out, std::string_view type) : out_(&out), type_(type) {
  std::byte* const head = out.grow(kEncapsulationBytes);
  std::memset(head, 0, kEncapsulationBytes);
  head[1] = static_cast<std::byte>(std::endian::native == std::endian::little);
  begin_ = out.size();
}

void CdrWriter::text(std::string_view text, std::string_view field) {
  count(text.size() + 1, field);
  std::byte* const to = aligned(1, text.size() + 1);
  std::memcpy(to, text.data(), text.size());
  to[text.size()] = std::byte{0};
}

void CdrWriter::bytes(std::string_view bytes, std::string_view field) {
  count(bytes.size(), field);
  array(std::span(bytes));
}

void CdrWriter::count(std::size_t count, std::string_view field) {
  if (count > std::numeric_limits<std::uint32_t>::max()) {
    fail(field, "at most 4294967295 elements", fmt::format("{}", count));
  }
  number(static_cast<std::uint32_t>(count));
}

std::byte* CdrWriter::raw(std::size_t count, std::size_t size) {
  return aligned(size, count * size);
}

void CdrWriter::end() {
  aligned(4, 0);
}

void CdrWriter::fail(std::string_view field, std::string_view expected,
                     std::string_view found) const {
  throw CdrError(place(type_, out_->size() - begin_ + kEncapsulationBytes, field) +
                 fmt::format("expected {}, found {}", expected, found));
}

std::byte* CdrWriter::aligned(std::size_t alignment, std::size_t size) {
  const std::size_t fill = fill_of(out_->size() - begin_, alignment);
  std::byte* const to = out_->grow(fill + size);
  std::memset(to, 0, fill);
  return to + fill;
}

}  // namespace fastcycle::ros2
