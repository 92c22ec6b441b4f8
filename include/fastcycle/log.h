#pragma once

#include <cstdint>
#include <string_view>
#include <utility>

#include <fmt/format.h>

namespace fastcycle {

enum class LogLevel : std::uint8_t { kDebug, kInfo, kWarning, kError };

namespace detail {
class LogQueue;
/// Formats one line and hands it to the log's own thread; a full queue drops it and counts it. In
/// the library, so that not every component that writes a line compiles what formats it.
void write_log(LogQueue& queue, LogLevel level, std::string_view component, fmt::string_view text,
               fmt::format_args args);
}  // namespace detail

/// Writes lines for people, with the component's name.
///
/// @threads  Safe.
/// @realtime Formats on the caller's stack (a line is cut at 400 bytes) and puts it into a bounded
///           queue: no allocation, no lock, no file access. Lines that find the queue full are
///           counted.
class Log {
 public:
  /// Made by `Component::log`; `component` outlives it.
  Log(detail::LogQueue& queue, std::string_view component) : queue_(queue), component_(component) {}

  /// For who develops the component.
  template <typename... Args>
  void debug(fmt::format_string<Args...> text, Args&&... args) const {
    write(LogLevel::kDebug, text, std::forward<Args>(args)...);
  }
  /// What somebody who runs the application may want to know.
  template <typename... Args>
  void info(fmt::format_string<Args...> text, Args&&... args) const {
    write(LogLevel::kInfo, text, std::forward<Args>(args)...);
  }
  /// Something is not as it should be, and the component goes on.
  template <typename... Args>
  void warning(fmt::format_string<Args...> text, Args&&... args) const {
    write(LogLevel::kWarning, text, std::forward<Args>(args)...);
  }
  /// Something that the component is there for does not work.
  template <typename... Args>
  void error(fmt::format_string<Args...> text, Args&&... args) const {
    write(LogLevel::kError, text, std::forward<Args>(args)...);
  }

 private:
  template <typename... Args>
  void write(LogLevel level, fmt::format_string<Args...> text, Args&&... args) const {
    detail::write_log(queue_, level, component_, text, fmt::make_format_args(args...));
  }

  detail::LogQueue& queue_;
  std::string_view component_;
};

}  // namespace fastcycle
