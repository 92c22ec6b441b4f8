#pragma once

#include <optional>

#include "base/thread.h"
#include "sandbox/options.h"

namespace fastcycle::sandbox {

/// Permanently denies the calling process what a computing component does not need: files other
/// than those that `options` name, sockets, other programs and processes, new machine code, and
/// everything that changes the machine. docs/reference/sandbox.md lists what is left. A refused
/// call fails with EPERM, and is counted for `take_refusals` (refusals.h).
///
/// Call when the libraries are loaded and before a component runs. The process must have one
/// thread: the kernel restricts files by thread, and later threads inherit the restrictions.
///
/// Returns what the machine lacks or refuses; none if everything is in force. After an error the
/// process may be partially restricted, and must not run components.
///
/// @threads  The only thread of the process.
[[nodiscard]] std::optional<base::Refusal> apply_sandbox(const SandboxOptions& options);

}  // namespace fastcycle::sandbox
