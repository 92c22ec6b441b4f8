#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include <nlohmann/json.hpp>

#include "inspect/inspect.pb.h"

namespace fastcycle::web {

/// Format of metrics.
enum class MetricsFormat : std::uint8_t {
  kText,         ///< Prometheus's text format 0.0.4.
  kOpenMetrics,  ///< OpenMetrics 1.0.
};

/// The format for the header `Accept`: OpenMetrics if it contains that.
[[nodiscard]] MetricsFormat choose_format(std::string_view accept);
[[nodiscard]] std::string_view content_type(MetricsFormat format);

/// Counters of the live server itself.
struct ServedCounts {
  std::uint64_t connections = 0;  ///< Open now.
  std::uint64_t connections_refused = 0;
  std::uint64_t messages_left_out = 0;  ///< Dropped because of slow clients.
};

/// Metrics of an application for Prometheus; their names are in docs/reference/metrics.md.
///
/// `overview` has histograms with their buckets; `chains` is the document of that name, null if the
/// application has none.
[[nodiscard]] std::string to_metrics(const inspect::protocol::Overview& overview,
                                     const nlohmann::json& chains, const ServedCounts& served,
                                     MetricsFormat format);

}  // namespace fastcycle::web
