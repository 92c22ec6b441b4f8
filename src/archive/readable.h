#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "mcap/error.h"
#include "mcap/record_reader.h"
#include "mcap/records.h"
#include "mcap/writer.h"

namespace fastcycle::archive {

// Keeps output within the limits of readers (`mcap::ReadLimits`): the summary repeats the schemas
// and channels, and has all indexes; a chunk has at least one whole message.

inline constexpr std::uint64_t kMostDefinitionBytes = std::uint64_t{96} << 20U;
inline constexpr std::uint64_t kMostIndexBytes = std::uint64_t{128} << 20U;
using mcap::kMostMessageBytes;

/// @errors  `mcap::Error` about `file`, of which this is a copy, if its summary would be too large.
void require_readable(const mcap::Writer& writer, const std::string& file);

/// Rejects an input that ends before its first whole message: treating it as empty would hide the
/// loss.
///
/// @errors  `mcap::Error` with where it ends, if nothing was read of it although it has no end.
void require_messages(const std::optional<mcap::Problem>& problem, std::uint64_t messages);

/// Writes a message so that no chunk becomes too large.
///
/// @pre  `data.size() <= kMostMessageBytes`
void write_readably(mcap::Writer& writer, const mcap::MessageHead& head, mcap::Bytes data);

}  // namespace fastcycle::archive
