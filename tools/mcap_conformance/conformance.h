#pragma once

#include <nlohmann/json.hpp>

#include "mcap/file.h"

/// Between MCAP files and the JSON with which the public conformance suite of the format describes
/// them: a list of records, each with `type` and `fields`. Fields are pairs of name and value,
/// sorted by name; numbers are texts in decimal, bytes are lists of such texts.
namespace fastcycle::conformance {

/// All records of the file but chunks and message indexes, what is in a chunk in its place.
///
/// @errors  `mcap::Error` if the file is not whole and in order.
[[nodiscard]] nlohmann::json read_records(const mcap::Source& source);

/// Writes the file that `description` tells of: its `records` up to the end of the data section,
/// and the parts that `meta.variant.features` names.
///
/// @errors  `std::runtime_error` that says what of the description cannot be written, and where it
///          stands; `mcap::Error`.
void write_file(const nlohmann::json& description, mcap::Sink& sink);

}  // namespace fastcycle::conformance
