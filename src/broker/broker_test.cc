// From publish to inbox: publishers, lanes, inbox and ledger together, with a queue that only
// notes.

#include <array>
#include <atomic>
#include <chrono>
#include <functional>
#include <memory>
#include <mutex>
#include <numeric>
#include <optional>
#include <set>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include <gmock/gmock.h>
#include <google/protobuf/wrappers.pb.h>
#include <gtest/gtest.h>

#include "broker/topics.h"

namespace fastcycle::detail {
namespace {

using google::protobuf::BytesValue;
using google::protobuf::Int64Value;

/// Counts what an executor would do.
class NotingQueue final : public ReadyQueue {
 public:
  void enqueue(std::uint32_t) noexcept override { is_queued = true; }
  void prepare(std::uint32_t) noexcept override {}
  void wake() noexcept override { ++wakes; }

  std::atomic<bool> is_queued{false};
  std::atomic<int> wakes{0};
};

/// One topic with publishers and subscribers, in the words of the tests below.
class Broker : public ::testing::Test {
 protected:
  struct Receiver {
    NotingQueue queue;
    Inbox inbox;
    Subscription* subscription = nullptr;

    Receiver() { inbox.attach(queue, 0); }

    /// Takes the oldest message, as a worker does.
    std::optional<std::int64_t> take() {
      Inbox::Head head;
      while (inbox.peek(head)) {
        if (!Inbox::pop(head)) {
          continue;
        }
        head.lane->delivered.add();
        last_payload = head.head.envelope->payload;
        last_info = head.head.envelope->info;
        const auto value = static_cast<const Int64Value&>(*last_payload).value();
        release(head.head.envelope);
        return value;
      }
      return std::nullopt;
    }

    /// Takes the oldest message, as a worker does whose callback takes samples.
    template <typename Callback>
    bool take_sample(const Callback& callback) {
      Inbox::Head head;
      if (!inbox.peek(head) || !Inbox::pop(head)) {
        return false;
      }
      head.lane->delivered.add();
      callback(share<Int64Value>(*head.head.envelope, subscription->holder));
      release(head.head.envelope);
      return true;
    }

    std::vector<std::int64_t> take_all() {
      std::vector<std::int64_t> values;
      while (const auto value = take()) {
        values.push_back(*value);
      }
      return values;
    }

    const google::protobuf::Message* last_payload = nullptr;
    MessageInfo last_info;
  };

  PublisherCore& publisher(const std::string& component, TopicOptions options = {},
                           bool is_external = false) {
    topics_.set_options("t", options);
    owners_.push_back(std::make_unique<PublishingComponent>());
    owners_.back()->name = component;
    owners_.back()->clock = &clock_;
    owners_.back()->enter();
    return topics_.add_publisher("t", *owners_.back(), Int64Value::default_instance(), nullptr,
                                 is_external);
  }

  Receiver& receiver(SubscriberOptions options = {},
                     Subscription::Kind kind = Subscription::Kind::kCallback) {
    receivers_.push_back(std::make_unique<Receiver>());
    Receiver& receiver = *receivers_.back();
    Topic& topic = topics_.get("t", "receiver", Int64Value::default_instance());
    topic.subscriptions.push_back(
        std::make_unique<Subscription>(topic, receiver.inbox, "receiver", kind, options));
    receiver.subscription = topic.subscriptions.back().get();
    return receiver;
  }

  void connect() { topics_.connect_all(); }

  [[nodiscard]] static std::uint64_t dropped(const Receiver& receiver, DropReason reason) {
    return receiver.subscription->ledger().dropped[static_cast<std::size_t>(reason)];
  }

  static void publish(PublisherCore& publisher, std::int64_t value) {
    publisher.owner.enter();
    Envelope* loan = publisher.loan(true);
    static_cast<Int64Value&>(*loan->own).set_value(value);
    publisher.publish(loan, {});
  }

