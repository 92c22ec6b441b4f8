#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "replay/field_changes.h"

namespace fastcycle::host {

/// How messages changed, by topic and field: for programs, and for people. Times are since
/// `begin_ns`.
[[nodiscard]] nlohmann::ordered_json json_of(const std::vector<TopicChange>& topics,
                                             std::int64_t begin_ns);
[[nodiscard]] std::string table_of(const std::vector<TopicChange>& topics, std::int64_t begin_ns);

}  // namespace fastcycle::host
