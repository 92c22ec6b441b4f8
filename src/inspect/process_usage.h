#pragma once

#include <cstdint>
#include <map>
#include <string>

namespace fastcycle::inspect {

/// What this process uses, as the kernel counts it; 0 where it does not say.
struct ProcessUsage {
  struct Threads {
    std::int64_t cpu_ns = 0;
    std::uint32_t count = 0;
  };

  std::int64_t cpu_ns = 0;
  std::int64_t resident_bytes = 0;
  std::int64_t virtual_bytes = 0;
  std::uint64_t open_files = 0;
  std::uint64_t max_files = 0;
  std::int64_t start_ns = 0;               ///< When it began, since 1970.
  std::map<std::string, Threads> threads;  ///< By their names.
};

/// Reads a file for each thread: some 20 µs for a thread.
///
/// @threads  Safe. Nobody who is counted is asked, or waits.
[[nodiscard]] ProcessUsage process_usage();

}  // namespace fastcycle::inspect
