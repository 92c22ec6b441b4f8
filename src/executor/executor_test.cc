#include "executor/executor.h"

#include <atomic>
#include <functional>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include <google/protobuf/wrappers.pb.h>
#include <gtest/gtest.h>

#include "broker/topics.h"

namespace fastcycle::detail {
namespace {

using google::protobuf::Int64Value;
using namespace std::chrono_literals;

class TestActor final : public Actor {
 public:
  using Actor::Actor;

 private:
  void on_fault(std::string_view what) override { ADD_FAILURE() << name << ": " << what; }
};

/// One topic, from the test's own thread to some components of one executor.
class Executors : public ::testing::Test {
 protected:
  void SetUp() override {
    owner_.name = "publisher";
    owner_.clock = &clock_;
    owner_.enter();
  }

  void make(const ExecutorOptions& options, std::size_t count) {
    executor_ = std::make_unique<Executor>(options);
    for (std::uint32_t i = 0; i < count; ++i) {
      actors_.push_back(std::make_unique<TestActor>("c" + std::to_string(i), i, clock_));
      executor_->add(*actors_.back());
      actors_.back()->open();
    }
  }

  void subscribe(Actor& actor, const std::string& topic, std::function<void()> callback) {
    actor.subscribe(topics_.get(topic, actor.name, Int64Value::default_instance()), {},
                    [callback = std::move(callback)](Envelope&, const google::protobuf::Message&) {
                      callback();
                    });
  }

  PublisherCore& publisher(const std::string& topic, PublishingComponent& owner) {
    return topics_.add_publisher(topic, owner, Int64Value::default_instance(), nullptr, false);
  }

  void start() {
    topics_.connect_all();
    std::vector<base::Refusal> refusals;
    executor_->start(refusals);
  }

  static void publish(PublisherCore& publisher) {
    publisher.owner.enter();
    publisher.publish(publisher.loan(true), {});
  }

  /// Returns when the clock shows more than `time`.
  void pass(Time time) const {
    while (clock_.now() <= time) {
      std::this_thread::yield();
    }
  }

  /// Waits for what must happen, and gives up where a test would otherwise hang.
  template <typename Condition>
  static bool wait_for(const Condition& condition) {
    const std::int64_t end_ns = base::monotonic_ns() + 10'000'000'000;
    while (!condition()) {
      if (base::monotonic_ns() > end_ns) {
        return false;
      }
      std::this_thread::yield();
    }
    return true;
  }

