#pragma once

#include <sys/types.h>

namespace fastcycle::base {

/// A descriptor that `poll` reports once this child of the process has ended; the caller closes it.
/// −1 where there is none (Linux before 5.3, valgrind): then the caller polls for `kLookAgainMs` at
/// most, and asks `has_ended`. Safe.
[[nodiscard]] int open_child(pid_t child) noexcept;

/// Whether this child of the process has ended. Its exit status remains to be waited for. Safe.
[[nodiscard]] bool has_ended(pid_t child) noexcept;

/// How long to wait between two calls of `has_ended`, ms.
inline constexpr int kLookAgainMs = 5;

}  // namespace fastcycle::base
