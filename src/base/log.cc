#include "base/log.h"

#include <algorithm>
#include <array>
#include <cstdio>
#include <cstring>
#include <utility>

#include <unistd.h>

#include "base/clock.h"
#include "base/log_level.h"

namespace fastcycle::detail {

// The queue is the bounded one of Dmitry Vyukov: a slot's `turn` says whose turn it is to use it.
// https://www.1024cores.net/home/lock-free-algorithms/queues/bounded-mpmc-queue
LogQueue::LogQueue()
    : line_begin_(isatty(STDERR_FILENO) == 0 ? "" : "\r\x1b[K"), slots_(kCapacity) {
  for (std::size_t i = 0; i < kCapacity; ++i) {
    slots_[i].turn.store(i, std::memory_order_relaxed);
  }
  std::vector<base::Refusal> refusals;
  thread_ =
      base::Thread({.name = "fc-log", .cpus = {}}, [this] { print_until_stopped(); }, refusals);
}

LogQueue::~LogQueue() {
  is_stopping_.store(true);
  sleepers_.wake_one();
  thread_.join();
  if (const auto lost = dropped_.load(); lost > 0) {
    std::fprintf(stderr, "fastcycle: %llu lines of log were dropped: its queue of %zu was full\n",
                 static_cast<unsigned long long>(lost), kCapacity);
  }
}

void LogQueue::write(LogLevel level, std::string_view component, std::string_view text) noexcept {
  std::size_t position = tail_.load(std::memory_order_relaxed);
  for (;;) {
    Slot& slot = slots_[position % kCapacity];
    const std::size_t turn = slot.turn.load(std::memory_order_acquire);
    if (turn == position) {
      if (tail_.compare_exchange_weak(position, position + 1, std::memory_order_relaxed)) {
        slot.level = level;
        slot.component_size = std::min(component.size(), slot.component.size());
        std::copy_n(component.begin(), slot.component_size, slot.component.begin());
        slot.text_size = std::min(text.size(), slot.text.size());
        std::copy_n(text.begin(), slot.text_size, slot.text.begin());
        slot.turn.store(position + 1, std::memory_order_seq_cst);
        sleepers_.wake_one();
        return;
      }
    } else if (turn < position) {
      dropped_.fetch_add(1, std::memory_order_relaxed);
      return;
    } else {
      position = tail_.load(std::memory_order_relaxed);
    }
  }
}

void LogQueue::set_listener(Listener listener) {
  const std::lock_guard lock(listener_mutex_);
  listener_ = std::move(listener);
}

bool LogQueue::has_line() const noexcept {
  return slots_[head_ % kCapacity].turn.load(std::memory_order_seq_cst) == head_ + 1;
}

void LogQueue::print_line() noexcept {
  Slot& slot = slots_[head_ % kCapacity];
  std::fprintf(stderr, "%s%s: %.*s%s%.*s\n", line_begin_, to_word(slot.level),
               static_cast<int>(slot.component_size), slot.component.data(),
               slot.component_size == 0 ? "" : ": ", static_cast<int>(slot.text_size),
               slot.text.data());
  {
    const std::lock_guard lock(listener_mutex_);
    if (listener_) {
      listener_(slot.level, {slot.component.data(), slot.component_size},
                {slot.text.data(), slot.text_size});
    }
  }
  slot.turn.store(head_ + kCapacity, std::memory_order_release);
  ++head_;
}

void LogQueue::print_until_stopped() noexcept {
  for (;;) {
    while (has_line()) {
      print_line();
    }
    std::fflush(stderr);
    sleepers_.announce(0);
    if (has_line()) {
      sleepers_.withdraw(0);
    } else if (is_stopping_.load()) {
      sleepers_.withdraw(0);
      return;
    } else {
      sleepers_.sleep(0, base::kNever);
    }
  }
}

void write_log(LogQueue& queue, LogLevel level, std::string_view component, fmt::string_view text,
               fmt::format_args args) {
  std::array<char, 400> line{};
  const auto written = fmt::vformat_to_n(line.data(), line.size(), text, args);
  queue.write(level, component, {line.data(), static_cast<std::size_t>(written.out - line.data())});
}

}  // namespace fastcycle::detail
