#pragma once

#include <cstdint>
#include <vector>

#include <google/protobuf/message.h>

namespace fastcycle::segment {

/// Locations of the pointers in a message type, determined once by reflection: checks, without
/// reflection for each message, whether all of it is in shared memory of this process.
///
/// Unknown fields, maps and extensions are not examined: messages with any count as outside.
///
/// @threads  `of` is Safe; the rest is constant.
class Layout {
 public:
  enum class Verdict : std::uint8_t {
    kInside,    ///< All of it is in this process's segment.
    kRepaired,  ///< It is now: strings outside of it were moved.
    kOutside,   ///< Some of it is outside; it has to be copied.
  };

  /// The layout of the type of `message`, which is a generated one.
  static const Layout& of(const google::protobuf::Message& message);

  /// Checks `message`. Strings with contents outside of the segment are moved into it.
  /// @pre  The thread is in a scope of shared memory.
  [[nodiscard]] Verdict check(google::protobuf::Message& message) const;

  /// Why messages of this type are always copied; null if they are not.
  [[nodiscard]] const char* always_copied() const noexcept { return always_copied_; }

  /// Whether this layout agrees with reflection for a message that it fills: false if protobuf's
  /// memory layout differs from the expected one.
  [[nodiscard]] static bool holds_here();

 private:
  enum class Kind : std::uint8_t { kString, kMessage, kScalars, kStrings, kMessages };
  struct Place {
    Kind kind;
    std::uint32_t offset;
    std::uint32_t case_offset;  ///< 0 if it is in no oneof.
    std::uint32_t number;
    const Layout* child;
  };

  static const Layout& find_or_make(const google::protobuf::Message& message);
  void fill(const google::protobuf::Message& message);

  std::vector<Place> places_;
  std::uint32_t metadata_offset_ = 0;
  const char* always_copied_ = nullptr;
};

}  // namespace fastcycle::segment
