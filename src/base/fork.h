#pragma once

namespace fastcycle::base {

/// From now on `has_forked` tells a child of this process from the process itself. In such a child
/// it begins anew. Safe, and cheap after the first call.
void watch_forks() noexcept;

/// Whether this is a process that `fork` made of the one that called `watch_forks`: of all threads
/// only the one that forked is left, and the framework must not go on. Safe.
[[nodiscard]] bool has_forked() noexcept;

/// Called in the child, on the thread that forked, before `fork` returns there. Only what a signal
/// handler may do. One for the process; before threads are made.
void set_after_fork(void (*action)()) noexcept;

}  // namespace fastcycle::base
