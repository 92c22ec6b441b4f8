#include "broker/pool.h"

#include <memory>
#include <utility>

namespace fastcycle::detail {
namespace {

/// What stands in `returned_` once the publisher is gone.
Envelope* closed_mark() noexcept {
  static Envelope mark;
  return &mark;
}

}  // namespace

void recycle(Envelope* envelope) noexcept {
  if (Envelope* foreign = std::exchange(envelope->foreign, nullptr)) {
    release(foreign);
  }
  envelope->pool->give_back(envelope);
}

Pool::Pool(const google::protobuf::Message* default_instance, std::size_t trails)
    : default_instance_(default_instance), trail_count_(trails) {}

void Pool::grow(std::size_t count, const google::protobuf::Message* prototype) {
  // Side by side: less memory than one by one, and fewer pages.
  slabs_.push_back(std::make_unique<Envelope[]>(count));
  if (trail_count_ > 0) {
    trails_.push_back(std::make_unique<Trail[]>(count * trail_count_));
  }
  for (std::size_t i = 0; i < count; ++i) {
    Envelope* envelope = &slabs_.back()[i];
    envelope->pool = this;
    envelope->trails = trail_count_ == 0 ? nullptr : &trails_.back()[i * trail_count_];
    if (default_instance_ != nullptr) {
      std::unique_ptr<google::protobuf::Message> message(default_instance_->New());
      if (prototype != nullptr) {
        message->CopyFrom(*prototype);
        message->Clear();
      }
      envelope->own = message.release();
    }
    put_back(envelope);
    size_.fetch_add(1, std::memory_order_relaxed);
    outstanding_.fetch_add(1, std::memory_order_relaxed);
  }
}

Envelope* Pool::take() noexcept {
  if (free_ == nullptr && !is_collected_by_hand_) {
    collect();
  }
  Envelope* envelope = free_;
  if (envelope != nullptr) {
    free_ = envelope->next;
    if (free_ == nullptr) {
      free_ = envelope->next_list;
    } else {
      free_->next_list = envelope->next_list;
    }
    prepare_following();
  }
  return envelope;
}

void Pool::prepare_following() const noexcept {
  // In a burst the next ones were read by another CPU just now.
  if (free_ == nullptr) {
    return;
  }
  __builtin_prefetch(free_->own, 1);
  const auto* second = reinterpret_cast<const char*>(free_->next);
  __builtin_prefetch(second, 1);
  __builtin_prefetch(second + 64, 1);
}

void Pool::collect() noexcept {
  if (returned_.load(std::memory_order_relaxed) == nullptr) {
    return;
  }
  Envelope* list = returned_.exchange(nullptr, std::memory_order_acquire);
  list->next_list = free_;
  free_ = list;
}

void Pool::put_back(Envelope* envelope) noexcept {
  envelope->next_list = free_ != nullptr ? free_->next_list : nullptr;
  envelope->next = free_;
  free_ = envelope;
}

void Pool::give_back(Envelope* envelope) noexcept {
  Envelope* head = returned_.load(std::memory_order_acquire);
  do {
    if (head == closed_mark()) {
      envelope->next = nullptr;
      forget(free_all(envelope));
      return;
    }
    envelope->next = head;
  } while (!returned_.compare_exchange_weak(head, envelope, std::memory_order_release,
                                            std::memory_order_acquire));
}

std::size_t Pool::free_all(Envelope* list) noexcept {
  std::size_t count = 0;
  while (list != nullptr) {
    Envelope* next = list->next;
    delete list->own;
    list = next;
    ++count;
  }
  return count;
}

void Pool::forget(std::size_t count) noexcept {
  if (outstanding_.fetch_sub(count, std::memory_order_acq_rel) == count) {
    delete this;
  }
}

void Pool::close() noexcept {
  std::size_t freed = 0;
  while (free_ != nullptr) {
    freed += free_all(std::exchange(free_, free_->next_list));
  }
  freed += free_all(returned_.exchange(closed_mark(), std::memory_order_acq_rel));
  forget(freed + 1);
}

}  // namespace fastcycle::detail
