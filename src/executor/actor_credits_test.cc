#include "executor/actor_credits.h"

#include <memory>

#include <gtest/gtest.h>

#include "executor/test_parts.h"

namespace fastcycle::detail {
namespace {

class ActorCreditsTest : public ActorParts {
 protected:
  explicit ActorCreditsTest(bool is_simulated = false)
      : ActorParts(is_simulated),
        speed_(publisher("speed", 1)),
        subscription_(subscriptions_.add(topic("speed"), {}, note())) {
    topics_.connect_all();
  }

  std::size_t left() {
    speed_.owner.enter();
    const std::size_t credits = speed_.ask_credits();
    static_cast<void>(speed_.end_asking());
    speed_.owner.leave();
    return credits;
  }

  PublisherCore& speed_;
  CallbackSubscription& subscription_;
};

class SimulatedActorCredits : public ActorCreditsTest {
 protected:
  SimulatedActorCredits() : ActorCreditsTest(true) {}
};

TEST_F(ActorCreditsTest, AreGivenBackAtOnce) {
  publish(speed_, 1);
  const Inbox::Head head = pop();
  release(head.head.envelope);
  EXPECT_EQ(left(), 0U);

  credits_.give_back(head.lane->credit);

  EXPECT_EQ(left(), 1U);
}

TEST_F(ActorCreditsTest, AreGivenBackWhereTheCallbackEndedItsSubscription) {
  publish(speed_, 1);
  const Inbox::Head head = pop();
  credits_.begin(head.lane->credit);
  release(head.head.envelope);
  const std::weak_ptr<LaneCredit> credit = head.lane->credit;
  subscriptions_.end(subscription_, DropReason::kUnsubscribed);

  credits_.finish();

  EXPECT_FALSE(credit.expired());
  EXPECT_GT(left(), 0U);
}

TEST_F(ActorCreditsTest, HoldNobodyUpWhoseSubscriptionHasEnded) {
  publish(speed_, 1);
  EXPECT_EQ(left(), 0U);

  subscriptions_.end(subscription_, DropReason::kUnsubscribed);

  EXPECT_GT(left(), 0U);
}

TEST_F(ActorCreditsTest, AreWaitedForWhereAllWereUsed) {
  publish(speed_, 1);
  speed_.owner.enter();
  EXPECT_EQ(speed_.ask_credits(), 0U);
  actor_.publishing.asked.push_back(&speed_);

  credits_.finish_asking();

  EXPECT_TRUE(actor_.publishing.asked.empty());
  EXPECT_FALSE(speed_.take_returned_credits());
  credits_.give_back(subscription_.lanes()[0]->credit);
  EXPECT_TRUE(speed_.take_returned_credits());
}

TEST_F(SimulatedActorCredits, AreGivenBackWhenTheRoundIsOver) {
  publish(speed_, 1);
  const Inbox::Head head = pop();
  release(head.head.envelope);

  credits_.give_back(head.lane->credit);

  EXPECT_EQ(left(), 0U);
  stage_.hand_over();
  EXPECT_EQ(left(), 1U);
}

}  // namespace
}  // namespace fastcycle::detail
