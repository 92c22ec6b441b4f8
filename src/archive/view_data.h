#pragma once

#include <cstdint>
#include <optional>
#include <span>
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
  /// Zero of the page's times; none: the first message that is shown.
  std::optional<std::uint64_t> zero_ns = {};
  bool may_be_empty = false;  ///< No layer needs to have messages.
  std::uint64_t most_bytes = std::uint64_t{256} << 20U;
};

struct ViewData {
  std::string json;
  std::uint64_t messages = 0;
  std::vector<std::string> left_out = {};  ///< Layers without matching messages in the log.
};

/// The log time of the earliest message in all files; 0 without any.
std::uint64_t first_message_ns(std::span<const mcap::Reader* const> files);

/// The data of a log, of one or several files, for a page, selected by a view:
///
///     {"layers": {"ego": {"topic": "localization/ego", "most_hz": 50,
///                         "fields": {"x": "x_m", "time": {"from": "header.taken_ns", "time":
///                         true}}}}}
///
/// Names of the page are mapped to fields of messages, by the schemas of the log. The result is
/// JSON: for each layer the `names` of its values, and its `messages`, each an array of its publish
/// time and its values. Times are seconds since the beginning; numbers are rounded. See
/// docs/reference/page.md.
///
/// `progress` receives the part of `bytes` in proportion to the processed time of the log.
///
/// @errors  `ViewError`. `std::runtime_error` if no layer has messages and one must, or more than
/// `most_bytes`
///          would be needed. `mcap::Error` of the log.
ViewData view_data(std::span<const mcap::Reader* const> files, std::string_view view,
                   const ViewOptions& options, std::uint64_t bytes = 0,
                   const Progress& progress = {});

}  // namespace fastcycle::archive
