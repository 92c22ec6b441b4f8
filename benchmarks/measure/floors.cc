#include "measure/floors.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <cerrno>
#include <csignal>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <memory>
#include <new>
#include <system_error>
#include <thread>

#include <linux/futex.h>
#include <pthread.h>
#include <sched.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

#include "measure/clock.h"
#include "measure/pacing.h"
#include "measure/payload.h"

namespace fastcycle::measure {
namespace {

struct Message {
  Sample stamps;
  void* data = nullptr;
};

/// Whether both sides are in one process.
enum class Sides : std::uint8_t { kThreads, kProcesses };

/// Slots for messages in flight, more than any stall needs at 1 kHz.
class Slots {
 public:
  explicit Slots(Sides sides = Sides::kThreads)
      : wake_(sides == Sides::kThreads ? FUTEX_WAKE_PRIVATE : FUTEX_WAKE),
        wait_(sides == Sides::kThreads ? FUTEX_WAIT_PRIVATE : FUTEX_WAIT) {}

  void put(const Message& message, Waiting waiting) noexcept {
    const std::uint32_t sent = sent_.load(std::memory_order_relaxed);
    messages_[sent % kCount] = message;
    sent_.store(sent + 1, std::memory_order_release);
    if (waiting == Waiting::kFutex) {
      syscall(SYS_futex, &sent_, wake_, 1, nullptr, nullptr, 0);
    }
    // Only after the message is on its way: what is full must not lose the next one.
    while (sent + 1 - taken_.load(std::memory_order_acquire) > kCount - 4) {
      std::this_thread::yield();
    }
  }

  /// Waits for the next message, which stays valid until the next call.
  const Message& take(Waiting waiting) noexcept {
    const std::uint32_t taken = taken_.load(std::memory_order_relaxed);
    while (sent_.load(std::memory_order_acquire) == taken) {
      if (waiting == Waiting::kFutex) {
        syscall(SYS_futex, &sent_, wait_, taken, nullptr, nullptr, 0);
      } else {
        pause_briefly();
      }
    }
    taken_.store(taken + 1, std::memory_order_release);
    return messages_[taken % kCount];
  }

 private:
  static constexpr std::uint32_t kCount = 1024;

  const int wake_;
  const int wait_;
  alignas(64) std::atomic<std::uint32_t> sent_{0};
  alignas(64) std::atomic<std::uint32_t> taken_{0};
  std::array<Message, kCount> messages_;
};

/// Zeroed memory shared with forked processes.
class SharedMemory {
 public:
  explicit SharedMemory(std::size_t size)
      : size_(size),
        begin_(mmap(nullptr, size, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0)) {
    if (begin_ == MAP_FAILED) {
      throw std::bad_alloc();
    }
  }
  SharedMemory(const SharedMemory&) = delete;
  SharedMemory& operator=(const SharedMemory&) = delete;
  ~SharedMemory() { munmap(begin_, size_); }

  [[nodiscard]] void* begin() const { return begin_; }

 private:
  std::size_t size_;
  void* begin_;
};

/// A few payloads in turn, filled once, so that no page is new.
class Payloads {
 public:
  explicit Payloads(std::int64_t size)
      : size_(static_cast<std::size_t>(size)), memory_(std::max(kCount * size_, kCount)) {
    std::memset(memory_.begin(), 1, kCount * size_);
  }

  /// A filled payload, and the time before it was filled.
  [[nodiscard]] Message next(std::int64_t number) {
    const std::int64_t made_ns = now_ns();
    auto* const data = static_cast<unsigned char*>(memory_.begin()) +
                       static_cast<std::size_t>(number) % kCount * size_;
    fill(data, size_, number);
    return {.stamps = {.number = number, .made_ns = made_ns}, .data = data};
  }

 private:
  static constexpr std::size_t kCount = 3;

  std::size_t size_;
  SharedMemory memory_;
};

/// The last message that the receiver processes.
constexpr Message kEnd{.stamps = {.number = -1}};

/// The sender of one-way messages.
Usage send_all(const Plan& plan, Payloads& payloads, Slots& slots, Waiting waiting) {
  set_up_thread(plan);
  const Usage usage = each_interval(plan, [&](std::int64_t number, std::int64_t) {
    Message message = payloads.next(number);
    message.stamps.sent_ns = now_ns();
    slots.put(message, waiting);
  });
  slots.put(kEnd, waiting);
  return usage;
}

}  // namespace

void set_up_thread(const Plan& plan) noexcept {
  prctl(PR_SET_TIMERSLACK, 1UL);
  if (plan.is_fifo) {
    sched_param parameter{};
    parameter.sched_priority = kFifoPriority;
    static_cast<void>(pthread_setschedparam(pthread_self(), SCHED_FIFO, &parameter));
  }
}

void set_up_receiver(const Plan& plan) noexcept {
  set_up_thread(plan);
  if (plan.slice_us == 0) {
    return;
  }
  // Of sched_setattr, which the C library does not have; see sched(7).
  struct {
    std::uint32_t size = 0, policy = SCHED_OTHER;
    std::uint64_t flags = 0;
    std::int32_t nice = getpriority(PRIO_PROCESS, 0);
    std::uint32_t priority = 0;
    std::uint64_t runtime_ns = 0, deadline_ns = 0, period_ns = 0;
  } attributes;
  attributes.size = sizeof(attributes);
  attributes.runtime_ns = 1000 * static_cast<std::uint64_t>(plan.slice_us);
  static_cast<void>(syscall(SYS_sched_setattr, 0, &attributes, 0));
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
    set_up_receiver(plan);
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
  std::thread([&] { result.usage = send_all(plan, payloads, *slots, waiting); }).join();
  receiver.join();
  return result;
}

Measured floor_processes(const Plan& plan, Waiting waiting) {
  // Written by the receiver: its stamps, preceded by their number.
  const auto room = static_cast<std::size_t>(total(plan));
  const SharedMemory taken(sizeof(std::size_t) + room * sizeof(Sample));
  auto* const count = new (taken.begin()) std::size_t{0};
  auto* const stamps =
      static_cast<Sample*>(static_cast<void*>(static_cast<std::size_t*>(taken.begin()) + 1));
  std::memset(static_cast<void*>(stamps), 1, room * sizeof(Sample));
  const SharedMemory slots_memory(sizeof(Slots));
  auto* const slots = new (slots_memory.begin()) Slots(Sides::kProcesses);
  Payloads payloads(plan.size);

  const pid_t parent = getpid();
  const pid_t receiver = fork();
  if (receiver < 0) {
    throw std::system_error(errno, std::generic_category(), "bench: fork");
  }
  if (receiver == 0) {
    prctl(PR_SET_PDEATHSIG, SIGKILL);
    if (getppid() != parent) {
      _exit(1);
    }
    set_up_receiver(plan);
    for (;;) {
      const Message& message = slots->take(waiting);
      const std::int64_t arrived_ns = now_ns();
      if (message.stamps.number < 0 || *count == room) {
        _exit(0);
      }
      stamps[*count] = message.stamps;
      stamps[*count].arrived_ns = arrived_ns;
      ++*count;
    }
  }
  Measured result;
  std::thread([&] { result.usage = send_all(plan, payloads, *slots, waiting); }).join();
  waitpid(receiver, nullptr, 0);
  result.samples.assign(stamps, stamps + *count);
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
