#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "replay/field_changes.h"

namespace fastcycle::host {

/// Changes of messages, by topic and field, as JSON and as text. Times are since `begin_ns`.
[[nodiscard]] nlohmann::ordered_json json_of(const std::vector<TopicChange>& topics,
                                             std::int64_t begin_ns);
[[nodiscard]] std::string table_of(const std::vector<TopicChange>& topics, std::int64_t begin_ns);

}  // namespace fastcycle::host
