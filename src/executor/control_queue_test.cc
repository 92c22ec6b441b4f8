#include "executor/control_queue.h"

#include <thread>
#include <vector>

#include <gtest/gtest.h>

namespace fastcycle::detail {
namespace {

TEST(ControlQueue, GivesWhatOthersPostedInTheOrderOfTheirPosts) {
  ControlQueue queue;
  EXPECT_FALSE(queue.has_posted());
  for (std::int64_t i = 0; i < 3; ++i) {
    queue.post({.cause = Cause::kMode, .body = [] {}, .posted_ns = i});
  }
  Control control;
  for (std::int64_t i = 0; i < 3; ++i) {
    ASSERT_TRUE(queue.has_posted());
    ASSERT_TRUE(queue.take_posted(control));
    EXPECT_EQ(control.posted_ns, i);
  }
  EXPECT_FALSE(queue.has_posted());
  EXPECT_FALSE(queue.take_posted(control));
}

TEST(ControlQueue, TakesNoMoreOfItsOwnThanItSays) {
  ControlQueue queue;
  for (std::size_t i = 0; i < ControlQueue::kMaxOwn; ++i) {
    ASSERT_TRUE(queue.post_own({.cause = Cause::kReply, .body = [] {}}));
  }
  EXPECT_FALSE(queue.post_own({.cause = Cause::kReply, .body = [] {}}));
  static_cast<void>(queue.take_own());
  EXPECT_TRUE(queue.post_own({.cause = Cause::kReply, .body = [] {}}));
}

TEST(ControlQueue, LosesNothingThatThreadsPost) {
  constexpr int kEach = 2000;
  ControlQueue queue;
  int served = 0;
  std::vector<std::thread> threads;
  for (int i = 0; i < 3; ++i) {
    threads.emplace_back([&] {
      for (int k = 0; k < kEach; ++k) {
        queue.post({.cause = Cause::kJob, .body = [&served] { ++served; }});
      }
    });
  }
  Control control;
  while (served < 3 * kEach) {
    if (queue.take_posted(control)) {
      control.body();
    } else {
      std::this_thread::yield();
    }
  }
  for (std::thread& thread : threads) {
    thread.join();
  }
  EXPECT_FALSE(queue.has_posted());
}

}  // namespace
}  // namespace fastcycle::detail
