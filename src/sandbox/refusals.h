#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "sandbox/options.h"

namespace fastcycle::sandbox {

/// Refused calls of one kind.
struct RefusedCall {
  std::string call;             ///< `socket`, or `mmap of executable memory`.
  std::uint32_t component = 0;  ///< What `SandboxOptions::who` said.
  std::int32_t thread = 0;      ///< The number of the thread that made the last one.
  std::uint64_t count = 0;      ///< Since they were taken last.
};

/// The calls that were refused since this was called last, in no order. Memory for them is bounded:
/// at most 256 kinds, what is beyond is of the kind `other calls`.
///
/// What it says is for the honest: code that runs in this process can write into its list. That a
/// call is refused does not depend on it.
///
/// @threads  Safe.
[[nodiscard]] std::vector<RefusedCall> take_refusals();

/// Why the filter refused a call: what it gives to the signal handler.
enum class Rule : std::uint16_t {
  kCall,  ///< The call itself, whatever its arguments are.
  kFork,
  kNamespace,
  kExecutable,
  kTruncate,
  kForeignSignal,
  kForeignPriority,
  kForeignLimits,
  kSigsysHandler,
  kRequest,
  kExecutableFile,
  kForeignArchitecture,
  kSpawn,
  kCount,
};

/// Installs the handler of SIGSYS, and lets the calling thread receive it. False with `errno` set
/// if the system refuses.
[[nodiscard]] bool install_refusal_handler(WhoCalls who) noexcept;

/// Whether `install_refusal_handler` was called in this process.
[[nodiscard]] bool is_refusal_handler_installed() noexcept;

/// Counts a refused call of the calling thread. Safe, also in a signal handler.
void note_refusal(Rule rule, int call) noexcept;

}  // namespace fastcycle::sandbox