  base::Clock clock_ = base::Clock::live();
  PublishingComponent owner_;
  std::vector<std::unique_ptr<TestActor>> actors_;
  Topics topics_;
  std::unique_ptr<Executor> executor_;
};

// A publish wakes one worker, which wakes the next for what it leaves, also where that stands in
// another word of the mask.
TEST_F(Executors, ABusyWorkerLeavesNoComponentWaitingWhileAnotherSleeps) {
  constexpr int kRounds = 50;
  make({.threads = 2, .cpus = {}}, 65);
  std::atomic<int> began{0};
  std::atomic<int> ended{0};
  std::atomic<bool> has_waited{false};
  int round = 1;
  // Each of the two ends once the other has begun: that takes both workers.
  const auto meet = [&] {
    ++began;
    has_waited = has_waited || !wait_for([&] { return began >= 2 * round; });
    ++ended;
  };
  subscribe(*actors_.front(), "t", meet);
  subscribe(*actors_.back(), "t", meet);
  PublisherCore& to_both = publisher("t", owner_);
  start();

  for (; round <= kRounds && !has_waited; ++round) {
    // Time to fall asleep: awake, both would look by themselves.
    std::this_thread::sleep_for(100us);
    publish(to_both);
    ASSERT_TRUE(wait_for([&] { return ended >= 2 * round; }));
  }
  executor_->stop();

  EXPECT_FALSE(has_waited);
}

// One component arms its timer, then another keeps the worker busy until that timer fired: the
// other worker must watch it, whoever led before.
TEST_F(Executors, ATimerIsWatchedWhileItsWorkerIsBusy) {
  constexpr int kRounds = 100;
  make({.threads = 2, .cpus = {}, .hand_over = true}, 3);
  Actor& arming = *actors_[0];
  std::atomic<int> ticks{0};
  std::atomic<int> rounds{0};
  std::atomic<bool> has_waited{false};
  TimerCore& timer = arming.add_timer({}, [&](const Tick&) { ++ticks; });
  PublisherCore& to_busy = publisher("busy", arming.publishing);
  subscribe(arming, "arm", [&] {
    arming.arm(timer, clock_.now() + 20us);
    publish(to_busy);
  });
  subscribe(*actors_[1], "busy", [&] {
    const int round = rounds + 1;
    has_waited = has_waited || !wait_for([&] { return ticks >= round; });
    ++rounds;
  });
  subscribe(*actors_[2], "other", [] {});
  PublisherCore& to_arming = publisher("arm", owner_);
  PublisherCore& to_other = publisher("other", owner_);
  start();

  for (int round = 1; round <= kRounds && !has_waited; ++round) {
    // Two workers wake and go to sleep at the same time, in any order.
    publish(to_other);
    publish(to_arming);
    ASSERT_TRUE(wait_for([&] { return rounds >= round; }));
  }
  executor_->stop();

  EXPECT_FALSE(has_waited);
}

// The thread sanitizer judges: an external publisher shares nothing with the callbacks of its
// component but its mutex.
TEST_F(Executors, AnExternalThreadLendsWhileItsComponentPublishes) {
  constexpr int kMessages = 2'000;
  make({.threads = 1, .cpus = {}}, 2);
  Actor& owner = *actors_[0];
  std::atomic<int> received{0};
  PublisherCore& inside = publisher("inside", owner.publishing);
  PublisherCore& outside = topics_.add_publisher("outside", owner.publishing,
                                                 Int64Value::default_instance(), nullptr, true);
  outside.set_external_open(true);
  subscribe(owner, "in", [&] { publish(inside); });
  subscribe(*actors_[1], "inside", [&] { ++received; });
  subscribe(*actors_[1], "outside", [] {});
  PublisherCore& to_owner = publisher("in", owner_);
  start();

  std::thread foreign([&] {
    for (int i = 0; i < kMessages; ++i) {
      publish_external(outside, take_external_loan(outside, true), clock_.now());
    }
  });
  for (int i = 0; i < kMessages; ++i) {
    publish(to_owner);
  }
  foreign.join();
  EXPECT_TRUE(wait_for([&] { return received > 0; }));
  executor_->stop();
}

// An actor which is busy with a fault as long as its test says.
class SlowlyFaulting final : public Actor {
 public:
  using Actor::Actor;
  std::function<void()> handling;

