#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <mutex>
#include <string_view>
#include <vector>

#include "base/sleepers.h"
#include "base/thread.h"
#include "fastcycle/log.h"

namespace fastcycle::detail {

/// The lines of one application on their way to standard error, printed by a thread of its own.
///
/// @threads  `write` is Safe.
/// @realtime `write` allocates nothing, takes no lock and touches no file; it makes one wake call
///           when the printing thread sleeps. A line that finds the queue full is counted.
class LogQueue {
 public:
  LogQueue();
  LogQueue(const LogQueue&) = delete;
  LogQueue& operator=(const LogQueue&) = delete;
  /// Prints what is left, and how many lines were dropped.
  ~LogQueue();

  void write(LogLevel level, std::string_view component, std::string_view text) noexcept;

  using Listener =
      std::function<void(LogLevel level, std::string_view component, std::string_view text)>;
  /// From now on `listener` is given each line that is printed, on the thread that prints; an empty
  /// one ends that, and is not called any more once this has returned. Safe.
  void set_listener(Listener listener);

 private:
  static constexpr std::size_t kCapacity = 1024;

  struct Slot {
    std::atomic<std::size_t> turn{0};
    LogLevel level{};
    std::size_t component_size = 0;
    std::size_t text_size = 0;
    std::array<char, 48> component{};
    std::array<char, 400> text{};
  };

  [[nodiscard]] bool has_line() const noexcept;
  void print_line() noexcept;
  void print_until_stopped() noexcept;

  /// On a terminal it clears the line: something that is redrawn may stand there.
  const char* const line_begin_;
  std::vector<Slot> slots_;
  alignas(64) std::atomic<std::size_t> tail_{0};
  std::atomic<std::uint64_t> dropped_{0};
  std::atomic<bool> is_stopping_{false};
  base::Sleepers sleepers_;

  // Printing thread only.
  std::size_t head_ = 0;

  std::mutex listener_mutex_;
  Listener listener_;

  base::Thread thread_;
};

}  // namespace fastcycle::detail
