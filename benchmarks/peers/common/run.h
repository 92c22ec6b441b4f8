#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <functional>

#include <sys/types.h>

#include "measure/clock.h"
#include "measure/floors.h"
#include "measure/payload.h"
#include "measure/row.h"
#include "measure/samples.h"
#include "measure/usage.h"
#include "peers/common/stamps.h"

namespace fastcycle::peers {

using measure::now_ns;

enum class Mode : std::uint8_t { kLatency, kRtt, kFlood };

/// One measurement: when the publisher sends, and what the subscriber records. The adapter of a
/// peer calls `publish_all` on the publishing thread, and `arrived` as the callback's second
/// statement; its first is now_ns(). All records are in memory shared with a second process.
class Run {
 public:
  Run(Mode mode, const measure::Plan& plan);
  Run(const Run&) = delete;
  Run& operator=(const Run&) = delete;
  ~Run();

  [[nodiscard]] bool is_rtt() const noexcept { return mode_ == Mode::kRtt; }
  [[nodiscard]] bool is_flood() const noexcept { return mode_ == Mode::kFlood; }
  [[nodiscard]] std::size_t size() const noexcept { return static_cast<std::size_t>(plan_.size); }
  [[nodiscard]] std::int64_t total() const noexcept { return plan_.warmup + plan_.count; }

  /// In a flood at most `kWindow` messages are in flight, unless the peer limits its publisher
  /// itself.
  static constexpr std::int64_t kWindow = 1024;
  void holds_back_by_itself() noexcept { has_window_ = false; }

  /// On any thread of any process: a message has reached its end, in mode rtt back at its origin.
  void arrived(const Stamps& stamps, const void* data, std::int64_t arrived_ns) noexcept;

  /// No more messages will arrive. A waiting receiver polls it.
  [[nodiscard]] bool is_over() const noexcept {
    return board_->is_over.load(std::memory_order_acquire);
  }

  /// Calls `send(number)` for each message, then waits for those in flight: until all have arrived,
  /// or none arrived for a second.
  template <typename Send>
  void publish_all(const Send& send);

  /// Runs `receive` in a second process. A peer must call this first, because forking a process
  /// with threads is unsafe. It ends when `receive` returns, as it must once `is_over()`.
  void in_second_process(const std::function<void()>& receive);
  /// Called by the second process when it is ready to receive. The first one waits for that.
  void set_second_ready() noexcept { board_->is_second_ready.store(true); }
  void wait_for_second_ready() const;

  /// The row of this run, with the usage of both processes.
  ///
  /// @errors  std::runtime_error if nothing arrived, a payload was damaged, or the second process
  ///          failed.
  [[nodiscard]] measure::Row finish();

 private:
  /// Memory shared by both processes.
  struct Board {
    alignas(64) std::atomic<std::int64_t> received{0};
    std::atomic<std::int64_t> received_measured{0};
    std::atomic<std::int64_t> last_arrived_ns{0};
    std::atomic<std::int64_t> damaged{0};
    alignas(64) std::atomic<bool> is_over{false};
    std::atomic<bool> is_second_ready{false};
    measure::Usage second_usage;
  };

  void begin_measuring() noexcept;
  void wait_for_window(std::int64_t number) noexcept;
  void wait_for_rest() noexcept;
  void join_second_process();
  [[nodiscard]] std::size_t mapped_bytes() const noexcept;

  const Mode mode_;
  const measure::Plan plan_;
  bool has_window_ = true;
  Board* board_;
  measure::Sample* samples_;  // After the board; unused in a flood.
  measure::Usage usage_at_begin_;
  measure::Usage usage_;
  std::int64_t began_ns_ = 0;
  std::int64_t given_up_ = 0;  // Messages of a flood that no longer count as in flight.
  pid_t second_ = 0;           // In the first process, once there is a second.
  bool is_second_ = false;     // This is the second process.
  std::atomic<bool> is_second_measuring_{false};  // Its `usage_at_begin_` is set.
};

template <typename Send>
void Run::publish_all(const Send& send) {
  const std::int64_t begin_ns = now_ns();
  try {
    for (std::int64_t number = 0; number < total(); ++number) {
      if (!is_flood()) {
        measure::sleep_until(begin_ns + (number + 1) * plan_.interval_us * 1000);
      } else if (has_window_) {
        wait_for_window(number);
      }
      if (number == plan_.warmup) {
        begin_measuring();
      }
      send(number);
    }
  } catch (...) {
    board_->is_over.store(true);  // So that receivers end, and their threads can be joined.
    throw;
  }
  wait_for_rest();
}

}  // namespace fastcycle::peers
