#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "broker/subscription.h"

namespace fastcycle::host {

/// One reason why messages of a synchronized subscription found no partners.
struct UnmatchedReport {
  /// "too_far", "depth", "overtaken", "late", "no_message"; "waits" for those still held.
  std::string reason = {};
  std::uint64_t count = 0;
  std::string topic = {};  ///< The topic without a matching message; empty: none in particular.
  std::optional<double> difference_ms = {};  ///< The smallest one to its messages, if any.
  std::string text = {};                     ///< The same, as a sentence.
};

/// Why messages of `subscription` found no partners; empty if it is not synchronized, or all found
/// theirs. Any thread, at any time.
[[nodiscard]] std::vector<UnmatchedReport> find_unmatched(const detail::Subscription& subscription);

}  // namespace fastcycle::host
