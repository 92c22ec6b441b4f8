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

/// What a message in the Common Data Representation begins with: which representation it is.
inline constexpr std::size_t kEncapsulationBytes = 4;

/// Reads a message in the Common Data Representation, as ROS 2 writes it: four bytes that say the
/// byte order, then values, each aligned to its size (OMG, *DDS Interoperability Wire Protocol*,
/// 10.2; classic CDR, called XCDR1 later). Every length is compared with the bytes that are left
/// before anything is made of it.
///
/// @threads  Confined.
/// @errors   `CdrError` if the bytes end, a text is no UTF-8, or the representation is another one.
class CdrReader {
 public:
  /// `message` and `type`, which errors name, are borrowed.
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
  /// Of a sequence whose elements take at least `least_bytes` each: not more than there is room
  /// for.
  std::uint32_t count(std::string_view field, std::size_t least_bytes);
  /// `count` numbers of `size` bytes each, in the message's order of bytes; borrowed.
  std::span<const std::byte> raw(std::string_view field, std::size_t count, std::size_t size);
  /// `count` numbers of what `raw` gave, in the order of this machine.
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
  /// That the message ends here, but for what fills it up.
  void end() const;

  /// Throws a `CdrError` of the place that was read last.
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

/// Writes a message in the same representation, in the byte order of this machine, behind what
/// `out` has; what `out` has is taken for another message.
///
/// @threads  Confined.
/// @realtime Allocates where `out` grows.
class CdrWriter {
 public:
  /// `out` and `type`, which errors name, are borrowed.
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
  /// Of a sequence.
  void count(std::size_t count, std::string_view field = {});
  /// `count` numbers of `size` bytes each, to be filled by the caller: room in the message itself.
  std::byte* raw(std::size_t count, std::size_t size);
  /// The numbers of a sequence or an array, without their count.
  template <typename T>
  void array(std::span<const T> values) {
    if (!values.empty()) {
      std::memcpy(raw(values.size(), sizeof(T)), values.data(), values.size_bytes());
    }
  }
  /// Fills the message up to a multiple of four bytes, as it is sent.
  void end();

  [[noreturn]] void fail(std::string_view field, std::string_view expected,
                         std::string_view found) const;

 private:
  std::byte* aligned(std::size_t alignment, std::size_t size);

  Buffer* out_;
  std::string_view type_;
  std::size_t begin_;  // Of what alignment counts from.
};

}  // namespace fastcycle::ros2
