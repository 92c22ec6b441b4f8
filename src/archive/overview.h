#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "archive/progress.h"
#include "mcap/error.h"
#include "mcap/file.h"
#include "mcap/records.h"

namespace fastcycle::archive {

/// A topic's messages that are missing in a log, as counted in it.
struct TopicLoss {
  std::uint64_t published = 0;
  std::uint64_t recorded = 0;
  std::uint64_t lost = 0;
  std::map<std::string, std::uint64_t> reasons = {};  ///< Those that are not 0.
};

struct TopicOverview {
  std::set<std::string> types = {};  ///< Names of schemas.
  std::set<std::string> encodings = {};
  std::uint64_t channels = 0;
  std::uint64_t messages = 0;
  std::optional<std::uint64_t> bytes = {};  ///< Of their data; set if everything was read.
  std::optional<TopicLoss> loss = {};
};

struct ChunkOverview {
  std::uint64_t count = 0;
  std::uint64_t compressed_bytes = 0;
  std::uint64_t uncompressed_bytes = 0;
};

/// A summary of a file.
struct Overview {
  std::string file;
  std::uint64_t bytes = 0;
  mcap::Header header = {};
  mcap::Statistics statistics = {};
  std::map<std::string, TopicOverview> topics = {};
  std::map<std::string, ChunkOverview> chunks = {};  ///< By compression.
  std::vector<mcap::AttachmentIndex> attachments = {};
  std::vector<mcap::Metadata> metadata = {};  ///< The first of them, up to 1 MiB.

  bool was_scanned = false;  ///< Its summary is missing or insufficient.
  bool was_read = false;     ///< Everything was read, and checked.
  /// Set if the file has no end, or is damaged. The other members have what could be read.
  std::optional<mcap::Problem> problem = {};
};

struct OverviewOptions {
  /// Files up to this size are read whole, others by their summary.
  std::uint64_t read_whole_bytes = std::uint64_t{256} << 20U;
};

/// Summarizes an MCAP file, also one that was not closed.
///
/// @errors  `mcap::Error` if it cannot be read, a `Damage` if its content is wrong before its data
///          ends.
[[nodiscard]] Overview overview(const mcap::Source& file, const OverviewOptions& options = {},
                                const Progress& progress = {});

/// The files of a recording: `name` itself if there is such a file; else those it was split into,
/// `NAME_0001.mcap` and so on, in order, including those that are still `.active`; else `name`.
[[nodiscard]] std::vector<std::filesystem::path> files_of_recording(
    const std::filesystem::path& name);

}  // namespace fastcycle::archive
