// Inboxes with more lanes than bits: what is found, in which order, and how many lanes are looked
// into for it.

#include "broker/inbox.h"

#include <algorithm>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <random>
#include <set>
#include <string>
#include <thread>
#include <vector>

#include <google/protobuf/wrappers.pb.h>
#include <gtest/gtest.h>

#include "broker/topics.h"

namespace fastcycle::detail {
namespace {

using google::protobuf::Int64Value;

class NotingQueue final : public ReadyQueue {
 public:
  void enqueue(std::uint32_t) noexcept override { is_queued = true; }
  void prepare(std::uint32_t) noexcept override {}
  void wake() noexcept override {}

  std::atomic<bool> is_queued{false};
};

/// One receiver of many topics, each with a publisher of its own.
class ManyLanes : public ::testing::Test {
 protected:
  ManyLanes() { inbox_.attach(queue_, 0); }

  struct Topic {
    PublishingComponent owner;
    PublisherCore* publisher = nullptr;
    Subscription* subscription = nullptr;
  };

  void subscribe(std::size_t count, std::size_t depth = 4) {
    for (std::size_t i = 0; i < count; ++i) {
      const std::string name = "t" + std::to_string(topics_.size());
      topics_.push_back(std::make_unique<Topic>());
      Topic& topic = *topics_.back();
      topic.owner.name = "p" + name;
      topic.owner.clock = &clock_;
      const auto& type = Int64Value::default_instance();
      topic.publisher = &registry_.add_publisher(name, topic.owner, type, nullptr, false);
      auto subscription = std::make_unique<Subscription>(topic.publisher->topic, inbox_, "receiver",
                                                         Subscription::Kind::kCallback,
                                                         SubscriberOptions{.depth = depth});
      topic.subscription = subscription.get();
      topic.publisher->topic.subscriptions.push_back(std::move(subscription));
      Topics::connect(*topic.publisher, *topic.subscription);
    }
  }

  void publish(std::size_t topic, std::int64_t value) {
    topics_[topic]->owner.enter();
    PublisherCore& publisher = *topics_[topic]->publisher;
    Envelope* loan = publisher.loan(true);
    static_cast<Int64Value&>(*loan->own).set_value(value);
    publisher.publish(loan, {});
  }

  std::optional<std::int64_t> take() {
    Inbox::Head head;
    while (inbox_.peek(head)) {
      if (Inbox::pop(head)) {
        head.lane->delivered.add();
        const auto value = static_cast<const Int64Value&>(*head.head.payload).value();
        release(head.head.envelope);
        return value;
      }
    }
    return std::nullopt;
  }

  std::vector<std::int64_t> take_all() {
    std::vector<std::int64_t> values;
    while (const auto value = take()) {
      values.push_back(*value);
    }
    return values;
  }

  std::shared_ptr<Lane> lane(std::size_t topic) {
    return topics_[topic]->subscription->lanes().back();
  }

  /// The subscription of `topic` ends, and its publisher is notified of it later.
  std::shared_ptr<Lane> end(std::size_t topic) {
    auto its_lane = lane(topic);
    topics_[topic]->subscription->close(DropReason::kUnsubscribed);
    inbox_.remove(*its_lane);
    its_lane->is_left_by_receiver = true;
    return its_lane;
  }

