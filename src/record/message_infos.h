#pragma once

#include <cstdint>
#include <span>
#include <string>

#include "mcap/records.h"

namespace fastcycle::record {

/// What a log says of one message beside its record; docs/reference/log.md says what it means.
struct MessageFacts {
  std::uint16_t channel = 0;   ///< As in the file.
  std::uint64_t sequence = 0;  ///< All 64 bits.
  std::int64_t age_ns = 0;     ///< When it was published, of the oldest measurement behind it.
  std::uint64_t publisher = 0;
  std::uint64_t root = 0;  ///< The publisher of that measurement; 0: the message's own.
  bool held = false;       ///< The measurement was held since earlier.

  /// Whether there is anything that the message record itself does not say.
  [[nodiscard]] bool are_needed() const;
};

/// The schema of `fastcycle/message_infos`, with this id.
[[nodiscard]] mcap::Schema infos_schema(std::uint16_t id);

/// Those that are needed, as a message of that schema; empty if none is.
[[nodiscard]] std::string infos_of(std::span<const MessageFacts> messages);

}  // namespace fastcycle::record
