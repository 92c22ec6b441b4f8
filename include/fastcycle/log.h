#pragma once

#include <array>
#include <cstdint>
#include <string_view>
#include <utility>

#include <fmt/format.h>

namespace fastcycle {

enum class LogLevel : std::uint8_t { kDebug, kInfo, kWarning, kError };

namespace detail {
class LogQueue;
/// Hands one line to the log's own thread; a full queue drops it and counts it.
void write_log(LogQueue& queue, LogLevel level, std::string_view component,
               std::string_view text) noexcept;
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
    std::array<char, 400> line{};
    const auto end =
        fmt::format_to_n(line.data(), line.size(), text, std::forward<Args>(args)...).out;
    detail::write_log(queue_, level, component_,
                      {line.data(), static_cast<std::size_t>(end - line.data())});
  }

  detail::LogQueue& queue_;
  std::string_view component_;
};

}  // namespace fastcycle
