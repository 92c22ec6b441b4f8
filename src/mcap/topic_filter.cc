#include "mcap/topic_filter.h"

#include <algorithm>

#include "base/pattern.h"

namespace fastcycle::mcap {

bool matches(std::string_view pattern, std::string_view topic) {
  return base::matches(pattern, topic);
}

bool TopicFilter::wants(std::string_view topic) const {
  const auto means_it = [&](const std::string& pattern) { return matches(pattern, topic); };
  return (topics.empty() || std::ranges::any_of(topics, means_it)) &&
         std::ranges::none_of(except, means_it);
}

}  // namespace fastcycle::mcap
