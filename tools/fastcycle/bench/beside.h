#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include <nlohmann/json.hpp>

#include "bench/application.h"
#include "bench/session.h"
#include "measure/row.h"

namespace fastcycle::tool::bench {

// What it costs an application that something else goes on beside it: the same source and sink,
// with it and without, in turn.

inline constexpr const char* kWithout = "without";

/// A source and a sink, each on an executor of its own, that write when each message was sent, and
/// how long `publish` took, into `folder`.
[[nodiscard]] Json application_beside(const Options& options, std::int64_t size,
                                      const std::string& wait, const std::string& folder);

/// What the two of such a run wrote; `what` goes on beside it.
[[nodiscard]] Finding finding_beside(const Session& session, std::string_view what,
                                     const std::string& wait, std::int64_t size,
                                     const Finished& finished);

/// A row that something goes on beside, the same as JSON, and that of the row without it.
using BesideVisitor = std::function<void(measure::Row& row, const nlohmann::json& with,
                                         const nlohmann::json& without)>;
/// Visits the rows of a round that something goes on beside.
void for_each_beside(std::vector<measure::Row>& rows, const BesideVisitor& visit);

/// Adds to the rows of a round, of whatever goes on beside them, how often they take the p99 of the
/// row without it: `publish_p99_us_ratio`, `p99_us_ratio`.
void add_ratios(std::vector<measure::Row>& rows);

}  // namespace fastcycle::tool::bench
