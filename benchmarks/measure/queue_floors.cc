#include "measure/queue_floors.h"

#include <algorithm>
#include <atomic>
#include <bit>
#include <condition_variable>
#include <cstddef>
#include <cstdlib>
#include <deque>
#include <limits>
#include <mutex>
#include <thread>
#include <utility>
#include <vector>

#include "measure/clock.h"
#include "measure/pacing.h"
#include "measure/payload.h"

namespace fastcycle::measure {
namespace {

constexpr std::int64_t kNever = std::numeric_limits<std::int64_t>::max();

struct Message {
  Sample stamps;
  void* data = nullptr;
};

/// A textbook queue.
template <typename T>
class LockedQueue {
 public:
  void put(T item) {
    bool is_awaited = false;
    {
      const std::lock_guard lock(mutex_);
      items_.push_back(item);
      is_awaited = is_awaited_;
    }
    if (is_awaited) {
      filled_.notify_one();
    }
  }

  T take() {
    std::unique_lock lock(mutex_);
    while (items_.empty()) {
      is_awaited_ = true;
      filled_.wait(lock);
    }
    is_awaited_ = false;
    const T item = items_.front();
    items_.pop_front();
    return item;
  }

 private:
  std::mutex mutex_;
  std::condition_variable filled_;
  std::deque<T> items_;
  bool is_awaited_ = false;
};

/// The sender's credits; returned in batches.
class Credits {
 public:
  explicit Credits(std::int64_t count) : count_(count) {}

  void give(std::int64_t count) {
    {
      const std::lock_guard lock(mutex_);
      count_ += count;
    }
    given_.notify_one();
  }

  /// Waits until there are some, and takes all of them.
  std::int64_t take() {
    std::unique_lock lock(mutex_);
    given_.wait(lock, [this] { return count_ > 0; });
    return std::exchange(count_, 0);
  }

 private:
  std::mutex mutex_;
  std::condition_variable given_;
  std::int64_t count_;
};

}  // namespace

Measured floor_malloc(const Plan& plan) {
  Measured result;
  reserve(result.samples, total(plan));
  const auto size = static_cast<std::size_t>(plan.size);
  LockedQueue<Message> queue;
  std::thread receiver([&] {
    set_up_thread(plan);
    for (Message message = queue.take(); message.stamps.number >= 0; message = queue.take()) {
      message.stamps.arrived_ns = now_ns();
      result.samples.push_back(message.stamps);
      std::free(message.data);
    }
  });
  std::thread sender([&] {
    set_up_thread(plan);
    result.usage = each_interval(plan, [&](std::int64_t number, std::int64_t) {
      Message message{.stamps = {.number = number, .made_ns = now_ns()}, .data = std::malloc(size)};
      fill(message.data, message.data == nullptr ? 0 : size, number);
      message.stamps.sent_ns = now_ns();
      queue.put(message);
    });
    queue.put({.stamps = {.number = -1}});
  });
  sender.join();
  receiver.join();
  return result;
}

namespace {

struct Item {
  std::int64_t number = 0;
  std::vector<unsigned char> data;
};

/// Hands over by a locked queue; credits come back under a second lock.
struct LockedWay {
  explicit LockedWay(std::int64_t window) : credits(window) {}

  void put(Item* item) { queue.put(item); }
  Item* take() { return queue.take(); }
  void give(std::int64_t count) { credits.give(count); }
  std::int64_t take_credits() { return credits.take(); }

  LockedQueue<Item*> queue;
  Credits credits;
};

/// Hands over by a ring of pointers between two threads that spin.
class RingWay {
 public:
  explicit RingWay(std::int64_t window)
      : slots_(std::bit_ceil(static_cast<std::size_t>(window) + 1)), returned_(window) {}

  void put(Item* item) {
    slots_[written_ % slots_.size()] = item;
    announced_.store(++written_, std::memory_order_release);
  }

  Item* take() {
    while (read_ == seen_) {
      pause_briefly();
      seen_ = announced_.load(std::memory_order_acquire);
    }
    return slots_[read_++ % slots_.size()];
  }

  void give(std::int64_t count) { returned_.fetch_add(count, std::memory_order_release); }

  std::int64_t take_credits() {
    for (;;) {
      const std::int64_t all = returned_.load(std::memory_order_acquire);
      if (all > taken_) {
        return all - std::exchange(taken_, all);
      }
      pause_briefly();
    }
  }

 private:
  static constexpr std::size_t kCacheLine = 64;
  std::vector<Item*> slots_;
  alignas(kCacheLine) std::atomic<std::size_t> announced_ = 0;
  alignas(kCacheLine) std::atomic<std::int64_t> returned_;
  alignas(kCacheLine) std::size_t written_ = 0;
  std::int64_t taken_ = 0;
  alignas(kCacheLine) std::size_t read_ = 0;
  std::size_t seen_ = 0;
};

template <typename Way>
Flood flood_by(const Plan& plan, std::int64_t window, std::int64_t run_in_ms) {
  std::vector<Item> pool(static_cast<std::size_t>(window));
  for (Item& item : pool) {
    item.data.assign(static_cast<std::size_t>(plan.size), 1);
  }
  Flood result;
  Way way(window);
  const std::int64_t batch = std::max<std::int64_t>(window / 4, 1);
  std::thread receiver([&] {
    set_up_thread(plan);
    for (const Item* item = way.take(); item != nullptr; item = way.take()) {
      const bool is_whole = item->number == result.received &&
                            is_filled(item->data.data(), item->data.size(), item->number);
      result.damaged += is_whole ? 0 : 1;
      if (++result.received % batch == 0) {
        way.give(batch);
      }
    }
    result.last_received_ns = now_ns();
  });
  std::thread sender([&] {
    set_up_thread(plan);
    Usage at_begin = Usage::now();
    result.first_sent_ns = now_ns();
    const std::int64_t counts_from_ns = result.first_sent_ns + 1'000'000 * run_in_ms;
    std::int64_t end = run_in_ms > 0 ? kNever : plan.count;
    std::int64_t number = 0;
    while (number < end && !is_stopped(plan)) {
      std::int64_t left = way.take_credits();
      if (end == kNever && now_ns() >= counts_from_ns) {
        result.run_in = number;
        end = number + plan.count;
        at_begin = Usage::now();
        result.first_sent_ns = now_ns();
      }
      for (; left > 0 && number < end; --left) {
        Item& item = pool[static_cast<std::size_t>(number % window)];
        item.number = number++;
        fill(item.data.data(), item.data.size(), item.number);
        way.put(&item);
      }
    }
    way.put(nullptr);
    receiver.join();
    result.sent = number - result.run_in;
    result.received -= result.run_in;
    result.usage = Usage::now() - at_begin;
  });
  sender.join();
  return result;
}

}  // namespace

Flood floor_flood(const Plan& plan, std::int64_t window, std::int64_t run_in_ms) {
  return flood_by<LockedWay>(plan, window, run_in_ms);
}

Flood floor_ring_flood(const Plan& plan, std::int64_t window, std::int64_t run_in_ms) {
  return flood_by<RingWay>(plan, window, run_in_ms);
}

}  // namespace fastcycle::measure
