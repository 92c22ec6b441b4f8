#pragma once

// The parts of an actor, for tests of single parts: messages are delivered, and only the test
// serves it.

#include <cstdint>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include <google/protobuf/wrappers.pb.h>
#include <gtest/gtest.h>

#include "broker/topics.h"
#include "executor/activator.h"

namespace fastcycle::detail {

class SilentQueue final : public ReadyQueue {
 public:
  void enqueue(std::uint32_t) noexcept override {}
  void prepare(std::uint32_t) noexcept override {}
  void wake() noexcept override {}
};

struct PartsBase final : ActorBase {
  explicit PartsBase(const base::Clock& its_clock) : ActorBase("reader", 0, its_clock) {}
  ~PartsBase() = default;
};

/// A component `reader` on a clock of the test's choice, and publishers of others.
class ActorParts : public ::testing::Test {
 protected:
  using Int64Value = google::protobuf::Int64Value;

  explicit ActorParts(bool is_simulated = false)
      : clock_(is_simulated ? base::Clock::simulated() : base::Clock::live()) {
    if (is_simulated) {
      actor_.publishing.stage = &stage_;
    }
    actor_.inbox.attach(queue_, 0);
  }

  PublisherCore& publisher(const std::string& topic, std::size_t credits = 0) {
    owners_.push_back(std::make_unique<PublishingComponent>());
    PublishingComponent& owner = *owners_.back();
    owner.name = "writer of " + topic;
    owner.clock = &clock_;
    PublisherCore& core =
        topics_.add_publisher(topic, owner, Int64Value::default_instance(), nullptr, false);
    core.use_credits(credits);
    return core;
  }
  Topic& topic(const std::string& name) {
    return topics_.get(name, "reader", Int64Value::default_instance());
  }
  /// A callback that records the values of its messages.
  EnvelopeCallback note() {
    return [this](Envelope&, const google::protobuf::Message& message) {
      received_.push_back(static_cast<const Int64Value&>(message).value());
    };
  }
  static void publish(PublisherCore& core, std::int64_t value) {
    core.owner.enter();
    Envelope* loan = core.loan(true);
    static_cast<Int64Value&>(*loan->own).set_value(value);
    core.publish(loan, {});
    core.owner.leave();
  }
  /// Takes the oldest message out of the inbox.
  [[nodiscard]] Inbox::Head pop() {
    Inbox::Head head;
    EXPECT_TRUE(actor_.inbox.peek(head) && Inbox::pop(head));
    return head;
  }
  static std::uint64_t dropped(const Subscription& subscription, DropReason reason) {
    return subscription.ledger().dropped[static_cast<std::size_t>(reason)];
  }

  const base::Clock clock_;
  SilentQueue queue_;
  std::vector<std::unique_ptr<PublishingComponent>> owners_;
  std::vector<std::int64_t> received_;
  std::vector<std::string> faults_;
  PartsBase actor_{clock_};
  Topics topics_;
  ActivationRing ring_;
  TurnClock turn_{clock_};
  RoundStage stage_;
  HeldOrigins held_{actor_.publishing};
  ActorCredits credits_{actor_, stage_};
  SubscriptionSet subscriptions_{actor_, held_, credits_,
                                 [](const Subscription&, std::uint32_t) {}};
  Activator activator_{actor_,   turn_,
                       held_,    subscriptions_,
                       credits_, [this](std::string_view what) { faults_.emplace_back(what); }};
};

}  // namespace fastcycle::detail
