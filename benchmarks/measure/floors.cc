#include "measure/floors.h"

#include <array>
#include <atomic>
#include <cstddef>
#include <memory>
#include <thread>
#include <vector>

#include <linux/futex.h>
#include <sys/prctl.h>
#include <sys/syscall.h>
#include <unistd.h>

#include "measure/clock.h"
#include "measure/payload.h"

namespace fastcycle::measure {
namespace {

void pause_briefly() noexcept {
#if defined(__x86_64__)
  __builtin_ia32_pause();
#elif defined(__aarch64__)
  asm volatile("yield");
#endif
}

struct Message {
  Sample stamps;
  void* data = nullptr;
};

/// A few places for messages on their way, so that a receiver that is late loses none.
class Slots {
 public:
  void put(const Message& message, Waiting waiting) noexcept {
    messages_[sent_.load(std::memory_order_relaxed) % kCount] = message;
    sent_.fetch_add(1, std::memory_order_release);
    if (waiting == Waiting::kFutex) {
      syscall(SYS_futex, &sent_, FUTEX_WAKE_PRIVATE, 1, nullptr, nullptr, 0);
    }
  }

  /// Waits for the next message, which stays where it is until 63 more were put.
  const Message& take(Waiting waiting) noexcept {
    while (sent_.load(std::memory_order_acquire) == taken_) {
      if (waiting == Waiting::kFutex) {
        syscall(SYS_futex, &sent_, FUTEX_WAIT_PRIVATE, taken_, nullptr, nullptr, 0);
      } else {
        pause_briefly();
      }
    }
    return messages_[taken_++ % kCount];
  }

 private:
  static constexpr std::uint32_t kCount = 1024;  // A second at 1 kHz: more than any stall seen.

  alignas(64) std::atomic<std::uint32_t> sent_{0};
  alignas(64) std::uint32_t taken_ = 0;
  std::array<Message, kCount> messages_;
};

/// A few payloads in turn, filled once, so that no page is new.
class Payloads {
 public:
  explicit Payloads(std::int64_t size) {
    for (auto& data : data_) {
      data.assign(static_cast<std::size_t>(size), 1);
    }
  }

  /// A filled one, and when that began.
  [[nodiscard]] Message next(std::int64_t number) {
    const std::int64_t made_ns = now_ns();
    auto& data = data_[static_cast<std::size_t>(number) % data_.size()];
    fill(data.data(), data.size(), number);
    return {.stamps = {.number = number, .made_ns = made_ns}, .data = data.data()};
  }

 private:
  std::array<std::vector<unsigned char>, 3> data_;
};

/// As FastCycle's own workers: timers to the nanosecond.
void set_up_thread() noexcept {
  prctl(PR_SET_TIMERSLACK, 1UL);
}

std::int64_t total(const Plan& plan) noexcept {
  return plan.warmup + plan.count;
}

/// Calls `send(number)` once an interval; returns what was used after the warm-up.
template <typename Send>
Usage send_all(const Plan& plan, const Send& send) {
  Usage at_begin = Usage::now();
  const std::int64_t begin_ns = now_ns();
  for (std::int64_t number = 0; number < total(plan); ++number) {
    sleep_until(begin_ns + (number + 1) * plan.interval_us * 1000);
    if (number == plan.warmup) {
      at_begin = Usage::now();
    }
    send(number);
  }
  return Usage::now() - at_begin;
}

}  // namespace

Measured floor_latency(const Plan& plan, Waiting waiting) {
  Measured result;
  result.samples.reserve(static_cast<std::size_t>(total(plan)));
  Payloads payloads(plan.size);
  const auto slots = std::make_unique<Slots>();
  std::thread receiver([&] {
    set_up_thread();
    for (std::int64_t i = 0; i < total(plan); ++i) {
      const Message& message = slots->take(waiting);
      const std::int64_t arrived_ns = now_ns();
      result.samples.push_back(message.stamps);
      result.samples.back().arrived_ns = arrived_ns;
    }
  });
  std::thread sender([&] {
    set_up_thread();
    result.usage = send_all(plan, [&](std::int64_t number) {
      Message message = payloads.next(number);
      message.stamps.sent_ns = now_ns();
      slots->put(message, waiting);
    });
  });
  sender.join();
  receiver.join();
  return result;
}

Measured floor_rtt(const Plan& plan, Waiting waiting) {
  Measured result;
  result.samples.reserve(static_cast<std::size_t>(total(plan)));
  Payloads payloads(plan.size);
  const auto there = std::make_unique<Slots>();
  const auto back = std::make_unique<Slots>();
  std::thread echo([&] {
    set_up_thread();
    for (std::int64_t i = 0; i < total(plan); ++i) {
      back->put(there->take(waiting), waiting);
    }
  });
  std::thread sender([&] {
    set_up_thread();
    result.usage = send_all(plan, [&](std::int64_t number) {
      Message message = payloads.next(number);
      message.stamps.sent_ns = now_ns();
      there->put(message, waiting);
      Sample sample = back->take(waiting).stamps;
      sample.arrived_ns = now_ns();
      result.samples.push_back(sample);
    });
  });
  sender.join();
  echo.join();
  return result;
}

}  // namespace fastcycle::measure
