#pragma once

#include <cstddef>
#include <string>
#include <string_view>

#include "broker/topics.h"

namespace fastcycle::detail {

// The topics of a service. Its messages are never lost for lack of memory: their number is bounded
// by the callers. An answer has the age of its request.
inline constexpr std::size_t kCallPoolMax = std::size_t{1} << 20U;
inline constexpr TopicOptions kRequestTopicOptions{.pool_max = kCallPoolMax,
                                                   .multiple_publishers = true};
inline constexpr TopicOptions kReplyTopicOptions{.ages = false, .pool_max = kCallPoolMax};
inline constexpr char kServiceMark = '#';  ///< Occurs only in their names.
inline constexpr std::string_view kRequestTopic = "#request";
[[nodiscard]] std::string request_topic(const std::string& service);
[[nodiscard]] std::string reply_topic(const std::string& service, const std::string& client);
[[nodiscard]] std::string feedback_topic(const std::string& service, const std::string& client);

}  // namespace fastcycle::detail
