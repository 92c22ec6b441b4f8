#pragma once

#include <cstddef>
#include <memory>
#include <string>
#include <vector>

#include "broker/inbox.h"
#include "broker/topics.h"

namespace fastcycle::record {

/// Receives all messages of some topics without being woken by them: a publisher pays only for one
/// more queue. The owner of the tap has to empty the queues regularly.
///
/// @threads  `add` by the control thread before the topics are connected; `take` by one thread.
class Tap {
 public:
  /// `name` identifies the receiver in ledgers and reports.
  explicit Tap(std::string name) : name_(std::move(name)) { inbox_.attach(nobody_, 0); }

  /// Receives what is published on `topic` from now on: the queue of each publisher holds `depth`
  /// messages, and `keep` more may be held after they were taken.
  void add(detail::Topic& topic, std::size_t depth, std::size_t keep) {
    auto subscription = std::make_unique<detail::Subscription>(
        topic, inbox_, name_, detail::Subscription::Kind::kTap,
        SubscriberOptions{.depth = depth, .overflow = Overflow::kDropOldest, .keep = keep});
    topic.subscriptions.push_back(std::move(subscription));
  }

  /// Calls `give(lane, head)` for pending messages, lane after lane, at most as many as its depth;
  /// the callee owns the reference to the envelope.
  template <typename Give>
  void take(const Give& give) {
    for (const auto& lane : inbox_.views()) {
      detail::Lane::Head head;
      for (std::size_t i = 0; i < lane->options.depth && lane->peek(head); ++i) {
        if (lane->pop(head)) {
          lane->delivered.add();
          give(*lane, head);
        }
      }
    }
  }

  /// The queues, one per publisher and topic; once the topics are connected.
  [[nodiscard]] const std::vector<std::shared_ptr<detail::Lane>>& lanes() const noexcept {
    return inbox_.views();
  }

 private:
  class Nobody final : public detail::ReadyQueue {
   public:
    void enqueue(std::uint32_t) noexcept override {}
    void wake() noexcept override {}
    void prepare(std::uint32_t) noexcept override {}
  };

  const std::string name_;
  Nobody nobody_;
  detail::Inbox inbox_;
};

}  // namespace fastcycle::record
