#pragma once

namespace fastcycle::base {

/// Enables `has_forked` to detect children of this process. Called in a child, it makes that a
/// process of its own. Safe, and cheap after the first call.
void watch_forks() noexcept;

/// Whether this is a forked child of the process that called `watch_forks`: it has only the thread
/// that forked, and the framework must not continue. Safe.
[[nodiscard]] bool has_forked() noexcept;

/// Called in the child, on the thread that forked, before `fork` returns there. It must be
/// async-signal-safe. One for the process; set before threads are created.
void set_after_fork(void (*action)()) noexcept;

}  // namespace fastcycle::base