  base::Clock clock_ = base::Clock::live();
  std::vector<std::unique_ptr<PublishingComponent>> owners_;
  std::vector<std::unique_ptr<Receiver>> receivers_;
  Topics topics_;
};

/// Has `sender` publish what another application had published.
void publish_arrived(PublisherCore& sender, std::int64_t value, const Arrival& arrival) {
  Envelope* loan = take_external_loan(sender, true);
  static_cast<Int64Value&>(*loan->own).set_value(value);
  sender.publish_arrived(loan, arrival);
}

TEST_F(Broker, WhatAnotherApplicationPublishedKeepsItsTimeAndItsOrigin) {
  PublisherCore& sender = publisher("gateway", {}, true);
  Receiver& receiver = this->receiver();
  connect();
  sender.set_external_open(true);
  const Time now = clock_.now();

  publish_arrived(sender, 1,
                  {.published = now - std::chrono::milliseconds(20),
                   .origin = {.taken = now - std::chrono::milliseconds(50), .root = 77},
                   .came = now});
  publish_arrived(sender, 2,
                  {.published = now - std::chrono::milliseconds(30),
                   .origin = {.taken = now - std::chrono::milliseconds(60), .root = 0},
                   .came = now});
  publish_arrived(sender, 3, {.published = now + std::chrono::hours(1), .origin = {}, .came = now});

  EXPECT_EQ(receiver.take(), 1);
  EXPECT_EQ(receiver.last_info.sequence, 1U);
  EXPECT_EQ(receiver.last_info.publish_time, now - std::chrono::milliseconds(20));
  EXPECT_EQ(receiver.last_info.origin.taken, now - std::chrono::milliseconds(50));
  EXPECT_EQ(receiver.last_info.origin.root, 77U);
  EXPECT_EQ(receiver.take(), 2);
  // Of one publisher it never goes back.
  EXPECT_EQ(receiver.last_info.publish_time,
            now - std::chrono::milliseconds(20) + std::chrono::nanoseconds(1));
  EXPECT_EQ(receiver.last_info.origin.root, sender.id);
  EXPECT_EQ(receiver.take(), 3);
  EXPECT_LE(receiver.last_info.publish_time, clock_.now());
}

TEST_F(Broker, WhatWasLostOnALinkIsInTheLedgerOfEachSubscription) {
  PublisherCore& sender = publisher("gateway", {}, true);
  Receiver& first = this->receiver();
  Receiver& second = this->receiver({}, Subscription::Kind::kLatest);
  connect();
  sender.set_external_open(true);
  const Time now = clock_.now();

  publish_arrived(sender, 1, {.published = now, .came = now});
  publish_arrived(sender, 5, {.published = now, .came = now, .lost = 3});
  (void)first.take_all();

  for (const Receiver* const receiver : {&first, &second}) {
    const Ledger ledger = receiver->subscription->ledger();
    EXPECT_EQ(ledger.published, 5U);
    EXPECT_EQ(dropped(*receiver, DropReason::kLink), 3U);
    EXPECT_TRUE(ledger.adds_up());
  }
}

TEST_F(Broker, ChainsGoOnFromAnotherApplication) {
  topics_.set_chains({"elsewhere", "t"}, {});
  PublisherCore& sender = publisher("gateway", {}, true);
  Receiver& receiver = this->receiver();
  connect();
  sender.set_external_open(true);
  const Time now = clock_.now();
  std::array<Trail, 2> trails;
  trails[0].begin(now - std::chrono::milliseconds(50), 7, now - std::chrono::milliseconds(40));

  publish_arrived(sender, 1,
                  {.published = now - std::chrono::milliseconds(40),
                   .origin = {.taken = now - std::chrono::milliseconds(50), .root = 7},
                   .came = now - std::chrono::milliseconds(10),
                   .trails = trails});

  Inbox::Head head;
  ASSERT_TRUE(receiver.inbox.peek(head) && Inbox::pop(head));
  const Trail* const came = head.head.envelope->trails;
  ASSERT_EQ(came[0].hops().size(), 2U);
  EXPECT_EQ(came[0].taken(), now - std::chrono::milliseconds(50));
  EXPECT_EQ(came[0].hops()[0].publisher, 7U);
  EXPECT_EQ(came[0].hops()[1].publisher, sender.id);
  EXPECT_EQ(came[0].hops()[1].begin, now - std::chrono::milliseconds(10));
  EXPECT_GE(came[0].hops()[1].published, now);
  // The topic is itself where a chain begins, of which nothing is known from there.
  ASSERT_EQ(came[1].hops().size(), 1U);
  EXPECT_EQ(came[1].taken(), now - std::chrono::milliseconds(50));
  release(head.head.envelope);
}

TEST_F(Broker, WhatIsPublishedAgainKeepsSequenceTimeAndOrigin) {
  PublisherCore& sender = publisher("driver");
  Receiver& receiver = this->receiver();
  connect();
  const MessageInfo then{
      .sequence = std::uint64_t{1} << 40U,
      .publish_time = Time{std::chrono::seconds(7)},
      .publisher = 0,
      .origin = {.taken = Time{std::chrono::seconds(6)}, .root = 0, .held = true}};
  const auto publish_again = [&](std::int64_t value, const MessageInfo& info) {
    Envelope* loan = take_external_loan(sender, true);
    static_cast<Int64Value&>(*loan->own).set_value(value);
    sender.publish_again(loan, info);
  };

  publish_again(1, then);  // Nobody is served yet.
  sender.set_external_open(true);
  publish_again(2, then);
  MessageInfo another = then;
  another.sequence += 5;
  another.origin.root = 77;
  publish_again(3, another);

  EXPECT_EQ(receiver.take(), 2);
  EXPECT_EQ(receiver.last_info.sequence, then.sequence);
  EXPECT_EQ(receiver.last_info.publish_time, then.publish_time);
  EXPECT_EQ(receiver.last_info.publisher, sender.id);
  EXPECT_EQ(receiver.last_info.origin.taken, then.origin.taken);
  EXPECT_EQ(receiver.last_info.origin.root, sender.id);
  EXPECT_TRUE(receiver.last_info.origin.held);
  EXPECT_EQ(receiver.take(), 3);
  EXPECT_EQ(receiver.last_info.sequence, another.sequence);
  EXPECT_EQ(receiver.last_info.origin.root, 77U);
  const Ledger ledger = receiver.subscription->ledger();
  EXPECT_EQ(ledger.published, 3U);
  EXPECT_EQ(ledger.dropped[static_cast<std::size_t>(DropReason::kShutdown)], 1U);
  EXPECT_TRUE(ledger.adds_up());
}

TEST_F(Broker, AMessageReachesEverySubscriberAsTheSameObject) {
  PublisherCore& speed = publisher("planner");
  for (int i = 0; i < 64; ++i) {
    receiver();
  }
  connect();
  Envelope* loan = speed.loan(true);
  const google::protobuf::Message* written = loan->own;
  static_cast<Int64Value&>(*loan->own).set_value(7);

  speed.publish(loan, {});

  for (const auto& receiver : receivers_) {
    EXPECT_EQ(receiver->take(), 7);
    EXPECT_EQ(receiver->last_payload, written);
  }
}

TEST_F(Broker, LateSubscriptionsStandInAnOrderThatDoesNotSayWhoWasFirst) {
  Inbox inbox;
  Topic& topic = topics_.get("t", "b", Int64Value::default_instance());
  const auto add = [&](const char* component) {
    topic.add(std::make_unique<Subscription>(topic, inbox, component, Subscription::Kind::kCallback,
                                             SubscriberOptions{}));
  };
  add("b");
  add("a");
  connect();
  add("late_z");
  add("late_c");
  add("a");

  std::vector<std::string> components;
  for (const auto& subscription : topic.subscriptions) {
    components.push_back(subscription->component);
  }
  EXPECT_THAT(components, ::testing::ElementsAre("b", "a", "a", "late_c", "late_z"));
}

TEST_F(Broker, ForwardingHandsOnTheSameBytesWithTheForwardersInfo) {
  PublisherCore& first = publisher("first");
  Receiver& middle = receiver();
  connect();
  Topics more;
  PublishingComponent forwarder{.name = "forwarder", .clock = &clock_};
  forwarder.enter();
  PublisherCore& second =
      more.add_publisher("u", forwarder, Int64Value::default_instance(), nullptr, false);
  Receiver last;
  Topic& topic = more.get("u", "last", Int64Value::default_instance());
  topic.subscriptions.push_back(std::make_unique<Subscription>(
      topic, last.inbox, "last", Subscription::Kind::kCallback, SubscriberOptions{}));
  more.connect_all();
  publish(first, 5);
  Inbox::Head head;
  ASSERT_TRUE(middle.inbox.peek(head) && Inbox::pop(head));

  second.forward(head.head.envelope, kNobody);
  const google::protobuf::Message* payload = head.head.envelope->payload;
  release(head.head.envelope);

  EXPECT_EQ(last.take(), 5);
  EXPECT_EQ(last.last_payload, payload);
  EXPECT_EQ(last.last_info.publisher, second.id);
  EXPECT_EQ(last.last_info.origin.root, first.id);
}

TEST_F(Broker, SequencesHaveNoGapsAndPublishTimesNeverGoBack) {
  PublisherCore& speed = publisher("planner");
  Receiver& reader = receiver({.depth = 100});
  connect();

  for (int i = 0; i < 100; ++i) {
    publish(speed, i);
  }

  Time last{};
  for (std::uint64_t expected = 1; reader.take(); ++expected) {
    EXPECT_EQ(reader.last_info.sequence, expected);
    EXPECT_GT(reader.last_info.publish_time, last);
    last = reader.last_info.publish_time;
  }
  EXPECT_EQ(speed.published(), 100U);
}

TEST_F(Broker, MessagesOfSeveralPublishersAreTakenInTheOrderOfTheirPublishing) {
  PublisherCore& a = publisher("a", {.multiple_publishers = true});
  PublisherCore& b = publisher("b");
  Receiver& reader = receiver();
  connect();

  publish(a, 1);
  publish(b, 2);
  publish(b, 3);
  publish(a, 4);

  EXPECT_EQ(reader.take_all(), (std::vector<std::int64_t>{1, 2, 3, 4}));
}

TEST_F(Broker, AFullQueueDropsTheOldestAndCountsIt) {
  PublisherCore& speed = publisher("planner");
  Receiver& reader = receiver({.depth = 3});
  connect();

  for (int i = 1; i <= 5; ++i) {
    publish(speed, i);
  }

  EXPECT_EQ(reader.subscription->ledger().queued, 3U);
  EXPECT_EQ(reader.take_all(), (std::vector<std::int64_t>{3, 4, 5}));
  const Ledger ledger = reader.subscription->ledger();
  EXPECT_EQ(ledger.published, 5U);
  EXPECT_EQ(ledger.delivered, 3U);
  EXPECT_EQ(ledger.dropped[static_cast<std::size_t>(DropReason::kOverflow)], 2U);
  EXPECT_TRUE(ledger.adds_up());
}

TEST_F(Broker, AFullQueueThatDropsTheNewestKeepsWhatCameFirst) {
  PublisherCore& speed = publisher("planner");
  Receiver& reader = receiver({.depth = 2, .overflow = Overflow::kDropNewest});
  connect();

  for (int i = 1; i <= 5; ++i) {
    publish(speed, i);
  }

  EXPECT_EQ(reader.take_all(), (std::vector<std::int64_t>{1, 2}));
  EXPECT_TRUE(reader.subscription->ledger().adds_up());
}

TEST_F(Broker, AQueueForNothingBreaksTheContract) {
  GTEST_FLAG_SET(death_test_style, "threadsafe");
  EXPECT_DEATH(receiver({.depth = 0}), "at least one message may wait");
}

TEST_F(Broker, DroppedMessagesGoBackToThePool) {
  PublisherCore& speed = publisher("planner");
  receiver({.depth = 1});
  connect();
  const auto allocated = speed.allocated();

  for (int i = 0; i < 1'000; ++i) {
    publish(speed, i);
  }

  EXPECT_EQ(speed.allocated(), allocated);
}

TEST_F(Broker, ADryPoolLendsAllTheSameAndCountsTheLossForEverySubscriber) {
  PublisherCore& speed = publisher("planner", {.pool_max = 4});
  Receiver& reader = receiver({.depth = 1});
  connect();
  std::vector<Envelope*> held;
  for (int i = 0; i < 4; ++i) {
    publish(speed, i);
    Inbox::Head head;
    ASSERT_TRUE(reader.inbox.peek(head) && Inbox::pop(head));
    head.lane->delivered.add();
    held.push_back(head.head.envelope);
  }

  for (int i = 0; i < 10; ++i) {
    publish(speed, 100 + i);
  }

  const Ledger ledger = reader.subscription->ledger();
  EXPECT_EQ(ledger.published, 14U);
  EXPECT_EQ(ledger.delivered, 4U);
  EXPECT_EQ(ledger.dropped[static_cast<std::size_t>(DropReason::kPool)], 10U);
  EXPECT_TRUE(ledger.adds_up());
  EXPECT_EQ(speed.allocated(), 5U)
      << "the four that are held, and one that is lent again and again";
  for (Envelope* envelope : held) {
    release(envelope);
  }
  publish(speed, 200);
  EXPECT_EQ(reader.take(), 200) << "once messages came back, all is as before";
}

/// Stores the reported shortages.
class NotingPoolWatch final : public PoolWatch {
 public:
  void ran_short(const PoolShortage& shortage) noexcept override { reported.push_back(shortage); }
  std::vector<PoolShortage> reported;
};

TEST_F(Broker, WhoKeepsTooMuchRunsOutOfItsOwnShareAndNobodyElseLosesAnything) {
  NotingPoolWatch watch;
  PublisherCore& speed = publisher("planner");
  topics_.set_pool_watch(watch);
  Receiver& hoarder = receiver();
  Receiver& reader = receiver();
  connect();
  std::vector<Sample<Int64Value>> kept;
  std::int64_t received = 0;

  for (int i = 0; i < 1'000; ++i) {
    publish(speed, i);
    hoarder.take_sample([&](const Sample<Int64Value>& sample) { kept.push_back(sample); });
    received += reader.take() == i ? 1 : 0;
  }

  EXPECT_EQ(received, 1'000);
  EXPECT_EQ(dropped(reader, DropReason::kPool), 0U);
  EXPECT_GE(kept.size(), 17U) << "what it may have without a word";
  EXPECT_EQ(dropped(hoarder, DropReason::kPool), 1'000 - kept.size());
  EXPECT_TRUE(hoarder.subscription->ledger().adds_up());
  EXPECT_EQ(speed.kept_by(hoarder.subscription->holder), kept.size());
  EXPECT_LE(speed.allocated(), 2U * (2 + 17 + 17) + 64);
  ASSERT_EQ(watch.reported.size(), 3U) << "of the 1st, the 10th and the 100th that is dropped";
  EXPECT_EQ(watch.reported[0].kind, PoolShortage::Kind::kKept);
  EXPECT_EQ(watch.reported[0].publisher, "planner");
  EXPECT_EQ(watch.reported[0].held, kept.size());
  EXPECT_GE(watch.reported[0].share, kept.size());
  kept.clear();
  EXPECT_EQ(speed.kept_by(hoarder.subscription->holder), 0U);
  publish(speed, 1'000);
  EXPECT_EQ(hoarder.take(), 1'000) << "once it let go, all is as before";
}

TEST_F(Broker, OfAPoolThatMayHaveNoMoreThanItNeedsAHoarderGetsWhatItAskedFor) {
  PublisherCore& speed = publisher("planner", {.pool_max = 8});
  Receiver& hoarder = receiver();
  Receiver& reader = receiver();
  connect();
  std::vector<Sample<Int64Value>> kept;

  for (int i = 0; i < 100; ++i) {
    publish(speed, i);
    hoarder.take_sample([&](const Sample<Int64Value>& sample) { kept.push_back(sample); });
    EXPECT_EQ(reader.take(), i);
  }

  EXPECT_EQ(dropped(reader, DropReason::kPool), 0U);
  EXPECT_LE(kept.size(), 17U);
  EXPECT_LE(speed.allocated(), 2U + 17 + 17) << "what all asked for, though the file says less";
}

TEST_F(Broker, WhoKeepsWhatItDeclaredIsNotHeldBack) {
  PublisherCore& speed = publisher("planner", {.pool_max = 300});
  Receiver& keeper = receiver({.depth = 1, .keep = 200});
  Receiver& hoarder = receiver({.depth = 1});
  connect();
  std::vector<Sample<Int64Value>> declared;
  std::vector<Sample<Int64Value>> kept;

  for (int i = 0; i < 1'000; ++i) {
    publish(speed, i);
    keeper.take_sample([&](const Sample<Int64Value>& sample) {
      if (declared.size() == 200) {
        declared.erase(declared.begin());
      }
      declared.push_back(sample);
    });
    hoarder.take_sample([&](const Sample<Int64Value>& sample) { kept.push_back(sample); });
  }

  EXPECT_EQ(keeper.subscription->ledger().delivered, 1'000U);
  EXPECT_GT(dropped(hoarder, DropReason::kPool), 0U);
}

TEST_F(Broker, ManySamplesOfOneMessageCountAsOneMessage) {
  PublisherCore& speed = publisher("planner");
  Receiver& reader = receiver();
  connect();
  publish(speed, 1);
  std::vector<Sample<Int64Value>> kept;

  reader.take_sample([&](const Sample<Int64Value>& sample) {
    for (int i = 0; i < 10; ++i) {
      kept.push_back(sample);
    }
  });

  EXPECT_EQ(speed.kept_by(reader.subscription->holder), 1U);
  kept.pop_back();
  EXPECT_EQ(speed.kept_by(reader.subscription->holder), 1U);
  kept.clear();
  EXPECT_EQ(speed.kept_by(reader.subscription->holder), 0U);
}

TEST_F(Broker, ASampleCountsAsKeptOnlyOnceItIsCopiedOrMovedFrom) {
  PublisherCore& speed = publisher("planner");
  Receiver& reader = receiver();
  connect();
  const Holder holder = reader.subscription->holder;
  const auto serve = [&](const auto& callback) {
    publish(speed, 1);
    ASSERT_TRUE(reader.take_sample(callback));
  };
  Sample<Int64Value> kept;

  serve([&](const Sample<Int64Value>&) { EXPECT_EQ(speed.kept_by(holder), 0U); });
  EXPECT_EQ(speed.kept_by(holder), 0U);
  serve([&](Sample<Int64Value> sample) { kept = std::move(sample); });
  EXPECT_EQ(speed.kept_by(holder), 1U);
  serve([&](const Sample<Int64Value>& sample) { kept = sample; });
  EXPECT_EQ(speed.kept_by(holder), 1U) << "it let go of the one before";
  Sample<Int64Value> moved = std::move(kept);
  EXPECT_EQ(speed.kept_by(holder), 1U);
  moved = {};
  EXPECT_EQ(speed.kept_by(holder), 0U);
}

TEST_F(Broker, SamplesAreCountedRightOnWhicheverThreadsTheyAreCopiedAndLetGo) {
  PublisherCore& speed = publisher("planner");
  Receiver& reader = receiver({.keep = 8});
  connect();
  constexpr int kThreads = 3;
  constexpr int kMessages = 100;
  std::int64_t sum = 0;
  std::mutex mutex;

  for (int i = 0; i < kMessages; ++i) {
    publish(speed, i);
    reader.take_sample([&](const Sample<Int64Value>& lent) {
      std::vector<std::thread> threads;
      for (int thread = 0; thread < kThreads; ++thread) {
        threads.emplace_back([&] {
          std::vector<Sample<Int64Value>> copies(10, lent);
          copies.resize(3);
          const std::lock_guard lock(mutex);
          sum += copies.front()->value();
        });
      }
      for (std::thread& thread : threads) {
        thread.join();
      }
    });
  }

  EXPECT_EQ(sum, std::int64_t{kThreads} * kMessages * (kMessages - 1) / 2);
  EXPECT_EQ(speed.kept_by(reader.subscription->holder), 0U);
  EXPECT_EQ(dropped(reader, DropReason::kPool), 0U);
}

TEST_F(Broker, WhatIsForwardedCountsForTheForwarderUntilItsSubscribersLetGo) {
  PublisherCore& first = publisher("first");
  Receiver& middle = receiver();
  Receiver& reader = receiver();
  connect();
  Topics more;
  PublishingComponent forwarder{.name = "forwarder", .clock = &clock_};
  forwarder.enter();
  PublisherCore& second =
      more.add_publisher("u", forwarder, Int64Value::default_instance(), nullptr, false);
  Receiver last;
  Topic& topic = more.get("u", "last", Int64Value::default_instance());
  topic.subscriptions.push_back(std::make_unique<Subscription>(
      topic, last.inbox, "last", Subscription::Kind::kCallback, SubscriberOptions{.keep = 400}));
  last.subscription = topic.subscriptions.back().get();
  more.connect_all();
  std::vector<Sample<Int64Value>> kept;

  for (int i = 0; i < 500; ++i) {
    publish(first, i);
    middle.take_sample([&](const Sample<Int64Value>& sample) {
      second.forward(envelope_of(sample), holder_of(sample));
    });
    last.take_sample([&](const Sample<Int64Value>& sample) { kept.push_back(sample); });
    EXPECT_EQ(reader.take(), i);
  }

  EXPECT_EQ(first.kept_by(middle.subscription->holder), kept.size());
  EXPECT_GT(dropped(middle, DropReason::kPool), 0U);
  EXPECT_EQ(dropped(reader, DropReason::kPool), 0U);
  kept.clear();
  EXPECT_EQ(first.kept_by(middle.subscription->holder), 0U);
}

TEST_F(Broker, AComponentThatHoardsLoansIsNamedAndThenRefused) {
  NotingPoolWatch watch;
  PublisherCore& speed = publisher("planner", {.pool_max = 10});
  topics_.set_pool_watch(watch);
  receiver({.depth = 1});
  connect();
  std::vector<Envelope*> loans;
  std::string refusal;

  try {
    while (loans.size() < 1'000) {
      loans.push_back(speed.loan(true));
    }
  } catch (const std::length_error& error) {
    refusal = error.what();
  }

  EXPECT_LT(loans.size(), 100U);
  EXPECT_NE(refusal.find("component \"planner\" holds 74 loans of \"t\""), std::string::npos)
      << refusal;
  ASSERT_FALSE(watch.reported.empty());
  EXPECT_EQ(watch.reported.front().kind, PoolShortage::Kind::kLoans);
  EXPECT_EQ(watch.reported.front().component, "planner");
  for (Envelope* loan : loans) {
    speed.return_loan(loan);
  }
  publish(speed, 1);
  EXPECT_EQ(receivers_.front()->take(), 1) << "once they came back, all is as before";
}

TEST_F(Broker, OnlyTheStepFromNothingToSomethingQueuesTheComponent) {
  PublisherCore& speed = publisher("planner");
  Receiver& reader = receiver();
  connect();

  publish(speed, 1);
  publish(speed, 2);
  publish(speed, 3);

  EXPECT_EQ(reader.queue.wakes, 1);
}

TEST_F(Broker, AComponentThatIsBeingServedIsNotQueuedAgain) {
  PublisherCore& speed = publisher("planner");
  Receiver& reader = receiver();
  connect();
  ASSERT_TRUE(reader.inbox.begin());

  publish(speed, 1);

  EXPECT_EQ(reader.queue.wakes, 0);
  EXPECT_FALSE(reader.inbox.try_end_idle()) << "its worker sees the message before it leaves";
  EXPECT_EQ(reader.take(), 1);
  EXPECT_FALSE(reader.take());
  EXPECT_TRUE(reader.inbox.try_end_idle());
}

TEST_F(Broker, ALateSubscriberGetsTheLatchedMessagesFirstAndOnce) {
  PublisherCore& map = publisher("map", {.latched = 2});
  for (int i = 1; i <= 5; ++i) {
    publish(map, i);
  }
  Receiver& late = receiver();
  Topics::connect(map, *late.subscription);

  publish(map, 6);

  EXPECT_EQ(late.take_all(), (std::vector<std::int64_t>{4, 5, 6}));
}

TEST_F(Broker, WhatComesAfterClosingIsCountedForItsReason) {
  PublisherCore& speed = publisher("planner");
  Receiver& reader = receiver();
  connect();
  publish(speed, 1);

  reader.subscription->close(DropReason::kFault);
  publish(speed, 2);

  EXPECT_FALSE(reader.take());
  const Ledger ledger = reader.subscription->ledger();
  EXPECT_EQ(ledger.dropped[static_cast<std::size_t>(DropReason::kFault)], 2U);
  EXPECT_TRUE(ledger.adds_up());
}

TEST_F(Broker, ViewsCauseNoWakeUp) {
  PublisherCore& speed = publisher("planner");
  Receiver& reader = receiver({.depth = 1}, Subscription::Kind::kLatest);
  connect();

  publish(speed, 1);
  publish(speed, 2);

  EXPECT_EQ(reader.queue.wakes, 0);
  EXPECT_TRUE(reader.inbox.is_quiet());
  EXPECT_EQ(
      reader.subscription->ledger().dropped[static_cast<std::size_t>(DropReason::kSuperseded)], 1U);
}

TEST_F(Broker, ATopicFromOutsideNeedsNoPublisher) {
  topics_.set_options("outside", {.external = true});
  Receiver lonely;
  Topic& outside = topics_.get("outside", "d", Int64Value::default_instance());
  outside.subscriptions.push_back(std::make_unique<Subscription>(
      outside, lonely.inbox, "d", Subscription::Kind::kCallback, SubscriberOptions{}));

  EXPECT_TRUE(topics_.conflicts().empty());
}

TEST_F(Broker, ConflictsAreFound) {
  publisher("a");
  publisher("b");
  topics_.get("t", "c", BytesValue::default_instance());
  Receiver lonely;
  Topic& nobody = topics_.get("nobody", "d", Int64Value::default_instance());
  nobody.subscriptions.push_back(std::make_unique<Subscription>(
      nobody, lonely.inbox, "d", Subscription::Kind::kCallback, SubscriberOptions{}));

  const auto conflicts = topics_.conflicts();

  ASSERT_EQ(conflicts.size(), 3U);
  EXPECT_EQ(conflicts[0].kind, TopicConflict::Kind::kTwoTypes);
  EXPECT_EQ(conflicts[1].kind, TopicConflict::Kind::kNoPublisher);
  EXPECT_EQ(conflicts[2].kind, TopicConflict::Kind::kTwoPublishers);
}

TEST_F(Broker, MoreThanSixtyLanesShareBitsAndLoseNothing) {
  constexpr int kPublishers = 150;
  std::vector<PublisherCore*> publishers;
  for (int i = 0; i < kPublishers; ++i) {
    publishers.push_back(&publisher("p" + std::to_string(i), {.multiple_publishers = true}));
  }
  Receiver& reader = receiver();
  connect();

  for (int i = 0; i < kPublishers; ++i) {
    publish(*publishers[static_cast<std::size_t>(i)], i);
  }

  std::vector<std::int64_t> expected(kPublishers);
  std::iota(expected.begin(), expected.end(), 0);
  EXPECT_EQ(reader.take_all(), expected);
}

// Two publishers push as fast as they can into depths of 1 and 8 while a worker takes: every
// message is delivered once or dropped once, in order per publisher. The thread sanitizer watches.
TEST_F(Broker, LanesThatShareABitAreServedInTheOrderOfTheirPushes) {
  constexpr unsigned kTimes = 10;  // Most of them share the last bit.
  std::vector<PublisherCore*> publishers;
  for (unsigned i = 0; i < Inbox::kLaneBits * kTimes; ++i) {
    publishers.push_back(&publisher("c" + std::to_string(i), {.multiple_publishers = true}));
  }
  Receiver& to = receiver({.depth = 4});
  connect();
  std::atomic<std::int64_t> taken{0};
  std::atomic<bool> is_over{false};
  int swapped = 0;
  std::thread worker([&] {
    while (!is_over) {
      if (const auto value = to.take()) {
        swapped += *value == taken + 1 ? 0 : 1;
        ++taken;
      } else {
        std::this_thread::yield();
      }
    }
  });

  // Two at a time: the first of them goes where the worker may have looked, the second where it did
  // not yet. Looked at but once, three in two million were swapped.
  std::int64_t sent = 0;
  while (sent < 100'000) {
    PublisherCore& from = *publishers[static_cast<std::size_t>(sent) % kTimes * Inbox::kLaneBits];
    publish(from, ++sent);
    while (sent % 2 == 0 && sent - taken > 2) {
      std::this_thread::yield();
    }
  }
  while (taken < sent) {
    std::this_thread::yield();
  }
  is_over = true;
  worker.join();

  EXPECT_EQ(swapped, 0);
}

TEST_F(Broker, TwoPublishersOfOneComponentOnOneTopicAreDistinguished) {
  const TopicOptions options{.multiple_publishers = true};
  PublisherCore& first = publisher("planner", options);
  PublisherCore& second = publisher("planner", options);
  PublisherCore& other = publisher("mapper", options);
  Receiver& reader = receiver();
  connect();

  publish(first, 1);
  publish(second, 2);

  EXPECT_EQ(reader.take(), 1);
  EXPECT_EQ(reader.last_info.publisher, publisher_id("planner", "t"));
  EXPECT_EQ(reader.take(), 2);
  EXPECT_EQ(reader.last_info.publisher, publisher_id("planner", "t", 1));
  EXPECT_NE(first.id, second.id);
  EXPECT_EQ(other.id, publisher_id("mapper", "t"));
}

TEST_F(Broker, NothingIsLostOrDoubledUnderConcurrentPushes) {
  constexpr int kMessages = 20'000;
  for (const std::size_t depth : {1U, 8U}) {
    Topics topics;
    PublishingComponent owner_a{.name = "a", .clock = &clock_};
    owner_a.enter();
    PublishingComponent owner_b{.name = "b", .clock = &clock_};
    owner_b.enter();
    topics.set_options("t", {.multiple_publishers = true});
    const auto& type = Int64Value::default_instance();
    PublisherCore& a = topics.add_publisher("t", owner_a, type, nullptr, false);
    PublisherCore& b = topics.add_publisher("t", owner_b, type, nullptr, false);
    Receiver reader;
    Topic& topic = topics.get("t", "r", type);
    topic.subscriptions.push_back(
        std::make_unique<Subscription>(topic, reader.inbox, "r", Subscription::Kind::kCallback,
                                       SubscriberOptions{.depth = depth}));
    Subscription& subscription = *topic.subscriptions.back();
    topics.connect_all();
    std::atomic<int> running{2};
    const auto produce = [&](PublisherCore& publisher) {
      for (int i = 1; i <= kMessages; ++i) {
        publish(publisher, i);
      }
      --running;
    };
    std::thread thread_a(produce, std::ref(a));
    std::thread thread_b(produce, std::ref(b));

    std::map<PublisherId, std::uint64_t> last;
    bool is_ordered = true;
    const auto serve = [&] {
      if (!reader.queue.is_queued.exchange(false) || !reader.inbox.begin()) {
        return;
      }
      do {
        while (reader.take()) {
          std::uint64_t& newest = last[reader.last_info.publisher];
          is_ordered = is_ordered && reader.last_info.sequence > newest;
          newest = reader.last_info.sequence;
        }
      } while (!reader.inbox.try_end_idle());
    };
    while (running > 0) {
      serve();
      std::this_thread::yield();
    }
    thread_a.join();
    thread_b.join();
    serve();

    const Ledger ledger = subscription.ledger();
    EXPECT_TRUE(is_ordered);
    EXPECT_EQ(ledger.published, 2U * kMessages);
    EXPECT_EQ(ledger.queued, 0U);
    EXPECT_TRUE(ledger.adds_up());
    EXPECT_EQ(last[a.id], static_cast<std::uint64_t>(kMessages)) << "the newest is never dropped";
    EXPECT_EQ(last[b.id], static_cast<std::uint64_t>(kMessages));
  }
}

// A subscription ends and is made again, as Application does it, while its publisher pushes:
// connects and disconnects reach the publisher's thread between two messages.
TEST_F(Broker, ASubscriptionThatEndsWhileItsPublisherPushesLosesNothing) {
  constexpr int kSubscribed = 200;
  PublisherCore& speed = publisher("planner", {.latched = 1});
  Receiver& reader = receiver({.depth = 2});
  Subscription& subscription = *reader.subscription;
  std::mutex mutex;
  std::vector<std::function<void()>> causes;
  const auto post = [&](std::function<void()> cause) {
    const std::lock_guard lock(mutex);
    causes.push_back(std::move(cause));
  };
  const auto apply = [&] {
    std::vector<std::function<void()>> taken;
    {
      const std::lock_guard lock(mutex);
      taken.swap(causes);
    }
    for (const auto& cause : taken) {
      cause();
    }
  };
  std::atomic<bool> is_over{false};
  std::thread pushing([&] {
    for (std::int64_t i = 0; !is_over; ++i) {
      apply();
      publish(speed, i);
      std::this_thread::yield();
    }
    apply();
  });

  std::uint64_t taken = 0;
  for (int i = 0; i < kSubscribed; ++i) {
    const auto lane = Topics::make_lane(speed, subscription);
    reader.inbox.add(lane);
    post([&speed, lane, &reader] { speed.connect(lane, reader.inbox); });
    // Some end before they were connected, some with messages in their lane.
    while (i % 3 != 0 && lane->delivered.get() < 3) {
      taken += reader.take() ? 1U : 0U;
      std::this_thread::yield();
    }
    subscription.close(DropReason::kUnsubscribed);
    reader.inbox.remove(*lane);
    lane->is_left_by_receiver = true;
    post([&speed, lane] { speed.disconnect(*lane); });
  }
  is_over = true;
  pushing.join();

  const Ledger ledger = subscription.ledger();
  EXPECT_TRUE(ledger.adds_up());
  EXPECT_EQ(ledger.delivered, taken);
  EXPECT_EQ(ledger.queued, 0U);
  EXPECT_GT(ledger.dropped[static_cast<std::size_t>(DropReason::kUnsubscribed)], 0U);
}

// What a head says of its message is what the message says of itself, also where the publisher
// writes over the only slot while it is read, and until the very end of a lane.
TEST_F(Broker, AHeadHasWhatItsMessageHas) {
  const auto& type = Int64Value::default_instance();
  for (const Overflow overflow : {Overflow::kDropOldest, Overflow::kDropNewest}) {
    for (const std::size_t depth : {1U, 2U, 3U}) {
      Topics topics;
      PublishingComponent owner{.name = "a", .clock = &clock_};
      owner.enter();
      PublisherCore& from = topics.add_publisher("t", owner, type, nullptr, false);
      Receiver reader;
      Topic& topic = topics.get("t", "r", type);
      topic.subscriptions.push_back(
          std::make_unique<Subscription>(topic, reader.inbox, "r", Subscription::Kind::kCallback,
                                         SubscriberOptions{.depth = depth, .overflow = overflow}));
      Subscription& subscription = *topic.subscriptions.back();
      topics.connect_all();
      std::atomic<bool> is_over{false};
      std::thread pushing([&] {
        for (std::int64_t i = 1; !is_over; ++i) {
          publish(from, i);
          owner.publish_count = i % 5 == 0 ? 0 : 1;
          if (i % 8 == 0) {
            std::this_thread::yield();
          }
        }
      });

      int wrong = 0;
      std::uint64_t last = 0;
      for (int taken = 0; taken < 300;) {
        Inbox::Head head;
        if (!reader.inbox.peek(head) || !Inbox::pop(head)) {
          std::this_thread::yield();
          continue;
        }
        head.lane->delivered.add();
        const Envelope& envelope = *head.head.envelope;
        const bool is_right = head.head.sequence == envelope.info.sequence &&
                              head.head.sequence > last && head.head.payload == envelope.payload &&
                              head.head.time_ns == base::to_ns(envelope.info.publish_time) &&
                              static_cast<const Int64Value&>(*head.head.payload).value() ==
                                  static_cast<std::int64_t>(head.head.sequence);
        wrong += is_right ? 0 : 1;
        last = head.head.sequence;
        release(head.head.envelope);
        ++taken;
      }
      subscription.close(DropReason::kFault);
      is_over = true;
      pushing.join();

      EXPECT_EQ(wrong, 0) << depth;
      const Ledger ledger = subscription.ledger();
      EXPECT_TRUE(ledger.adds_up()) << depth;
      EXPECT_EQ(ledger.queued, 0U) << depth;
      EXPECT_EQ(ledger.published, from.published()) << depth;
    }
  }
}

// The sanitizers judge: a message forwarded twice comes back through every pool, on any thread,
// also when those who forwarded it, and its publisher, are gone.
TEST_F(Broker, WhatWasForwardedOutlivesAllWhoHandedItOn) {
  const auto& type = Int64Value::default_instance();
  for (int round = 0; round < 100; ++round) {
    auto topics = std::make_unique<Topics>();
    std::vector<std::unique_ptr<PublishingComponent>> owners;
    std::vector<PublisherCore*> chain;
    std::vector<std::unique_ptr<Receiver>> readers;
    for (const char* name : {"a", "b", "c"}) {
      owners.push_back(std::make_unique<PublishingComponent>());
      owners.back()->name = name;
      owners.back()->clock = &clock_;
      owners.back()->enter();
      chain.push_back(&topics->add_publisher(name, *owners.back(), type, nullptr, false));
      readers.push_back(std::make_unique<Receiver>());
      Topic& topic = topics->get(name, "r", type);
      topic.subscriptions.push_back(std::make_unique<Subscription>(
          topic, readers.back()->inbox, "r", Subscription::Kind::kCallback,
          SubscriberOptions{.depth = 2}));
    }
    topics->connect_all();
    std::vector<Envelope*> kept;
    for (int i = 0; i < 4; ++i) {
      publish(*chain[0], i);
      for (std::size_t stage = 0; stage < 3; ++stage) {
        Inbox::Head head;
        ASSERT_TRUE(readers[stage]->inbox.peek(head) && Inbox::pop(head));
        if (stage < 2) {
          chain[stage + 1]->forward(head.head.envelope, kNobody);
        }
        kept.push_back(head.head.envelope);
      }
    }
    std::atomic<int> ready{0};
    const auto let_go = [&](std::size_t first) {
      ++ready;
      while (ready < 3) {
        std::this_thread::yield();
      }
      for (std::size_t i = first; i < kept.size(); i += 2) {
        release(kept[i]);
      }
    };
    std::thread one(let_go, 0);
    std::thread two(let_go, 1);
    ++ready;
    topics.reset();
    one.join();
    two.join();
  }
}

}  // namespace
}  // namespace fastcycle::detail
