#include "executor/suspension.h"

#include <utility>

#include "broker/topic.h"
#include "executor/subscriptions.h"

namespace fastcycle::detail {

void Suspension::suspend() noexcept {
  is_keeping_ = false;
  gate_.store(Gate::kSuspended, std::memory_order_relaxed);
  inbox_.mark_all();
}

void Suspension::suspend_keeping() noexcept {
  is_keeping_ = true;
  gate_.store(Gate::kSuspended, std::memory_order_relaxed);
  inbox_.mark_all();
}

void Suspension::resume() noexcept {
  drop_waiting(false);
  is_keeping_ = false;
  cancel_alarm();
  open();
  inbox_.mark_all();  // Latched messages waited without their bits.
}

void Suspension::drop_waiting(bool with_latched) noexcept {
  if (is_keeping_ && !with_latched) {
    inbox_.take_ready([](Lane&) {});  // `resume` has all looked at.
    return;
  }
  inbox_.take_ready([&](Lane& lane) {
    Subscription& subscription = lane.subscription;
    if (subscription.is_called() &&
        static_cast<CallbackSubscription&>(subscription).outlives_faults) {
      return;
    }
    const std::size_t kept = with_latched ? 0 : subscription.topic.options.latched;
    Lane::Head head;
    while (lane.holds_more_than(kept) && lane.peek(head)) {
      if (lane.pop(head)) {
        (lane.is_closed() ? lane.drained : subscription.inactive).add();
        release(head.envelope);
        if (lane.credit != nullptr) {
          give_back_(lane.credit);
        }
      }
    }
  });
}

void Suspension::set_alarm(Time due, std::function<void()> action) {
  alarm_ns_ = base::to_ns(due);
  alarm_ = std::move(action);
}

std::function<void()> Suspension::take_alarm() noexcept {
  alarm_ns_ = base::kNever;
  return std::exchange(alarm_, nullptr);
}

}  // namespace fastcycle::detail
