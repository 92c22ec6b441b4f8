#pragma once

#include <optional>
#include <string>

namespace fastcycle::host {

/// Makes the process's memory unreadable to other processes of the same user, and keeps its
/// messages out of core dumps.
///
/// Returns an error if another process traces it already, which could read everything.
///
/// @threads  Called once, before any message exists and before other threads do.
[[nodiscard]] std::optional<std::string> protect_process();

/// Whether this process is protected: it called `protect_process`, or the kernel protects it
/// because its user cannot read the program's file.
///
/// @threads  Safe.
[[nodiscard]] bool is_protected();

/// Checks again, after foreign code has run. Returns an error if a process that was protected no
/// longer is, or if another process traces it.
///
/// @threads  Safe.
[[nodiscard]] std::optional<std::string> check_protection();

/// Removes the protection, so that debuggers may attach and a core dump may be written, also where
/// the kernel protects the process because its user cannot read the program's file.
/// @threads  Safe.
void unprotect_process();

}  // namespace fastcycle::host
