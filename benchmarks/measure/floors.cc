#include "measure/floors.h"

#include <array>
#include <atomic>
#include <cstddef>
#include <memory>
#include <thread>
#include <vector>

#include <linux/futex.h>
#include <pthread.h>
#include <sched.h>
#include <sys/prctl.h>
#include <sys/syscall.h>
#include <unistd.h>

#include "measure/clock.h"
#include "measure/pacing.h"
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

/// Places for messages on their way, more than any stall needs at 1 kHz.
class Slots {
 public:
  void put(const Message& message, Waiting waiting) noexcept {
    const std::uint32_t sent = sent_.load(std::memory_order_relaxed);
    messages_[sent % kCount] = message;
    sent_.store(sent + 1, std::memory_order_release);
    if (waiting == Waiting::kFutex) {
      syscall(SYS_futex, &sent_, FUTEX_WAKE_PRIVATE, 1, nullptr, nullptr, 0);
    }
    // Only after the message is on its way: what is full must not lose the next one.
    while (sent + 1 - taken_.load(std::memory_order_acquire) > kCount - 4) {
      std::this_thread::yield();
    }
  }

  /// Waits for the next message, which stays as it is until the next is taken.
  const Message& take(Waiting waiting) noexcept {
    const std::uint32_t taken = taken_.load(std::memory_order_relaxed);
    while (sent_.load(std::memory_order_acquire) == taken) {
      if (waiting == Waiting::kFutex) {
        syscall(SYS_futex, &sent_, FUTEX_WAIT_PRIVATE, taken, nullptr, nullptr, 0);
      } else {
        pause_briefly();
      }
    }
    taken_.store(taken + 1, std::memory_order_release);
    return messages_[taken % kCount];
  }

 private:
  static constexpr std::uint32_t kCount = 1024;

  alignas(64) std::atomic<std::uint32_t> sent_{0};
  alignas(64) std::atomic<std::uint32_t> taken_{0};
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

/// What the receiver sees last.
constexpr Message kEnd{.stamps = {.number = -1}};

}  // namespace

void set_up_thread(const Plan& plan) noexcept {
  prctl(PR_SET_TIMERSLACK, 1UL);
  if (plan.is_fifo) {
    sched_param parameter{};
    parameter.sched_priority = kFifoPriority;
    static_cast<void>(pthread_setschedparam(pthread_self(), SCHED_FIFO, &parameter));
  }
}

bool may_use_fifo() {
  int policy = SCHED_OTHER;
  std::thread([&policy] {
    set_up_thread({.is_fifo = true});
    sched_param parameter{};
    pthread_getschedparam(pthread_self(), &policy, &parameter);
  }).join();
  return policy == SCHED_FIFO;
}

Measured floor_latency(const Plan& plan, Waiting waiting) {
  Measured result;
  reserve(result.samples, total(plan));
  Payloads payloads(plan.size);
  const auto slots = std::make_unique<Slots>();
  std::thread receiver([&] {
    set_up_thread(plan);
    for (;;) {
      const Message& message = slots->take(waiting);
      const std::int64_t arrived_ns = now_ns();
      if (message.stamps.number < 0) {
        return;
      }
      result.samples.push_back(message.stamps);
      result.samples.back().arrived_ns = arrived_ns;
    }
  });
  std::thread sender([&] {
    set_up_thread(plan);
    result.usage = each_interval(plan, [&](std::int64_t number, std::int64_t) {
      Message message = payloads.next(number);
      message.stamps.sent_ns = now_ns();
      slots->put(message, waiting);
    });
    slots->put(kEnd, waiting);
  });
  sender.join();
  receiver.join();
  return result;
}

Measured floor_rtt(const Plan& plan, Waiting waiting) {
  Measured result;
  reserve(result.samples, total(plan));
  Payloads payloads(plan.size);
  const auto there = std::make_unique<Slots>();
  const auto back = std::make_unique<Slots>();
  std::thread echo([&] {
    set_up_thread(plan);
    for (;;) {
      const Message& message = there->take(waiting);
      if (message.stamps.number < 0) {
        return;
      }
      back->put(message, waiting);
    }
  });
  std::thread sender([&] {
    set_up_thread(plan);
    result.usage = each_interval(plan, [&](std::int64_t number, std::int64_t) {
      Message message = payloads.next(number);
      message.stamps.sent_ns = now_ns();
      there->put(message, waiting);
      Sample sample = back->take(waiting).stamps;
      sample.arrived_ns = now_ns();
      result.samples.push_back(sample);
    });
    there->put(kEnd, waiting);
  });
  sender.join();
  echo.join();
  return result;
}

Measured floor_timer(const Plan& plan) {
  Measured result;
  reserve(result.samples, total(plan));
  std::thread timer([&] {
    set_up_thread(plan);
    result.usage = each_interval(plan, [&](std::int64_t number, std::int64_t due_ns) {
      const std::int64_t arrived_ns = now_ns();
      result.samples.push_back(
          {.number = number, .made_ns = due_ns, .sent_ns = due_ns, .arrived_ns = arrived_ns});
    });
  });
  timer.join();
  return result;
}

}  // namespace fastcycle::measure
