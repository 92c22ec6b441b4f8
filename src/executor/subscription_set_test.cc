#include "executor/subscription_set.h"

#include <array>
#include <memory>
#include <optional>
#include <utility>

#include <gtest/gtest.h>

#include "executor/synchronizer.h"
#include "executor/test_parts.h"

namespace fastcycle::detail {
namespace {

using SubscriptionSetTest = ActorParts;

TEST_F(SubscriptionSetTest, KeepsTheCallbackOfAnEndedOneUntilTheActivationIsOver) {
  auto owned = std::make_shared<int>(0);
  const std::weak_ptr<int> watched = owned;
  CallbackSubscription& subscription = subscriptions_.add(
      topic("speed"), {},
      [owned = std::move(owned)](Envelope&, const google::protobuf::Message&) {});

  subscriptions_.end(subscription, DropReason::kUnsubscribed);
  subscriptions_.end(subscription, DropReason::kUnsubscribed);

  EXPECT_TRUE(subscription.is_ended);
  EXPECT_TRUE(actor_.publishing.has_leftovers);
  EXPECT_FALSE(watched.expired());
  subscriptions_.destroy_ended();
  EXPECT_TRUE(watched.expired());
}

TEST_F(SubscriptionSetTest, EndsOnesThatOwnEachOther) {
  struct Handle {
    ~Handle() { set->end(*subscription, DropReason::kUnsubscribed); }
    SubscriptionSet* set;
    CallbackSubscription* subscription;
  };
  CallbackSubscription& owned = subscriptions_.add(topic("a"), {}, note());
  auto handle = std::shared_ptr<Handle>(new Handle{&subscriptions_, &owned});
  CallbackSubscription& owner = subscriptions_.add(
      topic("b"), {}, [handle = std::move(handle)](Envelope&, const google::protobuf::Message&) {});

  subscriptions_.end(owner, DropReason::kUnsubscribed);
  subscriptions_.destroy_ended();

  EXPECT_TRUE(owned.is_ended);
  EXPECT_EQ(owned.callback, nullptr);
}

TEST_F(SubscriptionSetTest, MakesAnEndedOneAgainIfItAsksForTheSame) {
  CallbackSubscription& first = subscriptions_.add(topic("speed"), {.depth = 4}, note());
  subscriptions_.end(first, DropReason::kUnsubscribed);

  CallbackSubscription& deeper = subscriptions_.add_again(topic("speed"), {.depth = 5}, note());
  CallbackSubscription& same = subscriptions_.add_again(topic("speed"), {.depth = 4}, note());

  EXPECT_NE(&deeper, &first);
  EXPECT_EQ(&same, &first);
  EXPECT_FALSE(same.is_ended);
  EXPECT_EQ(subscriptions_.callbacks().size(), 2U);
}

TEST_F(SubscriptionSetTest, LeavesOpenAfterAFaultWhatOutlivesIt) {
  PublisherCore& speed = publisher("speed");
  CallbackSubscription& plain = subscriptions_.add(topic("speed"), {}, note());
  CallbackSubscription& outliving = subscriptions_.add(topic("speed"), {}, note());
  outliving.outlives_faults = true;
  topics_.connect_all();
  publish(speed, 1);

  subscriptions_.close(DropReason::kFault);

  EXPECT_EQ(dropped(plain, DropReason::kFault), 1U);
  Inbox::Head head;
  ASSERT_TRUE(subscriptions_.peek_outliving(head));
  EXPECT_EQ(&head.lane->subscription, &outliving);
  subscriptions_.close(DropReason::kShutdown);
  EXPECT_FALSE(subscriptions_.peek_outliving(head));
  EXPECT_EQ(dropped(outliving, DropReason::kShutdown), 1U);
}

TEST_F(SubscriptionSetTest, BringsViewsUpToDateAndTheTimeWithThem) {
  PublisherCore& speed = publisher("speed");
  auto made =
      std::make_unique<View>(topic("speed"), actor_, Subscription::Kind::kLatest, 1, std::nullopt);
  View& view = *made;
  topic("speed").subscriptions.push_back(std::move(made));
  EXPECT_FALSE(subscriptions_.has_views());
  subscriptions_.add(view);
  topics_.connect_all();
  publish(speed, 7);

  subscriptions_.refresh_views();

  EXPECT_TRUE(subscriptions_.has_views());
  ASSERT_EQ(view.held.size(), 1U);
  EXPECT_EQ(actor_.publishing.now, view.held[0]->info.publish_time);
  EXPECT_EQ(held_.oldest(base::to_ns(actor_.publishing.now)).root, speed.id);
}

TEST_F(SubscriptionSetTest, LetsGoOfWhatItsSynchronizersHold) {
  PublisherCore& left = publisher("left");
  static_cast<void>(publisher("right"));
  const std::array<Topic*, 2> topics{&topic("left"), &topic("right")};
  const std::array<SubscriberOptions, 2> queues{};
  Synchronizer& synchronizer =
      subscriptions_.synchronize(topics, queues, {.depth = 4}, [](std::span<const SetMember>) {});
  topics_.connect_all();
  publish(left, 1);
  const Inbox::Head head = pop();
  synchronizer.take(synchronizer.input(0), *head.head.envelope);
  release(head.head.envelope);

  subscriptions_.drop_held(DropReason::kInactive);

  EXPECT_EQ(dropped(synchronizer.input(0), DropReason::kInactive), 1U);
  EXPECT_EQ(subscriptions_.callbacks().size(), 2U);
}

}  // namespace
}  // namespace fastcycle::detail
