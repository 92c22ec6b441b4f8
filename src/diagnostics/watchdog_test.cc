#include "diagnostics/watchdog.h"

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/clock.h"
#include "executor/activation.h"
#include "executor/actor.h"

namespace fastcycle::diagnostics {
namespace {

using namespace std::chrono_literals;
using testing::HasSubstr;

class Part final : public detail::Actor {
 public:
  explicit Part(const base::Clock& its_clock) : Actor("planner", 0, its_clock) {}

 protected:
  void on_fault(std::string_view) override {}
};

/// A flag that threads wait for.
class Flag {
 public:
  void set() {
    const std::lock_guard lock(mutex_);
    is_set_ = true;
    changed_.notify_all();
  }
  [[nodiscard]] bool wait() {
    std::unique_lock lock(mutex_);
    return changed_.wait_for(lock, 60s, [this] { return is_set_; });
  }

 private:
  std::mutex mutex_;
  std::condition_variable changed_;
  bool is_set_ = false;
};

class WhoRuns : public testing::Test {
 protected:
  base::Clock clock_ = base::Clock::simulated();
  Part part_{clock_};
  Flag is_in_call_;
  Flag may_return_;

  /// A thread that is in `call` until it may return.
  std::jthread in(const char* call, bool has_limit = true) {
    return std::jthread([this, call, has_limit] {
      const detail::ServingThread serving;
      const detail::CallScope scope(part_, call, nullptr, has_limit);
      is_in_call_.set();
      EXPECT_TRUE(may_return_.wait());
    });
  }
};

TEST_F(WhoRuns, ACallIsNamedWithTheStackOfItsThread) {
  const std::jthread thread = in("its start()");
  ASSERT_TRUE(is_in_call_.wait());

  const std::vector<RunningCall> calls = who_runs_now();
  may_return_.set();

  ASSERT_EQ(calls.size(), 1U);
  EXPECT_EQ(calls[0].actor, &part_);
  EXPECT_EQ(calls[0].call, "its start()");
  EXPECT_TRUE(calls[0].is_lifecycle);
  EXPECT_GT(calls[0].time.count(), 0);
  EXPECT_FALSE(calls[0].stack.empty());
  EXPECT_THAT(calls[0].in_words(), HasSubstr("its start() has not returned for "));
}

TEST_F(WhoRuns, WhatHasNoLimitIsNoCallThatIsLookedAt) {
  const std::jthread thread = in("its thread", false);
  ASSERT_TRUE(is_in_call_.wait());
  EXPECT_TRUE(who_runs_now().empty());
  may_return_.set();
}

TEST_F(WhoRuns, AnInnerCallIsNamedAndThenTheOuterOneAgain) {
  const detail::ServingThread serving;
  const auto named = [] { return std::string(detail::running_activation.call.load()); };
  EXPECT_EQ(detail::current_activation(), nullptr);
  {
    const detail::CallScope outer(part_, "its start()");
    {
      const detail::CallScope inner(part_, "its constructor");
      EXPECT_EQ(named(), "its constructor");
    }
    EXPECT_EQ(named(), "its start()");
  }
  EXPECT_EQ(detail::current_activation(), nullptr);
}

TEST_F(WhoRuns, TheWatchdogTellsOnceAndWhenTheCallReturns) {
  std::atomic<int> hangs{0};
  Flag is_reported;
  Flag has_returned;
  std::string reported;
  Watchdog::Options options;
  options.smallest_limit = 20ms;
  options.limit_of = [](const RunningCall&) { return std::optional(20'000'000ns); };
  options.on_hang = [&](const RunningCall& call) {
    reported = call.in_words();
    ++hangs;
    is_reported.set();
  };
  Flag has_looked;
  options.on_look = [&](const RunningCall&) { has_looked.set(); };
  options.on_return = [&](const RunningCall&) { has_returned.set(); };
  const Watchdog watchdog(std::move(options));

  {
    const std::jthread thread = in("its start()");
    ASSERT_TRUE(is_reported.wait());
    EXPECT_TRUE(has_looked.wait());
    may_return_.set();
  }
  EXPECT_TRUE(has_returned.wait());
  EXPECT_EQ(hangs, 1);
  EXPECT_THAT(reported, HasSubstr("its start()"));
}

TEST_F(WhoRuns, TheWatchdogMentionsOnceWhatTakesLongButIsAllowedTo) {
  std::atomic<int> mentioned{0};
  Flag has_mentioned;
  std::string reported;
  std::atomic<int> asked{0};
  Flag was_asked_again;
  Watchdog::Options options;
  options.smallest_limit = 1h;
  options.limit_of = [&](const RunningCall&) {
    if (++asked > 5) {
      was_asked_again.set();
    }
    return std::optional<std::chrono::nanoseconds>(1h);
  };
  options.notice = 20ms;
  options.on_slow = [&](const RunningCall& call) {
    reported = call.in_words();
    ++mentioned;
    has_mentioned.set();
  };
  options.on_hang = [](const RunningCall&) { ADD_FAILURE() << "it may take an hour"; };
  options.on_return = options.on_hang;
  const Watchdog watchdog(std::move(options));

  {
    const std::jthread thread = in("its constructor");
    ASSERT_TRUE(has_mentioned.wait());
    EXPECT_TRUE(was_asked_again.wait());
    may_return_.set();
  }
  EXPECT_EQ(mentioned, 1);
  EXPECT_THAT(reported, HasSubstr("its constructor has not returned for "));
}

TEST_F(WhoRuns, AThreadThatBlocksAllSignalsIsNamedWithoutItsStack) {
  const std::jthread thread([this] {
    sigset_t all;
    sigfillset(&all);
    pthread_sigmask(SIG_BLOCK, &all, nullptr);
    const detail::ServingThread serving;
    const detail::CallScope scope(part_, "its stop()");
    is_in_call_.set();
    EXPECT_TRUE(may_return_.wait());
  });
  ASSERT_TRUE(is_in_call_.wait());

  const std::vector<RunningCall> calls = who_runs_now();
  may_return_.set();

  ASSERT_EQ(calls.size(), 1U);
  EXPECT_EQ(calls[0].call, "its stop()");
  EXPECT_TRUE(calls[0].stack.empty());
  EXPECT_THAT(calls[0].place(), HasSubstr("blocks all signals"));
}

}  // namespace
}  // namespace fastcycle::diagnostics
