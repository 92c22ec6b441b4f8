#pragma once

#include <optional>
#include <string>

namespace fastcycle::host {

/// Makes the process's memory unreadable to other processes of the same user, and keeps its
/// messages out of core dumps.
///
/// Returns why it must not go on, if another process traces it already: it could read everything.
///
/// @threads  Called once, before any message exists and before other threads do.
[[nodiscard]] std::optional<std::string> protect_process();

}  // namespace fastcycle::host
