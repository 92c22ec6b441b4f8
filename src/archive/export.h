#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include "archive/progress.h"
#include "mcap/reader.h"

namespace fastcycle::archive {

struct TableOptions {
  std::string topic;
  std::size_t most_elements = 64;  ///< Maximum number of columns of a repeated field.
};

struct Table {
  std::uint64_t rows = 0;
  std::size_t columns = 0;
  std::vector<std::string> cut = {};  ///< Repeated fields with more elements than columns.
};

/// Writes the messages of a topic as a table, CSV as RFC 4180 has it, to `write`, row by row: first
/// the names of the columns. These are `log_time_ns`, `publish_time_ns`, `sequence`, and all fields
/// that are no messages: `pose.x`, `points[0].x`. Unset fields are empty; for bytes the size is
/// written.
///
/// The messages are read twice: first to determine the columns. `progress` receives the number of
/// messages, not of bytes, each counted twice.
///
/// @errors  `mcap::Error` if there is no such topic, its messages are no protobuf or of more than
/// one
///          type, one is damaged, or there would be more than 4096 columns.
Table export_table(const mcap::Reader& reader, const std::string& file, const TableOptions& options,
                   const std::function<void(std::string_view)>& write,
                   const Progress& progress = {});

}  // namespace fastcycle::archive
