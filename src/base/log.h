#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <mutex>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "base/clock.h"
#include "base/sleepers.h"
#include "base/thread.h"
#include "fastcycle/log.h"

namespace fastcycle::detail {

/// One line, with its source and time.
struct LogLine {
  Time time;
  LogLevel level = LogLevel::kInfo;
  std::string_view component;
  std::string_view text;
};

/// `12.345678 warning planner: no lane`, without an end of line: seconds since `start`, 0 before
/// it, without terminal control characters.
[[nodiscard]] std::string to_string(const LogLine& line, Time start);

/// The queue of an application's lines to standard error, printed by a thread of its own.
///
/// @threads  `write`, `set_start`, `set_listener` are Safe.
/// @realtime `write` allocates nothing, takes no lock and touches no file; it makes one wake call
///           when the printing thread sleeps. A line that finds the queue full is counted; the
///           count is logged at most once a second, and at the end.
class LogQueue {
 public:
  static constexpr std::size_t kCapacity = 1024;
  /// A line's text is cut to this many bytes.
  static constexpr std::size_t kTextBytes = 400;
  /// The source of lines that are of no component.
  static constexpr std::string_view kOwnName = "fastcycle";

  explicit LogQueue(const base::Clock& clock);
  LogQueue(const LogQueue&) = delete;
  LogQueue& operator=(const LogQueue&) = delete;
  /// Prints the remaining lines, and how many were lost.
  ~LogQueue();

  void write(const LogLine& line) noexcept;

  /// Prints times relative to `start`; before the first call all are 0.
  void set_start(Time start) noexcept { start_ns_.store(base::to_ns(start)); }

  /// Whether all lines written until now are printed. Async-signal-safe.
  [[nodiscard]] bool is_printed() const noexcept;

  using Listener = std::function<void(const LogLine& line)>;
  /// Calls `listener` with each printed line, on the printing thread; an empty one removes that of
  /// `who`, which is not called any more once this has returned.
  void set_listener(const void* who, Listener listener);
  /// Passes a line that another process of the application printed to the listeners. Safe.
  void notify(const LogLine& line) noexcept;

 private:
  struct Slot {
    std::atomic<std::size_t> turn{0};
    Time time;
    LogLevel level{};
    std::size_t component_size = 0;
    std::size_t text_size = 0;
    std::array<char, 48> component{};
    std::array<char, kTextBytes> text{};
  };

  [[nodiscard]] bool has_line() const noexcept;
  void print_line() noexcept;
  void print(const LogLine& line) noexcept;
  void report_lost() noexcept;
  void print_until_stopped() noexcept;

  const base::Clock& clock_;
  /// Standard error is a terminal: a progress line there is cleared.
  const bool is_terminal_;
  const bool is_coloured_;
  std::vector<Slot> slots_;
  alignas(64) std::atomic<std::size_t> tail_{0};
  std::atomic<std::uint64_t> lost_{0};
  std::atomic<std::int64_t> start_ns_{base::kNever};
  std::atomic<bool> is_stopping_{false};
  base::Sleepers sleepers_;

  // Printing thread only.
  std::size_t head_ = 0;
  std::uint64_t reported_lost_ = 0;
  std::int64_t next_report_ns_ = 0;

  std::mutex listener_mutex_;
  std::vector<std::pair<const void*, Listener>> listeners_;

  base::Thread thread_;
};

/// Rate limit for each text.
///
/// @threads  Safe.
/// @realtime No lock, no allocation; it compares with up to `kTexts` texts.
class LogThrottle {
 public:
  static constexpr std::size_t kTexts = 32;

  /// Whether `text`, identified by its address, may be written at `now`, at most once per `period`:
  /// returns how many times it was suppressed since the last time; none if it may not be written.
  std::optional<std::uint64_t> admit(const char* text, Time now, Duration period) noexcept;

 private:
  struct Entry {
    std::atomic<const char*> text{nullptr};
    std::atomic<std::int64_t> next_ns{INT64_MIN};
    std::atomic<std::uint64_t> left_out{0};
  };

  Entry& entry_of(const char* text) noexcept;

  std::array<Entry, kTexts + 1> entries_;  ///< The last one is for all texts beyond.
};

/// The source of lines: adds name and time, and drops lines below its level.
///
/// @threads  Safe, unless stated otherwise.
class LogSource {
 public:
  /// `name` outlives it.
  LogSource(LogQueue& queue, std::string_view name, const base::Clock& clock, LogLevel level)
      : queue_(queue), name_(name), clock_(clock), level_(level) {}
  LogSource(const LogSource&) = delete;
  LogSource& operator=(const LogSource&) = delete;

  [[nodiscard]] bool wants(LogLevel level) const noexcept {
    return level >= level_ && !is_muted_.load(std::memory_order_relaxed);
  }
  /// Suppresses all lines, while another process writes the same.
  void mute(bool is_muted) noexcept { is_muted_.store(is_muted, std::memory_order_relaxed); }
  void write(LogLevel level, std::string_view text) { write(level, name_, text); }
  /// On behalf of `component`.
  void write(LogLevel level, std::string_view component, std::string_view text);

  [[nodiscard]] Time now() const noexcept { return clock_.now(); }
  [[nodiscard]] LogThrottle& throttle() noexcept { return throttle_; }

  /// A line that is kept for a later `take`.
  struct Kept {
    Time time;
    LogLevel level = LogLevel::kInfo;
    std::string component;
    std::string text;
  };
  struct AllKept {
    std::vector<Kept> lines;
    std::uint64_t lost = 0;  ///< Beyond `kMostKept`.
  };
  static constexpr std::size_t kMostKept = 1024;
  /// Also keeps lines, in the order in which they are written. Then `write` takes a lock and
  /// allocates: for simulated time. Before the first write, or between two rounds.
  void keep() noexcept { is_kept_.store(true); }
  /// Keeps a line that another process of the application wrote, if lines are kept.
  void keep_line(Kept line);
  [[nodiscard]] AllKept take_kept();

 private:
  LogQueue& queue_;
  const std::string_view name_;
  const base::Clock& clock_;
  const LogLevel level_;
  std::atomic<bool> is_muted_{false};
  LogThrottle throttle_;

  std::atomic<bool> is_kept_{false};
  std::mutex kept_mutex_;
  AllKept kept_;
};

}  // namespace fastcycle::detail
