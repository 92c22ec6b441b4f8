#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "archive/progress.h"
#include "mcap/chunk_builder.h"
#include "mcap/error.h"
#include "mcap/file.h"
#include "mcap/record_reader.h"

namespace fastcycle::archive {

struct RecoverOptions {
  mcap::ChunkOptions chunk = {.compression = mcap::Compression::kLz4};  ///< Of the output.
  mcap::ReadLimits limits = {};
};

/// Messages, attachments and metadata of a file: how many, and a CRC over all of a kind, in the
/// order of the file.
struct ContentSum {
  std::uint64_t messages = 0;
  std::uint64_t attachments = 0;
  std::uint64_t metadata = 0;
  std::uint32_t messages_crc = 0;
  std::uint32_t attachments_crc = 0;
  std::uint32_t metadata_crc = 0;

  bool operator==(const ContentSum&) const = default;
};

/// A part of the file that was lost.
struct Loss {
  mcap::Problem problem;
  std::uint64_t bytes = 0;  ///< Of the file; 0 if it is a record within a chunk.
  /// How many messages were there, if the following indexes have it.
  std::optional<std::uint64_t> messages = {};
};

/// The result of a recovery.
struct Recovery {
  /// Limit of listed losses, and of mended problems.
  static constexpr std::size_t kMostListed = 1000;

  ContentSum kept = {};
  std::vector<Loss> losses = {};  ///< In the order of the file.
  std::uint64_t loss_count = 0;
  std::uint64_t lost_bytes = 0;
  std::uint64_t lost_messages = 0;  ///< As far as known.
  /// Problems without loss, since the part was regenerated: a missing end, an index.
  std::vector<mcap::Problem> mended = {};

  /// Whether the file was damaged, and nothing was found in it.
  [[nodiscard]] bool is_hopeless() const {
    const bool has_content = kept.messages + kept.attachments + kept.metadata > 0;
    return !has_content && (loss_count > 0 || !mended.empty());
  }
};

/// Writes the readable part of `in` to `out`, as a valid file: every whole record, with new chunks,
/// indexes and a summary.
///
/// A chunk with a wrong CRC is dropped as a whole: its correct bytes cannot be identified. After a
/// wrong length, reading continues at the next chunk that can be found.
///
/// Memory: a record, an uncompressed chunk, schemas and channels, the indexes of `out`.
///
/// @errors  `mcap::Error` if `in` cannot be read, or `out` not be written; what is wrong with the
///          content of `in` is in the result.
[[nodiscard]] Recovery recover(const mcap::Source& in, mcap::Sink& out,
                               const RecoverOptions& options = {}, const Progress& progress = {});

/// Reads all of `file`, sequentially and by index, and compares it with what was written to it.
///
/// @errors  `mcap::Error` if it is invalid, or has another content.
void verify(const mcap::Source& file, const ContentSum& written, const Progress& progress = {});

}  // namespace fastcycle::archive
