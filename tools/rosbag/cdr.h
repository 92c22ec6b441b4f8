#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <stdexcept>
#include <string>
#include <string_view>
#include <type_traits>

namespace fastcycle::rosbag {

/// Bytes that are no message of the type that they should be:
/// `byte 12: points: expected 16 bytes, found 3`.
class CdrError final : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// Reads a message in the Common Data Representation, as ROS 2 writes it: four bytes that say the
/// byte order, then values, each aligned to its size (OMG, *DDS Interoperability Wire Protocol*,
/// 10.2; classic CDR, called XCDR1 later).
///
/// @threads  Confined.
/// @errors   `CdrError` if the bytes end, a text is no UTF-8, or the representation is another one.
class CdrReader {
 public:
  /// `message` is borrowed.
  explicit CdrReader(std::span<const std::byte> message);

  template <typename T>
    requires std::is_arithmetic_v<T>
  T number(std::string_view field) {
    std::span<const std::byte> bytes = aligned(sizeof(T), sizeof(T), field);
    std::array<std::byte, sizeof(T)> ordered;
    std::memcpy(ordered.data(), bytes.data(), sizeof(T));
    if (is_swapped_) {
      std::ranges::reverse(ordered);
    }
    return std::bit_cast<T>(ordered);
  }
  template <typename T>
  void number(std::string_view field, T& into) {
    into = number<T>(field);
  }
  bool boolean(std::string_view field) { return number<std::uint8_t>(field) != 0; }
  std::string text(std::string_view field);
  /// Of a sequence of bytes; borrowed.
  std::span<const std::byte> bytes(std::string_view field);
  /// Of a sequence whose elements take at least `least_bytes` each: not more than there is room
  /// for.
  std::uint32_t count(std::string_view field, std::size_t least_bytes);

  /// That the message ends here, but for what fills it up.
  void end() const;

 private:
  [[noreturn]] void fail(std::string_view field, const std::string& expected,
                         const std::string& found) const;
  std::span<const std::byte> aligned(std::size_t alignment, std::size_t size,
                                     std::string_view field);

  static constexpr std::size_t kHeadBytes = 4;

  std::span<const std::byte> message_;
  std::size_t position_ = kHeadBytes;
  bool is_swapped_ = false;
};

}  // namespace fastcycle::rosbag
