#pragma once

#include <concepts>
#include <cstdint>

#include <google/protobuf/message.h>

#include "fastcycle/time.h"

namespace fastcycle {

/// The type of a topic: a generated protobuf message.
template <typename T>
concept Message = std::derived_from<T, google::protobuf::Message> && std::default_initializable<T>;

/// Identifies a publisher: derived from its component's name and its topic, the same in every run.
using PublisherId = std::uint64_t;

/// When and by whom the oldest measurement was taken that led to a message.
struct Origin {
  Time taken{};          ///< The oldest taken time of all inputs.
  PublisherId root = 0;  ///< The publisher of that measurement; 0 means nothing was measured.
  bool held = false;     ///< True if it was not the cause itself, but an input held since earlier.
};

/// Metadata of one published message.
struct MessageInfo {
  std::uint64_t sequence = 0;  ///< Counts the publisher's messages, from 1, without gaps.
  Time publish_time{};         ///< When it was published; never decreases within one publisher.
  /// The publisher.
  PublisherId publisher = 0;
  /// The oldest measurement that led to it.
  Origin origin{};
};

}  // namespace fastcycle
