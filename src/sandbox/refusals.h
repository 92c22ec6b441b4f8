#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "sandbox/options.h"

namespace fastcycle::sandbox {

/// Refused calls of one kind.
struct RefusedCall {
  std::string call;             ///< `socket`, or `mmap of executable memory`.
  std::uint32_t component = 0;  ///< Result of `SandboxOptions::who`.
  std::int32_t thread = 0;      ///< Id of the thread that made the last one.
  std::uint64_t count = 0;      ///< Since the last `take_refusals`.
};

/// The calls refused since the last call, in no order. Memory is bounded: at most 256 kinds,
/// further ones are counted as `other calls`.
///
/// The list is not tamper-proof: code in this process can write into it. The refusal of calls does
/// not depend on it.
///
/// @threads  Safe.
[[nodiscard]] std::vector<RefusedCall> take_refusals();

/// Why the filter refused a call; passed to the signal handler.
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

/// Installs the handler of SIGSYS, and unblocks the signal for the calling thread. False with
/// `errno` set on failure.
[[nodiscard]] bool install_refusal_handler(WhoCalls who) noexcept;

/// Whether `install_refusal_handler` was called in this process.
[[nodiscard]] bool is_refusal_handler_installed() noexcept;

/// Counts a refused call of the calling thread. Safe, also in a signal handler.
void note_refusal(Rule rule, int call) noexcept;

}  // namespace fastcycle::sandbox
