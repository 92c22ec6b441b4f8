#include "executor/activator.h"

#include <stdexcept>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "executor/test_parts.h"

namespace fastcycle::detail {
namespace {

using ActivatorTest = ActorParts;

TEST_F(ActivatorTest, CallsWithAMessageAndAccountsForIt) {
  PublisherCore& speed = publisher("speed");
  CallbackSubscription& subscription = subscriptions_.add(topic("speed"), {}, note());
  topics_.connect_all();
  publish(speed, 7);

  activator_.run(ring_, pop());

  EXPECT_EQ(received_, (std::vector<std::int64_t>{7}));
  const Ledger ledger = subscription.ledger();
  EXPECT_EQ(ledger.delivered, 1U);
  EXPECT_EQ(ledger.queued, 0U);
  EXPECT_EQ(actor_.statistics.activations.get(), 1U);
  const auto records = ring_.snapshot();
  ASSERT_EQ(records.size(), 1U);
  EXPECT_EQ(records[0].cause, Cause::kMessage);
  EXPECT_EQ(records[0].publisher, speed.id);
  EXPECT_EQ(records[0].outcome, Outcome::kDone);
  EXPECT_GE(records[0].time_ns, records[0].cause_ns) << "no message from the future";
  EXPECT_EQ(held_.oldest(records[0].time_ns).root, speed.id);
}

TEST_F(ActivatorTest, NumbersWhatItRuns) {
  int called = 0;
  const Control control{.cause = Cause::kMode, .body = [&] { ++called; }};
  activator_.run(ring_, control);
  activator_.run(ring_, control);

  EXPECT_EQ(called, 2);
  const auto records = ring_.snapshot();
  ASSERT_EQ(records.size(), 2U);
  EXPECT_EQ(records[0].number, 1U);
  EXPECT_EQ(records[1].number, 2U);
  EXPECT_LE(records[0].begin_ns + records[0].duration_ns, records[1].begin_ns);
}

TEST_F(ActivatorTest, TellsOfAFaultAfterTheActivation) {
  CallbackSubscription& failing =
      subscriptions_.add(topic("speed"), {}, [](Envelope&, const google::protobuf::Message&) {
        throw std::runtime_error("no such lane");
      });
  PublisherCore& speed = publisher("speed");
  topics_.connect_all();
  publish(speed, 1);

  activator_.run(ring_, pop());

  EXPECT_EQ(faults_, (std::vector<std::string>{"its callback for \"speed\" threw: no such lane"}));
  EXPECT_EQ(actor_.statistics.faults.get(), 1U);
  EXPECT_EQ(ring_.snapshot().back().outcome, Outcome::kFault);
  EXPECT_EQ(failing.ledger().delivered, 1U);
  EXPECT_FALSE(actor_.publishing.is_active_here());
}

TEST_F(ActivatorTest, FinishesWhatACallbackLeavesBehind) {
  CallbackSubscription& ended = subscriptions_.add(topic("speed"), {}, note());
  bool was_there = false;
  activator_.run(ring_, Control{.cause = Cause::kMode, .body = [&] {
                                  subscriptions_.end(ended, DropReason::kUnsubscribed);
                                  was_there = actor_.publishing.has_leftovers;
                                }});

  EXPECT_TRUE(was_there);
  EXPECT_FALSE(actor_.publishing.has_leftovers);
}

}  // namespace
}  // namespace fastcycle::detail
