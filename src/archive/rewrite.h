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
  std::optional<std::uint64_t> end_ns = {};  ///< The same for what all are before.

  [[nodiscard]] bool is_everything() const {
    return topics.topics.empty() && topics.except.empty() && begin_ns == 0 && !end_ns;
  }
};

/// When one file ends and the next one begins. 0: never.
struct PieceSize {
  std::uint64_t bytes = 0;
  std::uint64_t time_ns = 0;  ///< From the first message of a piece, by log time.
};

/// How files are written.
struct Layout {
  mcap::ChunkOptions chunk = {.compression = mcap::Compression::kLz4};
  std::uint64_t chunk_bytes = std::uint64_t{1} << 20U;
  bool has_index = true;  ///< Of chunks and of messages.
  PieceSize piece = {};
};

/// What became of the inputs.
struct Rewritten {
  std::uint64_t messages = 0;
  std::uint64_t files = 0;
  /// Inputs that were not closed, or whose summary is damaged: what could be read was taken.
  std::vector<mcap::Problem> problems = {};
};

/// Gives the place for file number 1, 2, … of the output; the one before is whole then.
using NextSink = std::function<mcap::Sink&(std::uint64_t number)>;

/// Writes the messages of all `inputs`, in the order of their log times; those of the same time in
/// the order of the inputs, and of their files. Schemas and channels that are the same become one,
/// others get another number, also where `fastcycle.log.MessageInfos` names them.
///
/// Attachments and metadata stand before the messages; what several inputs have, the same, stands
/// once. Each file has all schemas and channels, all metadata, and attachments up to 1 MiB; larger
/// ones are in the first alone.
///
/// A selection takes what explains it: of the topic `fastcycle/message_infos` what is about its
/// messages, also if that stands behind its end.
///
/// Memory: what `mcap::Reader` says, for each input; one chunk.
///
/// @errors  `mcap::Error`, also a `Damage` of an input (`recover` saves what there is), and for an
///          input that was cut off before its first whole message.
Rewritten rewrite(std::span<const mcap::Source* const> inputs, const NextSink& next_sink,
                  const Layout& layout = {}, const Selection& selection = {},
                  const Progress& progress = {});

}  // namespace fastcycle::archive
