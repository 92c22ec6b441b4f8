#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <vector>

#include "archive/progress.h"
#include "mcap/chunk_builder.h"
#include "mcap/error.h"
#include "mcap/file.h"
#include "mcap/topic_filter.h"

namespace fastcycle::archive {

/// Which messages are taken.
struct Selection {
  mcap::TopicFilter topics = {};
  std::uint64_t begin_ns = 0;                ///< From the first message of all inputs on.
  std::optional<std::uint64_t> end_ns = {};  ///< The same for the end, excluded.

  [[nodiscard]] bool is_everything() const {
    return topics.topics.empty() && topics.except.empty() && begin_ns == 0 && !end_ns;
  }
};

/// When to begin the next file. 0: never.
struct PieceSize {
  std::uint64_t bytes = 0;
  std::uint64_t time_ns = 0;  ///< From the first message of a piece, by log time.
};

/// Format options of files.
struct Layout {
  mcap::ChunkOptions chunk = {.compression = mcap::Compression::kLz4};
  std::uint64_t chunk_bytes = std::uint64_t{1} << 20U;
  bool has_index = true;  ///< Of chunks and of messages.
  PieceSize piece = {};
};

/// The result of `rewrite`.
struct Rewritten {
  std::uint64_t messages = 0;
  std::uint64_t files = 0;
  /// Inputs that were not closed, or whose summary is damaged: the readable part was taken.
  std::vector<mcap::Problem> problems = {};
};

/// Returns the sink of file number 1, 2, … of the output; the previous one is then complete.
using NextSink = std::function<mcap::Sink&(std::uint64_t number)>;

/// Writes the messages of all `inputs`, in the order of their log times; those of the same time in
/// the order of the inputs, and of their files. Equal schemas and channels are merged, others are
/// renumbered, also in `fastcycle.log.MessageInfos`.
///
/// Attachments and metadata are written before the messages, without duplicates. Each file has all
/// schemas and channels, all metadata, and attachments up to 1 MiB; larger ones are in the first
/// file only.
///
/// A selection includes its metadata: the parts of `fastcycle/message_infos` about its messages,
/// even if they are behind its end.
///
/// Memory: that of an `mcap::Reader`, for each input; one chunk.
///
/// @errors  `mcap::Error`, also a `Damage` of an input (see `recover`), and for an input that was
///          cut off before its first whole message.
Rewritten rewrite(std::span<const mcap::Source* const> inputs, const NextSink& next_sink,
                  const Layout& layout = {}, const Selection& selection = {},
                  const Progress& progress = {});

}  // namespace fastcycle::archive
