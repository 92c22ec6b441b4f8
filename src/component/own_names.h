#pragma once

namespace fastcycle::host {

// Names of FastCycle's own topics and components.
inline constexpr const char* kOwnName = "fastcycle";
inline constexpr const char* kOwnTopics = "fastcycle/";  ///< Prefix of its topics.
inline constexpr const char* kStatusTopic = "fastcycle/status";
inline constexpr const char* kLogTopic = "fastcycle/log";
inline constexpr const char* kLogName = "fastcycle/log";

}  // namespace fastcycle::host