  base::Clock clock_ = base::Clock::live();
  NotingQueue queue_;
  Inbox inbox_;
  std::vector<std::unique_ptr<Topic>> topics_;
  Topics registry_;
};

TEST_F(ManyLanes, TheFirstHaveABitEachAndAreNeverSearched) {
  subscribe(Inbox::kOwnBits);
  for (std::size_t i = 0; i < topics_.size(); ++i) {
    publish(i, static_cast<std::int64_t>(i));
  }

  EXPECT_EQ(take_all().size(), topics_.size());
  EXPECT_EQ(inbox_.shared().looks(), 0U);
}

TEST_F(ManyLanes, OneMessageAmongThousandsOfLanesTakesAFewLooks) {
  constexpr int kMessages = 1000;
  subscribe(5000, 1);
  std::mt19937 random(1);

  for (std::int64_t i = 0; i < kMessages; ++i) {
    publish(random() % topics_.size(), i);
    ASSERT_EQ(take(), i);
    ASSERT_EQ(take(), std::nullopt);
    ASSERT_EQ(inbox_.state(), 0U);
  }

  // It is found, its time becomes known, it is taken, and the lane is found empty.
  EXPECT_LE(inbox_.shared().looks(), 3U * kMessages);
}

TEST_F(ManyLanes, ThousandsOfMessagesAreServedOldestFirstByAFewLooksEach) {
  constexpr std::size_t kTopics = 5000;
  constexpr std::size_t kEach = 3;
  subscribe(kTopics);
  std::vector<std::size_t> order;
  for (std::size_t i = 0; i < kTopics * kEach; ++i) {
    order.push_back(i % kTopics);
  }
  std::shuffle(order.begin(), order.end(), std::mt19937(2));
  for (std::size_t i = 0; i < order.size(); ++i) {
    publish(order[i], static_cast<std::int64_t>(i));
  }

  const auto taken = take_all();

  ASSERT_EQ(taken.size(), order.size());
  EXPECT_TRUE(std::ranges::is_sorted(taken));
  EXPECT_LE(inbox_.shared().looks(), 4U * order.size());
  EXPECT_EQ(inbox_.state(), 0U);
}

TEST_F(ManyLanes, WhatAFullLaneDropsDoesNotDisturbTheOrder) {
  subscribe(Inbox::kOwnBits + 3, 2);
  const std::size_t first = Inbox::kOwnBits;
  publish(first, 1);
  publish(first + 1, 2);
  EXPECT_EQ(take(), 1);  // From now on the inbox knows when 2 was published,
  publish(first + 2, 3);
  publish(first + 1, 4);
  publish(first + 1, 5);  // which is dropped here.

  EXPECT_EQ(take_all(), (std::vector<std::int64_t>{3, 4, 5}));
}

TEST_F(ManyLanes, ALaneThatEndsGivesItsPlaceAwayWhateverItHeld) {
  subscribe(Inbox::kOwnBits + 200);
  const std::size_t first = Inbox::kOwnBits;
  for (std::size_t i = 0; i < 200; ++i) {
    publish(first + i, static_cast<std::int64_t>(i));
  }
  EXPECT_EQ(take(), 0);  // All of them are in the heap.

  std::vector<std::shared_ptr<Lane>> ended;
  std::vector<unsigned> places;
  for (std::size_t i = 1; i < 200; i += 2) {
    places.push_back(lane(first + i)->place);
    ended.push_back(end(first + i));
  }
  for (std::size_t i = 1; i < 200; i += 2) {
    publish(first + i, -1);  // Their publishers do not know yet.
  }
  const std::size_t fresh = topics_.size();
  subscribe(100);
  std::vector<unsigned> places_again;
  for (std::size_t i = 0; i < 100; ++i) {
    places_again.push_back(lane(fresh + i)->place);
    publish(fresh + i, static_cast<std::int64_t>(1000 + i));
  }

  std::ranges::sort(places);
  std::ranges::sort(places_again);
  EXPECT_EQ(places, places_again);
  const auto taken = take_all();
  EXPECT_EQ(taken.size(), 99U + 100U);
  EXPECT_TRUE(std::ranges::is_sorted(taken));
  EXPECT_EQ(inbox_.state(), 0U);
}

TEST_F(ManyLanes, AllAreGivenOnceEachWhenAllAreMarked) {
  subscribe(Inbox::kOwnBits + 5);
  static_cast<void>(end(Inbox::kOwnBits + 3));

  inbox_.mark_all();
  std::set<const Lane*> given;
  inbox_.take_ready([&](Lane& lane) { EXPECT_TRUE(given.insert(&lane).second); });

  EXPECT_EQ(given.size(), topics_.size() - 1);
  EXPECT_EQ(inbox_.state(), 0U);
}

TEST_F(ManyLanes, ABitOfItsOwnIsFreeAgainWhenItsLaneEnds) {
  subscribe(Inbox::kOwnBits);
  const unsigned place = lane(7)->place;
  const auto ended = end(7);

  subscribe(1);
  EXPECT_EQ(lane(Inbox::kOwnBits)->place, place);
  EXPECT_EQ(lane(Inbox::kOwnBits)->shared_word, nullptr);
  inbox_.remove(*ended);  // A second time: that of its follower stays.
  publish(7, 1);
  publish(Inbox::kOwnBits, 2);

  EXPECT_EQ(take_all(), (std::vector<std::int64_t>{2}));
}

TEST_F(ManyLanes, TakingTheMarkedOnesGivesEachOnceAndLeavesNone) {
  subscribe(Inbox::kOwnBits + 100);
  const std::size_t first = Inbox::kOwnBits;
  publish(3, 1);
  publish(first, 2);
  publish(first + 99, 3);
  EXPECT_EQ(take(), 1);

  std::vector<const Lane*> marked;
  inbox_.take_ready([&](Lane& its_lane) { marked.push_back(&its_lane); });

  const std::vector<const Lane*> expected = {lane(3).get(), lane(first).get(),
                                             lane(first + 99).get()};
  EXPECT_EQ(marked, expected);
  EXPECT_EQ(inbox_.state(), 0U);
  EXPECT_EQ(take(), std::nullopt) << "none is marked";
  publish(first + 50, 4);
  EXPECT_EQ(take(), 4);
  inbox_.mark_all();
  EXPECT_EQ(take_all(), (std::vector<std::int64_t>{2, 3}));
}

// The thread sanitizer watches: publishers mark lanes while the worker lets go of others, and while
// lanes come and go.
TEST_F(ManyLanes, NothingIsLostWhilePublishersPushAndLanesComeAndGo) {
  constexpr std::size_t kThreads = 3;
  constexpr std::size_t kLanesEach = 40;
  constexpr std::int64_t kMessages = 6000;
  constexpr int kSubscribed = 100;
  subscribe(Inbox::kOwnBits + kThreads * kLanesEach + 1, 2);
  const std::size_t first = Inbox::kOwnBits;
  const std::size_t coming_and_going = topics_.size() - 1;
  std::mutex mutex;
  std::vector<std::function<void()>> causes;
  const auto post = [&](std::function<void()> cause) {
    const std::lock_guard lock(mutex);
    causes.push_back(std::move(cause));
  };
  std::atomic<bool> is_over{false};
  std::atomic<std::size_t> running{kThreads};
  std::vector<std::thread> threads;
  for (std::size_t thread = 0; thread < kThreads; ++thread) {
    threads.emplace_back([&, thread] {
      std::mt19937 random(static_cast<unsigned>(thread));
      for (std::int64_t i = 0; i < kMessages; ++i) {
        publish(first + thread * kLanesEach + random() % kLanesEach, i);
        if (i % 16 == 0) {
          std::this_thread::yield();
        }
      }
      --running;
    });
  }
  threads.emplace_back([&] {
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
    for (std::int64_t i = 0; !is_over; ++i) {
      apply();
      publish(coming_and_going, i);
      std::this_thread::yield();
    }
    apply();
  });

  std::uint64_t taken = 0;
  const auto serve = [&] {
    if (queue_.is_queued.exchange(false) && inbox_.begin()) {
      do {
        while (take()) {
          ++taken;
        }
      } while (!inbox_.try_end_idle());
    } else {
      std::this_thread::yield();
    }
  };
  PublisherCore& publisher = *topics_[coming_and_going]->publisher;
  Subscription& subscription = *topics_[coming_and_going]->subscription;
  for (int i = 0; i < kSubscribed; ++i) {
    const auto old = end(coming_and_going);
    post([&publisher, old] { publisher.disconnect(*old); });
    const auto fresh = Topics::make_lane(publisher, subscription);
    inbox_.add(fresh);
    post([&publisher, fresh, this] { publisher.connect(fresh, inbox_); });
    while (i % 3 != 0 && fresh->delivered.get() < 3) {
      serve();
    }
  }
  while (running > 0) {
    serve();
  }
  is_over = true;
  for (std::thread& thread : threads) {
    thread.join();
  }
  queue_.is_queued = true;
  serve();

  std::uint64_t delivered = 0;
  for (const auto& topic : topics_) {
    const Ledger ledger = topic->subscription->ledger();
    EXPECT_TRUE(ledger.adds_up());
    EXPECT_EQ(ledger.queued, 0U) << topic->owner.name;
    delivered += ledger.delivered;
  }
  EXPECT_EQ(delivered, taken);
  EXPECT_EQ(inbox_.state(), 0U);
}

}  // namespace
}  // namespace fastcycle::detail
