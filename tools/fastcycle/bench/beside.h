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

// The cost to an application of concurrent activity: the same source and sink with and without it,
// in turn.

inline constexpr const char* kWithout = "without";

/// A source and a sink, each on its own executor, that write the send time of each message and the
/// duration of `publish` into `folder`.
[[nodiscard]] Json application_beside(const Options& options, std::int64_t size,
                                      const std::string& wait, const std::string& folder);

/// The samples of the two in such a run; `what` is the concurrent activity.
[[nodiscard]] Finding finding_beside(const Session& session, std::string_view what,
                                     const std::string& wait, std::int64_t size,
                                     const Finished& finished);

/// A row with concurrent activity, the same row as JSON, and the JSON of the row without it.
using BesideVisitor = std::function<void(measure::Row& row, const nlohmann::json& with,
                                         const nlohmann::json& without)>;
/// Visits the rows of a round that have concurrent activity.
void for_each_beside(std::vector<measure::Row>& rows, const BesideVisitor& visit);

/// Adds to those rows the ratio of their p99 to the p99 of the row without concurrent activity:
/// `publish_p99_us_ratio`, `p99_us_ratio`.
void add_ratios(std::vector<measure::Row>& rows);

}  // namespace fastcycle::tool::bench
