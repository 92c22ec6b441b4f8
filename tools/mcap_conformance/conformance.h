#pragma once

#include <nlohmann/json.hpp>

#include "mcap/file.h"

/// Converts between MCAP files and the JSON with which the public conformance suite of the format
/// describes them: a list of records, each with `type` and `fields`. Fields are pairs of name and
/// value, sorted by name; numbers are decimal strings, bytes are lists of such strings.
namespace fastcycle::conformance {

/// All records of the file except chunks and message indexes; the records of a chunk are listed in
/// its place.
///
/// @errors  `mcap::Error` if the file is incomplete or damaged.
[[nodiscard]] nlohmann::json read_records(const mcap::Source& source);

/// Writes the file that `description` describes: its `records` up to the end of the data section,
/// and the parts listed in `meta.variant.features`.
///
/// @errors  `std::runtime_error` that reports what cannot be written, and where in the description
/// it
///          is; `mcap::Error`.
void write_file(const nlohmann::json& description, mcap::Sink& sink);

}  // namespace fastcycle::conformance
