#pragma once

#include <cstdint>
#include <functional>

#include "archive/progress.h"
#include "mcap/error.h"
#include "mcap/file.h"
#include "mcap/record_reader.h"

namespace fastcycle::archive {

/// A defect of a file.
struct Finding {
  bool is_warning = false;  ///< Unusual, but readers accept it.
  mcap::Problem problem;
};

struct Diagnosis {
  /// Limit of reported errors, and of warnings; all are counted.
  static constexpr std::uint64_t kReportedMax = 1000;

  std::uint64_t errors = 0;
  std::uint64_t warnings = 0;
  std::uint64_t messages = 0;
  std::uint64_t chunks = 0;
};

/// Reads all of a file, checks it, and reports findings immediately:
///
/// - all CRCs, the order of the records, that they are whole and that the file was closed;
/// - that times and indexes of chunks are those of their messages;
/// - that the summary matches the file: schemas, channels, statistics, indexes, offsets (not
///   checked if anything before it is damaged);
/// - that schemas of protobuf are complete and that every message is one of its schema;
/// - per channel: decreasing log times, missing numbers (warnings);
/// - that the losses counted in the log are consistent.
///
/// Memory: a record, an uncompressed chunk with 16 bytes for each of its messages, schemas and
/// channels, and the index of the file, up to `ReadLimits::index_bytes`.
///
/// @errors  `mcap::Error` if the file cannot be read.
Diagnosis diagnose(const mcap::Source& file, const std::function<void(const Finding&)>& report,
                   const mcap::ReadLimits& limits = {}, const Progress& progress = {});

}  // namespace fastcycle::archive
