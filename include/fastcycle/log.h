#pragma once

#include <cstdint>
#include <string_view>
#include <utility>

#include <fmt/format.h>

#include "fastcycle/time.h"

namespace fastcycle {

enum class LogLevel : std::uint8_t { kDebug, kInfo, kWarning, kError };

namespace detail {
class LogSource;
/// Formats one line and hands it to the log's own thread; a full queue drops it and counts it. With
/// a `period` above 0 only if the same text was not written within that time. Not inline, so that
/// components need not compile the formatting.
void write_log(LogSource& source, LogLevel level, Duration period, fmt::string_view text,
               fmt::format_args args);
}  // namespace detail

/// Writes lines for people, each with its time, its level and the component's name.
///
///     log().info("the lane is {:.1f} m wide", width);
///     log().throttle(1s).warning("no lane for {} ms", age_ms);
///
/// Lines below the component's level (`"log_level"`, `--log-level`; info unless given) are not even
/// formatted. docs/reference/log_lines.md has the format, and the topic `fastcycle/log`.
///
/// @threads  Safe.
/// @realtime Formats on the caller's stack (a line is cut at 400 bytes) and puts it into a bounded
///           queue: no allocation, no lock, no file access. Lines that find the queue full are
///           counted; the count is logged once a second.
class Log {
 public:
  /// Constructed by `Component::log`; `source` outlives it.
  explicit Log(detail::LogSource& source) : source_(&source) {}

  /// The same log, which writes each text at most once in `period` of the application's time. The
  /// next line with it states how many were suppressed. A text is the format string; the component
  /// tracks the first 32 of them separately, and all others together.
  [[nodiscard]] Log throttle(Duration period) const {
    Log throttled(*this);
    throttled.period_ = period;
    return throttled;
  }

  /// For developers of the component.
  template <typename... Args>
  void debug(fmt::format_string<Args...> text, Args&&... args) const {
    write(LogLevel::kDebug, text, std::forward<Args>(args)...);
  }
  /// For users of the application.
  template <typename... Args>
  void info(fmt::format_string<Args...> text, Args&&... args) const {
    write(LogLevel::kInfo, text, std::forward<Args>(args)...);
  }
  /// Something is wrong, but the component continues.
  template <typename... Args>
  void warning(fmt::format_string<Args...> text, Args&&... args) const {
    write(LogLevel::kWarning, text, std::forward<Args>(args)...);
  }
  /// The component cannot do part of its work.
  template <typename... Args>
  void error(fmt::format_string<Args...> text, Args&&... args) const {
    write(LogLevel::kError, text, std::forward<Args>(args)...);
  }

 private:
  template <typename... Args>
  void write(LogLevel level, fmt::format_string<Args...> text, Args&&... args) const {
    detail::write_log(*source_, level, period_, text, fmt::make_format_args(args...));
  }

  detail::LogSource* source_;
  Duration period_{0};
};

}  // namespace fastcycle
