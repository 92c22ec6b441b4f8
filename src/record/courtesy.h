#pragma once

#include <chrono>
#include <cstdint>
#include <optional>

namespace fastcycle::record {

/// Decides when the thread that writes lets the application go first. It does while it keeps up
/// with what comes. Once something waited for longer than `kLate`, the application leaves it too
/// little: then it shares the CPUs as any thread does, until nothing was late for `kCalm`.
///
/// @threads  Confined.
class Courtesy {
 public:
  static constexpr std::chrono::milliseconds kLate{15};
  static constexpr std::chrono::milliseconds kCalm{1000};

  /// Whether it gives way from now on; `oldest_ns` is when the oldest of what waits to be written
  /// came, none if nothing waits. Times are those of CLOCK_MONOTONIC.
  [[nodiscard]] bool gives_way(std::int64_t now_ns, std::optional<std::int64_t> oldest_ns) {
    if (oldest_ns && now_ns - *oldest_ns > std::chrono::nanoseconds(kLate).count()) {
      late_ns_ = now_ns;
    }
    return !late_ns_ || now_ns - *late_ns_ > std::chrono::nanoseconds(kCalm).count();
  }

 private:
  std::optional<std::int64_t> late_ns_;  ///< When something was late last.
};

}  // namespace fastcycle::record
