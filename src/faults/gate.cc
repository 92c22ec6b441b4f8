#include "faults/gate.h"

#include <algorithm>
#include <mutex>
#include <utility>

#include "broker/pool.h"
#include "broker/subscription.h"
#include "faults/draw.h"

namespace fastcycle::faults {

using config::Corruption;
using config::FaultDescription;
using config::FaultKind;
using detail::Envelope;
using detail::Subscription;

Gate::Gate(detail::PublisherCore& publisher, std::vector<Part> parts, const GateClock& clock)
    : publisher_(publisher),
      parts_(std::move(parts)),
      drawn_(parts_.size()),
      clock_(clock),
      copies_(new detail::Pool(&publisher.default_instance, publisher.root_count)) {
  keeps_before_ = std::ranges::any_of(parts_, [](const Part& part) {
    const FaultDescription& fault = part.fault->description;
    return fault.kind == FaultKind::kFreeze ||
           (fault.kind == FaultKind::kCorrupt && fault.corruption == Corruption::kStale);
  });
}

Gate::~Gate() {
  give_up();
  for (Envelope* const kept : {before_, last_unfrozen_}) {
    if (kept != nullptr) {
      detail::release(kept);
    }
  }
  copies_->close();
}

bool Gate::is_meant(const FaultDescription& fault, const MessageInfo& info,
                    std::uint64_t bits) const noexcept {
  const std::int64_t begin_ns = clock_.begin_ns.load(std::memory_order_relaxed);
  const std::int64_t time_ns = base::to_ns(info.publish_time);
  if (begin_ns == base::kNever || time_ns >= clock_.end_ns.load(std::memory_order_relaxed) ||
      time_ns - begin_ns < fault.from.count() ||
      (fault.to && time_ns - begin_ns >= fault.to->count())) {
    return false;
  }
  if (!fault.messages.empty() &&
      !std::ranges::binary_search(fault.messages, std::uint64_t{info.sequence})) {
    return false;
  }
  return unit_of(bits) < fault.probability;
}

void Gate::begin(Envelope& message) noexcept {
  for (std::size_t i = 0; i < parts_.size(); ++i) {
    const FaultDescription& fault = parts_[i].fault->description;
    const std::uint64_t bits =
        draw(clock_.seed, fault.name, message.info.publisher, message.info.sequence);
    drawn_[i] = {.is_meant = is_meant(fault, message.info, bits), .bits = mixed(bits)};
  }
}

void Gate::pass(Envelope& message, Subscription& subscription) noexcept {
  Envelope* copied = nullptr;
  const auto writable = [&]() -> Envelope& {
    if (copied == nullptr) {
      copied = copy(message, *message.payload);
    }
    return *copied;
  };
  Duration delay{0};
  unsigned times = 1;
  for (std::size_t i = 0; i < parts_.size(); ++i) {
    const FaultDescription& fault = parts_[i].fault->description;
    if (!drawn_[i].is_meant ||
        (!fault.subscriber.empty() && fault.subscriber != subscription.component)) {
      continue;
    }
    drawn_[i].has_acted = true;
    switch (fault.kind) {
      case FaultKind::kDrop:
        times = 0;
        break;
      case FaultKind::kDelay:
        delay += fault.by;
        break;
      case FaultKind::kDuplicate:
        times *= 2;
        break;
      case FaultKind::kFreeze:
        if (last_unfrozen_ == nullptr) {
          times = 0;  // There was none before.
        } else {
          writable().own->CopyFrom(*last_unfrozen_->payload);
        }
        break;
      case FaultKind::kCorrupt:
        parts_[i].field->corrupt(*writable().own, fault.corruption, fault.value, drawn_[i].bits,
                                 before_ == nullptr ? nullptr : before_->payload);
        break;
      default:
        break;
    }
  }
  if (times == 0) {
    subscription.lost_by_injection.fetch_add(1, std::memory_order_relaxed);
    if (copied != nullptr) {
      detail::release(copied);
    }
    return;
  }
  const auto waiting = waits_until_.find(&subscription);
  if (delay == Duration(0) && waiting == waits_until_.end()) {
    if (copied == nullptr) {
      detail::retain(message);
      copied = &message;
    }
    put(subscription, copied, times);
    return;
  }
  Time due = message.info.publish_time + delay;
  if (waiting != waits_until_.end()) {
    due = std::max(due, waiting->second);
  }
  waits_until_[&subscription] = due;
  const auto place = std::ranges::upper_bound(held_, due, {}, &Held::due);
  held_.insert(place, {due, &subscription, &writable(), times});
  clock_.held();
}

void Gate::end(Envelope& message) noexcept {
  bool is_frozen = false;
  for (std::size_t i = 0; i < parts_.size(); ++i) {
    is_frozen = is_frozen ||
                (drawn_[i].is_meant && parts_[i].fault->description.kind == FaultKind::kFreeze);
    if (drawn_[i].has_acted) {
      ActiveFault& fault = *parts_[i].fault;
      fault.count.fetch_add(1, std::memory_order_relaxed);
      const std::lock_guard lock(fault.mutex);
      if (fault.messages.size() < ActiveFault::kMostKept) {
        fault.messages.push_back(message.info.sequence);
      }
    }
  }
  if (!keeps_before_) {
    return;
  }
  detail::retain(message);
  if (Envelope* const old = std::exchange(before_, &message)) {
    detail::release(old);
  }
  if (!is_frozen) {
    detail::retain(message);
    if (Envelope* const old = std::exchange(last_unfrozen_, &message)) {
      detail::release(old);
    }
  }
}

void Gate::put(Subscription& to, Envelope* envelope, unsigned times) noexcept {
  for (unsigned i = 1; i < times; ++i) {
    detail::retain(*envelope);
    static_cast<void>(publisher_.put_behind_gate(to, envelope));
  }
  static_cast<void>(publisher_.put_behind_gate(to, envelope));
}

Envelope* Gate::copy(const Envelope& message, const google::protobuf::Message& content) {
  Envelope* envelope = copies_->take();
  if (envelope == nullptr) {
    copies_->grow(1);
    envelope = copies_->take();
  }
  envelope->own->CopyFrom(content);
  envelope->payload = envelope->own;
  envelope->info = message.info;
  if (message.trails != nullptr) {
    std::copy_n(message.trails, publisher_.root_count, envelope->trails);
  }
  envelope->references.store(1, std::memory_order_relaxed);
  return envelope;
}

void Gate::put_due(Time now) noexcept {
  const std::lock_guard lock(mutex);
  while (!held_.empty() && held_.front().due <= now) {
    const Held next = held_.front();
    held_.pop_front();
    const auto waiting = waits_until_.find(next.to);
    if (waiting != waits_until_.end() &&
        std::ranges::find(held_, next.to, &Held::to) == held_.end()) {
      waits_until_.erase(waiting);
    }
    put(*next.to, next.envelope, next.times);
  }
}

std::int64_t Gate::next_due_ns() noexcept {
  const std::lock_guard lock(mutex);
  return held_.empty() ? base::kNever : base::to_ns(held_.front().due);
}

void Gate::give_up() noexcept {
  const std::lock_guard lock(mutex);
  for (const Held& held : std::exchange(held_, {})) {
    held.to->lost_by_injection.fetch_add(1, std::memory_order_relaxed);
    detail::release(held.envelope);
  }
  waits_until_.clear();
}

}  // namespace fastcycle::faults