 private:
  void on_fault(std::string_view) override { handling(); }
};

// Handling a fault takes time, and a timer and a message may come meanwhile: the time of what is
// served next is that of its own beginning, and the older of both goes first.
TEST_F(Executors, WhatComesWhileAFaultIsHandledIsServedInOrderAndInItsTime) {
  executor_ = std::make_unique<Executor>(ExecutorOptions{.threads = 1, .cpus = {}});
  SlowlyFaulting actor("c", 0, clock_);
  executor_->add(actor);
  actor.open();
  std::string order;
  Time handled{};
  Time message_time{};
  std::atomic<int> served{0};
  PublisherCore& to_actor = publisher("m", owner_);
  TimerCore& timer = actor.add_timer({}, [&](const Tick&) {
    order += 't';
    ++served;
  });
  Time due;
  subscribe(actor, "fault", [&] {
    due = clock_.now() + 1ms;
    actor.arm(timer, due);
    throw std::runtime_error("on purpose");
  });
  subscribe(actor, "m", [&] {
    order += 'm';
    message_time = actor.publishing.now;
    ++served;
  });
  actor.handling = [&] {
    // The timer is due, then the message comes, then the fault is handled.
    pass(due);
    publish(to_actor);
    pass(clock_.now() + 1ms);
    handled = clock_.now();
  };
  PublishingComponent elsewhere;
  elsewhere.name = "elsewhere";
  elsewhere.clock = &clock_;
  elsewhere.enter();
  PublisherCore& to_fault = publisher("fault", elsewhere);
  start();

  publish(to_fault);
  ASSERT_TRUE(wait_for([&] { return served == 2; }));
  executor_->stop();

  EXPECT_EQ(order, "tm");
  EXPECT_GE(message_time, handled);
}

// A tick's key is its due time, a message's its publish time: the smaller one goes first, also when
// both came after the worker read its clock, and before it looked for what is next.
TEST_F(Executors, AMessageDoesNotOvertakeATickThatWasDueBeforeIt) {
  make({.threads = 1, .cpus = {}}, 1);
  Actor& actor = *actors_[0];
  std::string order;
  std::atomic<int> served{0};
  TimerCore& timer = actor.add_timer({}, [&](const Tick& tick) {
    EXPECT_GE(actor.publishing.now, tick.due);
    order += 't';
    ++served;
  });
  subscribe(actor, "m", [&] {
    order += 'm';
    ++served;
  });
  PublisherCore& to_actor = publisher("m", owner_);
  start();

  const Time due = clock_.now() + 1ms;
  actor.post_and_notify(
      Cause::kMode, [&] { actor.arm(timer, due); },
      [&] {
        // Between two activations, as if the worker had been preempted there.
        pass(due);
        publish(to_actor);
      });
  ASSERT_TRUE(wait_for([&] { return served == 2; }));
  executor_->stop();

  EXPECT_EQ(order, "tm");
}

// What a view shows when an activation starts is not from that activation's future.
TEST_F(Executors, AViewShowsNothingFromTheFuture) {
  make({.threads = 1, .cpus = {}}, 1);
  Actor& actor = *actors_[0];
  Topic& seen = topics_.get("seen", actor.name, Int64Value::default_instance());
  auto owned = std::make_unique<View>(seen, actor, Subscription::Kind::kLatest, 1, std::nullopt);
  View& view = *owned;
  seen.subscriptions.push_back(std::move(owned));
  actor.subscriptions.add(view);
  std::atomic<int> served{0};
  Duration age{-1};
  subscribe(actor, "m", [&] {
    age = actor.publishing.now - view.held.back()->info.publish_time;
    ++served;
  });
  PublisherCore& to_view = publisher("seen", owner_);
  PublishingComponent elsewhere;
  elsewhere.name = "elsewhere";
  elsewhere.clock = &clock_;
  elsewhere.enter();
  PublisherCore& to_actor = publisher("m", elsewhere);
  start();

  actor.post_and_notify(
      Cause::kMode, [] {},
      [&] {
        // Between two activations, as if the worker had been preempted there.
        publish(to_actor);
        pass(clock_.now());
        publish(to_view);
      });
  ASSERT_TRUE(wait_for([&] { return served == 1; }));
  executor_->stop();

  EXPECT_GE(age, Duration(0));
}

// Messages from another thread, timers that callbacks arm, jobs, and a stop in the midst of it:
// nothing is forgotten by a worker that waits, however it waits.
TEST_F(Executors, NothingIsForgottenByAWorkerThatWaits) {
  for (const WaitMode wait : {WaitMode::kPark, WaitMode::kAdaptive, WaitMode::kSpin}) {
    for (const unsigned threads : {1U, 2U, 3U}) {
      for (const bool hand_over : {false, true}) {
        Executor executor({.threads = threads, .cpus = {}, .wait = wait, .hand_over = hand_over});
        TestActor first("first", 0, clock_);
        TestActor second("second", 1, clock_);
        executor.add(first);
        executor.add(second);
        first.open();
        second.open();
        Topics topics;
        const auto& type = Int64Value::default_instance();
        PublisherCore& to_first = topics.add_publisher("in", owner_, type, nullptr, false);
        PublisherCore& to_second =
            topics.add_publisher("mid", first.publishing, type, nullptr, false);
        std::atomic<int> ticks{0};
        std::atomic<int> jobs{0};
        std::atomic<int> done{0};
        TimerCore& timer = second.add_timer({}, [&](const Tick& tick) {
          EXPECT_EQ(tick.skipped, 0U);
          EXPECT_GE(second.publishing.now, tick.due);
          ++ticks;
        });
        first.subscribe(topics.get("in", "first", type), {},
                        [&](Envelope&, const google::protobuf::Message&) {
                          publish(to_second);
                          EXPECT_TRUE(executor.submit([&] {
                            ++jobs;
                            second.post(Cause::kJob, [&] { ++done; });
                          }));
                        });
        second.subscribe(topics.get("mid", "second", type), {},
                         [&](Envelope&, const google::protobuf::Message&) {
                           second.arm(timer, clock_.now() + 30us);
                         });
        topics.connect_all();
        std::vector<base::Refusal> refusals;
        executor.start(refusals);
        for (int round = 1; round <= 10; ++round) {
          publish(to_first);
          ASSERT_TRUE(wait_for([&] { return ticks >= round && done >= round && jobs >= round; }))
              << static_cast<int>(wait) << ' ' << threads << ' ' << hand_over << " round " << round
              << ": " << ticks << ' ' << jobs << ' ' << done;
          if (round % 4 == 0) {
            std::this_thread::sleep_for(60us);
          }
        }
        publish(to_first);
        executor.stop();
      }
    }
  }
}

// A worker that waits by looking serves what was pushed but not marked yet. A control cause that
// was posted before goes first all the same.
TEST_F(Executors, WhatWasPostedBeforeAPublishIsServedBeforeItHoweverTheWorkerWaits) {
  constexpr int kRounds = 3000;
  for (const WaitMode wait : {WaitMode::kPark, WaitMode::kAdaptive, WaitMode::kSpin}) {
    Executor executor({.threads = 1, .cpus = {}, .wait = wait});
    TestActor actor("actor", 0, clock_);
    executor.add(actor);
    actor.open();
    Topics topics;
    const auto& type = Int64Value::default_instance();
    PublisherCore& to_actor = topics.add_publisher("t", owner_, type, nullptr, false);
    int posted = 0;
    std::atomic<int> served{0};
    std::atomic<int> overtaken{0};
    actor.subscribe(topics.get("t", "actor", type), {},
                    [&](Envelope&, const google::protobuf::Message&) {
                      overtaken += posted == served + 1 ? 0 : 1;
                      ++served;
                    });
    topics.connect_all();
    std::vector<base::Refusal> refusals;
    executor.start(refusals);
    for (int round = 1; round <= kRounds; ++round) {
      actor.post(Cause::kMode, [&posted, round] { posted = round; });
      publish(to_actor);
      ASSERT_TRUE(wait_for([&] { return served == round; })) << static_cast<int>(wait);
    }
    executor.stop();
    EXPECT_EQ(overtaken, 0) << static_cast<int>(wait);
  }
}

// Two lanes, one publisher thread each, of which the second waits for the first: also a worker that
// looks at the lanes one after the other must not find the second message first.
TEST_F(Executors, WhatWasPublishedBeforeIsServedBeforeHoweverTheWorkerWaits) {
  constexpr std::int64_t kRounds = 20'000;
  for (const WaitMode wait : {WaitMode::kPark, WaitMode::kAdaptive, WaitMode::kSpin}) {
    Executor executor({.threads = 1, .cpus = {}, .wait = wait});
    TestActor actor("actor", 0, clock_);
    executor.add(actor);
    actor.open();
    PublishingComponent other;
    other.name = "other";
    other.clock = &clock_;
    other.enter();
    Topics topics;
    const auto& type = Int64Value::default_instance();
    // The lane that is looked at first gets its message first.
    PublisherCore& first = topics.add_publisher("first", owner_, type, nullptr, false);
    PublisherCore& second = topics.add_publisher("second", other, type, nullptr, false);
    std::int64_t seen_first = 0;
    std::int64_t seen_second = 0;
    std::atomic<std::int64_t> served{0};
    std::atomic<int> overtaken{0};
    actor.subscribe(topics.get("first", "actor", type), {},
                    [&](Envelope&, const google::protobuf::Message&) {
                      ++seen_first;
                      ++served;
                    });
    actor.subscribe(topics.get("second", "actor", type), {},
                    [&](Envelope&, const google::protobuf::Message&) {
                      overtaken += seen_first > seen_second ? 0 : 1;
                      ++seen_second;
                      ++served;
                    });
    topics.connect_all();
    std::vector<base::Refusal> refusals;
    executor.start(refusals);
    std::atomic<std::int64_t> begun{0};
    std::thread follower([&] {
      for (std::int64_t round = 1; round <= kRounds; ++round) {
        if (!wait_for([&] { return begun >= round; })) {
          return;
        }
        publish(second);
      }
    });
    for (std::int64_t round = 1; round <= kRounds; ++round) {
      publish(first);
      begun = round;
      // Few enough on their way that no queue is full.
      ASSERT_TRUE(wait_for([&] { return served + 8 > 2 * round; })) << static_cast<int>(wait);
    }
    follower.join();
    EXPECT_TRUE(wait_for([&] { return served == 2 * kRounds; })) << served;
    executor.stop();
    EXPECT_EQ(overtaken, 0) << static_cast<int>(wait);
  }
}

}  // namespace
}  // namespace fastcycle::detail
