#pragma once

#include <cstdint>
#include <string>

#include "mcap/records.h"
#include "mcap/writer.h"

namespace fastcycle::archive {

// What is written stays within what readers take (`mcap::ReadLimits`): the summary has the schemas
// and channels once more, and all indexes; a chunk has at least one whole message.

inline constexpr std::uint64_t kMostDefinitionBytes = std::uint64_t{96} << 20U;
inline constexpr std::uint64_t kMostIndexBytes = std::uint64_t{128} << 20U;
inline constexpr std::uint64_t kMostMessageBytes = (std::uint64_t{512} << 20U) - 1024;

/// @errors  `mcap::Error` about `file`, of which this is a copy, if its summary would be too large.
void require_readable(const mcap::Writer& writer, const std::string& file);

/// Writes a message so that no chunk becomes too large.
///
/// @pre  `data.size() <= kMostMessageBytes`
void write_readably(mcap::Writer& writer, const mcap::MessageHead& head, mcap::Bytes data);

}  // namespace fastcycle::archive
