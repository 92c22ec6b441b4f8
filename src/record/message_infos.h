#pragma once

#include <cstdint>
#include <span>
#include <string>

#include "mcap/records.h"

namespace fastcycle::record {

/// Facts about one message that its record has no field for; see docs/reference/log.md.
struct MessageFacts {
  std::uint16_t channel = 0;   ///< Channel id in the file.
  std::uint64_t sequence = 0;  ///< All 64 bits.
  std::int64_t age_ns = 0;     ///< When it was published, of its oldest measurement.
  std::uint64_t publisher = 0;
  std::uint64_t root = 0;  ///< Publisher of that measurement; 0: the message's own.
  bool held = false;       ///< The measurement was held since earlier.

  /// Whether they differ from what the message record itself implies.
  [[nodiscard]] bool are_needed() const;
};

/// The schema of `fastcycle/message_infos`, with this id.
[[nodiscard]] mcap::Schema infos_schema(std::uint16_t id);

/// The needed ones, as a message of that schema; empty if none is.
[[nodiscard]] std::string infos_of(std::span<const MessageFacts> messages);

}  // namespace fastcycle::record
