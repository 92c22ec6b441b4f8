#pragma once

#include <cstddef>
#include <string>
#include <string_view>

#include "broker/topics.h"

namespace fastcycle::detail {

// The topics of a service. Its messages are never lost for want of memory: how many there are is
// bounded by who calls. What is answered is as old as what was asked, and no news to who asked.
inline constexpr std::size_t kCallPoolMax = std::size_t{1} << 20U;
inline constexpr TopicOptions kRequestTopicOptions{.pool_max = kCallPoolMax,
                                                   .multiple_publishers = true};
inline constexpr TopicOptions kReplyTopicOptions{.ages = false, .pool_max = kCallPoolMax};
inline constexpr char kServiceMark = '#';  ///< Only their names have it.
inline constexpr std::string_view kRequestTopic = "#request";
[[nodiscard]] std::string request_topic(const std::string& service);
[[nodiscard]] std::string reply_topic(const std::string& service, const std::string& client);
[[nodiscard]] std::string feedback_topic(const std::string& service, const std::string& client);

}  // namespace fastcycle::detail
