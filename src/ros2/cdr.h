#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <string>
#include <string_view>
#include <type_traits>

#include "ros2/buffer.h"
#include "ros2/error.h"

namespace fastcycle::ros2 {

/// Size of the encapsulation header of a message in the Common Data Representation.
inline constexpr std::size_t kEncapsulationBytes = 4;

/// Reads a message in the Common Data Representation, as ROS 2 writes it: four bytes with the byte
/// order, then values, each aligned to its size (OMG, *DDS Interoperability Wire Protocol*, 10.2;
/// classic CDR, called XCDR1 later). Every length is checked against the remaining bytes before it
/// is used.
///
/// @threads  Confined.
/// @errors   `CdrError` if the bytes end, a text is no UTF-8, or the representation is unsupported.
class CdrReader {
 public:
  /// Borrows `message` and `type`; errors contain the type.
  explicit CdrReader(std::span<const std::byte> message, std::string_view type = {});

  template <typename T>
    requires std::is_arithmetic_v<T>
  T number(std::string_view field) {
    T value;
    copy(aligned(sizeof(T), sizeof(T), field).data(), &value, 1);
    return value;
  }
  template <typename T>
  void number(std::string_view field, T& into) {
    into = number<T>(field);
  }
  bool boolean(std::string_view field) { return number<std::uint8_t>(field) != 0; }
  std::string text(std::string_view field);
  /// As `text`, without a copy; borrowed.
  std::string_view view(std::string_view field);
  /// Of a sequence of bytes; borrowed.
  std::span<const std::byte> bytes(std::string_view field);
  /// Of a sequence whose elements take at least `least_bytes` each: checked against the remaining
  /// bytes.
  std::uint32_t count(std::string_view field, std::size_t least_bytes);
  /// `count` numbers of `size` bytes each, in the message's byte order; borrowed.
  std::span<const std::byte> raw(std::string_view field, std::size_t count, std::size_t size);
  /// `count` numbers of `raw`'s result, in host byte order.
  template <typename T>
  void copy(const std::byte* from, T* to, std::size_t count) const {
    std::memcpy(to, from, count * sizeof(T));
    if (is_swapped_ && sizeof(T) > 1) {
      for (std::size_t i = 0; i < count; ++i) {
        auto* const bytes = reinterpret_cast<std::byte*>(to + i);
        std::reverse(bytes, bytes + sizeof(T));
      }
    }
  }
  /// Checks that the message ends here, except for padding.
  void end() const;

  /// Throws a `CdrError` for the place read last.
  [[noreturn]] void fail(std::string_view field, std::string_view expected,
                         std::string_view found) const;

 private:
  std::span<const std::byte> aligned(std::size_t alignment, std::size_t size,
                                     std::string_view field);

  std::span<const std::byte> message_;
  std::string_view type_;
  std::size_t position_ = kEncapsulationBytes;
  bool is_swapped_ = false;
};

/// Writes a message in the same representation, in host byte order, after the contents of `out`,
/// which it treats as another message.
///
/// @threads  Confined.
/// @realtime Allocates when `out` grows.
class CdrWriter {
 public:
  /// Borrows `out` and `type`; errors contain the type.
  explicit CdrWriter(Buffer& out, std::string_view type = {});

  template <typename T>
    requires std::is_arithmetic_v<T>
  void number(T value) {
    std::memcpy(aligned(sizeof(T), sizeof(T)), &value, sizeof(T));
  }
  void boolean(bool value) { number<std::uint8_t>(value ? 1 : 0); }
  void text(std::string_view text, std::string_view field = {});
  /// A sequence of bytes.
  void bytes(std::string_view bytes, std::string_view field = {});
  /// The count of a sequence.
  void count(std::size_t count, std::string_view field = {});
  /// Reserves `count` numbers of `size` bytes each in the message, to be filled by the caller.
  std::byte* raw(std::size_t count, std::size_t size);
  /// The numbers of a sequence or an array, without a count.
  template <typename T>
  void array(std::span<const T> values) {
    if (!values.empty()) {
      std::memcpy(raw(values.size(), sizeof(T)), values.data(), values.size_bytes());
    }
  }
  /// Pads the message to a multiple of four bytes, as it is sent.
  void end();

  [[noreturn]] void fail(std::string_view field, std::string_view expected,
                         std::string_view found) const;

 private:
  std::byte* aligned(std::size_t alignment, std::size_t size);

  Buffer* out_;
  std::string_view type_;
  std::size_t begin_;  // Origin of alignment.
};

}  // namespace fastcycle::ros2
