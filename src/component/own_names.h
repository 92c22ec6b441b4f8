#pragma once

namespace fastcycle::host {

// What FastCycle itself publishes, and the components of its own that do it.
inline constexpr const char* kOwnName = "fastcycle";
inline constexpr const char* kOwnTopics = "fastcycle/";  ///< What its topics begin with.
inline constexpr const char* kStatusTopic = "fastcycle/status";
inline constexpr const char* kLogTopic = "fastcycle/log";
inline constexpr const char* kLogName = "fastcycle/log";

}  // namespace fastcycle::host
