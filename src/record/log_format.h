#pragma once

#include <cstdint>

namespace fastcycle::record {

// What is called how in the files of a recording; docs/reference/log.md says what it means.

inline constexpr const char* kActivationsTopic = "fastcycle/activations";
inline constexpr const char* kInfosTopic = "fastcycle/message_infos";
inline constexpr const char* kRunMetadata = "fastcycle.run";
inline constexpr const char* kEndMetadata = "fastcycle.end";

/// The round of a message that nothing is said of: where the messages of timers come.
inline constexpr std::uint32_t kUsualStep = 1;

}  // namespace fastcycle::record
