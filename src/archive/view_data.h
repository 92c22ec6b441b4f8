#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "archive/progress.h"
#include "archive/view.h"
#include "mcap/reader.h"

namespace fastcycle::archive {

struct ViewOptions {
  std::uint64_t begin_ns = 0;                ///< Of publish times.
  std::optional<std::uint64_t> end_ns = {};  ///< None: no end.
  /// What the times of the page count from; none: from the first message that is shown.
  std::optional<std::uint64_t> zero_ns = {};
  bool may_be_empty = false;  ///< No layer needs to have messages.
  std::uint64_t most_bytes = std::uint64_t{256} << 20U;
};

struct ViewData {
  std::string json;
  std::uint64_t messages = 0;
  std::vector<std::string> left_out = {};  ///< Layers of which the log has no messages as wanted.
};

/// What of a log a page is to show, picked as a view says:
///
///     {"layers": {"ego": {"topic": "localization/ego", "most_hz": 50,
///                         "fields": {"x": "x_m", "time": {"from": "header.taken_ns", "time":
///                         true}}}}}
///
/// Fields go by names of the page and come from fields of messages, by the schemas of the log. The
/// result is JSON: of each layer the `names` of its values, and its `messages`, each an array of
/// its publish time and its values. Times are seconds since the beginning; numbers are rounded.
/// docs/reference/page.md has it all.
///
/// `progress` is told of as much of `bytes` as of the time of the log is done.
///
/// @errors  `ViewMistake`. `std::runtime_error` if no layer has messages and one must, or more than
/// `most_bytes`
///          would be needed. `mcap::Error` of the log.
ViewData view_data(const mcap::Reader& reader, std::string_view view, const ViewOptions& options,
                   std::uint64_t bytes = 0, const Progress& progress = {});

}  // namespace fastcycle::archive
