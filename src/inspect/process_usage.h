#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>

#include <sys/types.h>

namespace fastcycle::inspect {

/// Resource usage of a process as the kernel reports it; 0 where it does not.
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
  std::int64_t start_ns = 0;  ///< Start time, since 1970.
  pid_t parent = 0;
  std::map<std::string, Threads> threads;  ///< By thread name.
};

/// Reads one file per thread: about 20 µs per thread.
///
/// @threads  Safe. Does not involve or block the other threads.
[[nodiscard]] ProcessUsage process_usage();
/// The same of another process, without `max_files`; none if there is none. `open_files` is 0 for a
/// process that the kernel protects from this one.
[[nodiscard]] std::optional<ProcessUsage> process_usage(pid_t pid);

}  // namespace fastcycle::inspect
