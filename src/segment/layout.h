#pragma once

#include <cstdint>
#include <vector>

#include <google/protobuf/message.h>

namespace fastcycle::segment {

/// Where the pointers of a message type lie, found once by reflection: says, without a call of
/// reflection for a message, whether all of it lies in the memory that this process shares.
///
/// Unknown fields, maps and extensions are not looked into: who has some lies outside.
///
/// @threads  `of` is Safe; the rest is constant.
class Layout {
 public:
  enum class Verdict : std::uint8_t {
    kInside,    ///< All of it lies in this process's segment.
    kRepaired,  ///< It does now: strings that lay outside were moved.
    kOutside,   ///< Some of it lies outside; it has to be copied.
  };

  /// The layout of the type of `message`, which is a generated one.
  static const Layout& of(const google::protobuf::Message& message);

  /// Looks at `message`. Strings whose contents lie outside are moved into the segment.
  /// @pre  The thread is in a scope of shared memory.
  [[nodiscard]] Verdict check(google::protobuf::Message& message) const;

  /// Why messages of this type are copied each time; null if they need not be.
  [[nodiscard]] const char* always_copied() const noexcept { return always_copied_; }

  /// Whether this table finds what reflection finds, of a message that it fills: false where
  /// protobuf lays messages out in another way than this expects.
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
