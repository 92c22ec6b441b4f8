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

/// One measurement: when the publisher sends, and what the subscriber takes down. The adapter of a
/// peer calls `publish_all` on the thread that publishes, and `arrived` as the callback's second
/// statement; its first is now_ns(). All it takes down lies in memory that a second process shares.
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

  /// In a flood at most `kWindow` messages are on their way, unless the peer holds its publisher
  /// back by itself.
  static constexpr std::int64_t kWindow = 1024;
  void holds_back_by_itself() noexcept { has_window_ = false; }

  /// On any thread of any process: a message has come to its end, in mode rtt back at its origin.
  void arrived(const Stamps& stamps, const void* data, std::int64_t arrived_ns) noexcept;

  /// Nothing more will come. A receiver that waits looks at it from time to time.
  [[nodiscard]] bool is_over() const noexcept {
    return board_->is_over.load(std::memory_order_acquire);
  }

  /// Calls `send(number)` for each message, then waits for those still on their way: until all are
  /// there, or none came for a second.
  template <typename Send>
  void publish_all(const Send& send);

  /// Runs `receive` in a second process, which must be the first thing that a peer does: a process
  /// with threads does not fork well. It ends when `receive` returns, which is to be when
  /// `is_over()`.
  void in_second_process(const std::function<void()>& receive);
  /// Of the second process: it can receive from now on. The first one waits for that.
  void set_second_ready() noexcept { board_->is_second_ready.store(true); }
  void wait_for_second_ready() const;

  /// The row of all this, with what both processes used.
  ///
  /// @errors  std::runtime_error if nothing arrived, a payload was not what was sent, or the second
  ///          process failed.
  [[nodiscard]] measure::Row finish();

 private:
  /// What both processes see.
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
  measure::Sample* samples_;  // Behind the board; not used in a flood.
  measure::Usage usage_at_begin_;
  measure::Usage usage_;
  std::int64_t began_ns_ = 0;
  std::int64_t given_up_ = 0;  // Messages of a flood that no longer count as on their way.
  pid_t second_ = 0;           // In the first process, once there is a second.
  bool is_second_ = false;     // This is the second process.
  std::atomic<bool> is_second_measuring_{false};  // Its `usage_at_begin_` is taken.
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
