#pragma once

#include <optional>

#include "base/thread.h"

namespace fastcycle::base {

/// Keeps every page of the process in memory from the moment it is touched, until the process ends:
/// for real-time threads, which must not wait for a page that was written to disk. Untouched
/// reservations cost nothing.
///
/// Asks for it only where the limit on locked memory cannot be met later: a limit that is reached
/// while driving would make allocations fail. Returns what the machine refused; none if it is done.
///
/// @threads  Safe.
[[nodiscard]] std::optional<Refusal> lock_memory_as_touched();

}  // namespace fastcycle::base
