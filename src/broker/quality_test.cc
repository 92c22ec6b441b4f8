#include "broker/quality.h"

#include <optional>
#include <string>
#include <vector>

#include <google/protobuf/wrappers.pb.h>
#include <gtest/gtest.h>

#include "base/clock.h"
#include "broker/topics.h"

namespace fastcycle::detail {
namespace {

using google::protobuf::Int64Value;
using namespace std::chrono_literals;

class NoQueue final : public ReadyQueue {
 public:
  void enqueue(std::uint32_t) noexcept override {}
  void wake() noexcept override {}
  void prepare(std::uint32_t) noexcept override {}
};

/// One subscription of a topic with two publishers; nobody takes what waits.
class QualityOfService : public ::testing::Test {
 protected:
  QualityOfService() {
    inbox_.attach(queue_, 0);
    for (PublishingComponent* owner : {&one_, &two_}) {
      owner->clock = &clock_;
      owner->enter();
    }
    one_.name = "one";
    two_.name = "two";
  }

  Quality& subscribe(const SubscriberOptions& options) {
    for (PublishingComponent* owner : {&one_, &two_}) {
      publishers_.push_back(
          &topics_.add_publisher("t", *owner, Int64Value::default_instance(), nullptr, false));
    }
    Topic& topic = *topics_.find("t");
    topic.subscriptions.push_back(std::make_unique<Subscription>(
        topic, inbox_, "me", Subscription::Kind::kCallback, options));
    topics_.connect_all();
    Quality& quality = *topic.subscriptions.back()->quality;
    quality.begin(at(0ms));
    return quality;
  }

  void publish(std::size_t publisher, Duration time) {
    clock_.set_simulated(kSimulatedStart + time);
    for (PublishingComponent* owner : {&one_, &two_}) {
      owner->now = clock_.now();
    }
    publishers_[publisher]->publish(publishers_[publisher]->loan(true), {});
  }

  static std::int64_t at(Duration time) { return base::to_ns(kSimulatedStart + time); }

  NoQueue queue_;
  base::Clock clock_ = base::Clock::simulated();
  Inbox inbox_;
  PublishingComponent one_;
  PublishingComponent two_;
  Topics topics_;
  std::vector<PublisherCore*> publishers_;
};

TEST_F(QualityOfService, ADeadlineIsOverRightAfterItsLastNanosecond) {
  Quality& quality = subscribe({.deadline = 10ms});

  EXPECT_EQ(quality.next_look_ns(), at(10ms) + 1);
  EXPECT_FALSE(quality.look(at(10ms)));
  const auto event = quality.look(at(10ms) + 1);
  ASSERT_TRUE(event);
  EXPECT_EQ(event->kind, QosKind::kDeadlineMissed);
  EXPECT_EQ(event->topic, "t");
  EXPECT_EQ(event->count, 1U);
  EXPECT_EQ(event->since, kSimulatedStart);
  EXPECT_EQ(quality.next_look_ns(), at(20ms) + 1);
}

TEST_F(QualityOfService, WhoLooksLateFindsOneEventThatCountsAllPeriods) {
  Quality& quality = subscribe({.deadline = 10ms});
  publish(0, 3ms);

  const auto event = quality.look(at(47ms));
  ASSERT_TRUE(event);
  EXPECT_EQ(event->count, 4U);
  EXPECT_EQ(event->since, kSimulatedStart + 3ms);
  EXPECT_FALSE(quality.look(at(47ms))) << "each period once";
  EXPECT_EQ(quality.next_look_ns(), at(53ms) + 1);
}

TEST_F(QualityOfService, WhatWaitsWhileItsReceiverIsBusyCountsAsThere) {
  Quality& quality = subscribe({.deadline = 10ms});
  for (int ms = 8; ms <= 96; ms += 8) {
    publish(0, std::chrono::milliseconds(ms));
  }

  EXPECT_FALSE(quality.look(at(97ms))) << "nobody took any of them, but they came";
  EXPECT_EQ(quality.next_look_ns(), at(106ms) + 1);
  EXPECT_TRUE(quality.look(at(107ms)));
}

TEST_F(QualityOfService, WhatAFullQueueRefusedCountsAsThere) {
  Quality& quality = subscribe({.depth = 2, .overflow = Overflow::kDropNewest, .deadline = 10ms});
  for (int ms = 8; ms <= 96; ms += 8) {
    publish(0, std::chrono::milliseconds(ms));
  }

  EXPECT_FALSE(quality.look(at(97ms)));
  EXPECT_TRUE(quality.look(at(108ms)));
}

TEST_F(QualityOfService, ADeadlineIsKeptByAnyPublisherAndALeaseByEachOne) {
  Quality& quality = subscribe({.deadline = 10ms, .liveliness = 10ms});
  publish(0, 6ms);
  publish(0, 12ms);

  const auto event = quality.look(at(13ms));
  ASSERT_TRUE(event);
  EXPECT_EQ(event->kind, QosKind::kLivelinessLost);
  EXPECT_EQ(event->publisher, "two");
  EXPECT_EQ(event->reason, "silent");
  EXPECT_FALSE(quality.look(at(14ms))) << "reported once";
}

TEST_F(QualityOfService, AFailedPublisherIsLostOnceAndAliveAgainOnlyByWhatCameLater) {
  Quality& quality = subscribe({.on_event = [](const QosEvent&) {}});
  publish(0, 5ms);

  EXPECT_TRUE(quality.on_liveliness(publishers_[0]->id, false, "failed", at(6ms)));
  EXPECT_FALSE(quality.on_liveliness(publishers_[0]->id, false, "stopped", at(7ms)));
  Inbox::Head head;
  ASSERT_TRUE(inbox_.peek(head));
  QosEvent event;
  EXPECT_EQ(quality.judge(*head.lane, head.head, at(8ms), event), Quality::Verdict::kDeliver)
      << "it was published before";
  ASSERT_TRUE(Inbox::pop(head));
  quality.took(*head.lane, head.head);
  release(head.head.envelope);
  publish(0, 9ms);
  ASSERT_TRUE(inbox_.peek(head));
  EXPECT_EQ(quality.judge(*head.lane, head.head, at(9ms), event), Quality::Verdict::kReport);
  EXPECT_EQ(event.kind, QosKind::kLivelinessGained);
  EXPECT_EQ(quality.judge(*head.lane, head.head, at(9ms), event), Quality::Verdict::kDeliver);
}

TEST_F(QualityOfService, ASubscriptionThatAsksForNothingHasNone) {
  const TopicOptions none;
  const Topic topic("t", none);
  EXPECT_FALSE(Quality::is_asked_for(topic, {.depth = 3, .keep = 1, .history = 2}));
}

}  // namespace
}  // namespace fastcycle::detail
