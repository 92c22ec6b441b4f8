#pragma once

#include <optional>

#include "base/thread.h"

namespace fastcycle::base {

/// Locks every page of the process in memory once it is touched: real-time threads must not wait
/// for paging. Untouched reservations cost nothing.
///
/// Does so only if the limit on locked memory cannot be reached later: a limit that is reached
/// while driving would make allocations fail. Returns what the machine refused; none on success.
///
/// @threads  Safe.
[[nodiscard]] std::optional<Refusal> lock_memory_as_touched();

}  // namespace fastcycle::base
