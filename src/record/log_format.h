#pragma once

#include <cstdint>

namespace fastcycle::record {

// Names used in the files of a recording; docs/reference/log.md documents them.

inline constexpr const char* kActivationsTopic = "fastcycle/activations";
inline constexpr const char* kInfosTopic = "fastcycle/message_infos";
inline constexpr const char* kRunMetadata = "fastcycle.run";
inline constexpr const char* kEndMetadata = "fastcycle.end";

/// The default round of a message: the round of timer messages.
inline constexpr std::uint32_t kUsualStep = 1;

}  // namespace fastcycle::record
