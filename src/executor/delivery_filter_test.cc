#include "executor/delivery_filter.h"

#include <gtest/gtest.h>

#include "executor/subscription_set.h"
#include "executor/test_parts.h"

namespace fastcycle::detail {
namespace {

using Decision = DeliveryFilter::Decision;

class DeliveryFilterTest : public ActorParts {
 protected:
  /// Judges the oldest message of the inbox, and releases what was taken out.
  DeliveryFilter::Verdict take() {
    Inbox::Head head;
    EXPECT_TRUE(actor_.inbox.peek(head));
    const auto verdict = DeliveryFilter::take(head, actor_.publishing.now);
    if (verdict.decision == Decision::kDeliver || verdict.decision == Decision::kDrop) {
      release(head.head.envelope);
    }
    return verdict;
  }
};

TEST_F(DeliveryFilterTest, ReportsAGapBeforeTheMessageAfterIt) {
  PublisherCore& speed = publisher("speed");
  subscriptions_.add(topic("speed"), {.depth = 1, .on_event = [](const QosEvent&) {}}, note());
  topics_.connect_all();
  publish(speed, 1);
  EXPECT_EQ(take().decision, Decision::kDeliver);
  publish(speed, 2);
  publish(speed, 3);

  const auto verdict = take();
  EXPECT_EQ(verdict.decision, Decision::kWait);
  ASSERT_TRUE(verdict.event);
  EXPECT_EQ(verdict.event->kind, QosKind::kMessageLost);
  EXPECT_EQ(take().decision, Decision::kDeliver);
}

TEST_F(DeliveryFilterTest, ReportsNothingOfALaneThatIsClosed) {
  PublisherCore& speed = publisher("speed");
  CallbackSubscription& subscription =
      subscriptions_.add(topic("speed"), {.depth = 1, .on_event = [](const QosEvent&) {}}, note());
  topics_.connect_all();
  publish(speed, 1);
  EXPECT_EQ(take().decision, Decision::kDeliver);
  publish(speed, 2);
  publish(speed, 3);
  // As if its publisher had pushed them before it saw that the receiver has failed.
  subscription.lanes().front()->close_reason = DropReason::kFault;

  const auto verdict = take();
  EXPECT_EQ(verdict.decision, Decision::kDeliver) << "the receiver drains it";
  EXPECT_FALSE(verdict.event);
}

}  // namespace
}  // namespace fastcycle::detail
