#include "inspect/task_thread.h"

#include <atomic>
#include <future>
#include <vector>

#include <gtest/gtest.h>

namespace fastcycle::inspect {
namespace {

TEST(TaskThreadTest, ExecutesTasksInTheirOrder) {
  TaskThread thread("tasks");
  std::vector<int> executed;
  std::promise<void> done;
  for (int i = 0; i < 10; ++i) {
    EXPECT_TRUE(thread.post([&executed, i] { executed.push_back(i); }));
  }
  EXPECT_TRUE(thread.post([&done] { done.set_value(); }));
  done.get_future().wait();
  EXPECT_EQ(executed, (std::vector<int>{0, 1, 2, 3, 4, 5, 6, 7, 8, 9}));
}

TEST(TaskThreadTest, RefusesTasksWhileTooManyWaitAndDropsTheseAtTheEnd) {
  TaskThread thread("tasks");
  std::promise<void> begun;
  std::promise<void> goes_on;
  std::atomic<int> executed{0};
  EXPECT_TRUE(thread.post([&] {
    begun.set_value();
    goes_on.get_future().wait();
  }));
  begun.get_future().wait();
  for (std::size_t i = 0; i < TaskThread::kMostWaiting; ++i) {
    EXPECT_TRUE(thread.post([&executed] { ++executed; }));
  }
  EXPECT_FALSE(thread.post([&executed] { ++executed; }));

  const auto stopped = std::async(std::launch::async, [&thread] { thread.stop(); });
  while (thread.post([] {})) {  // Until it stops.
  }
  goes_on.set_value();
  stopped.wait();
  EXPECT_FALSE(thread.post([] {}));
}

}  // namespace
}  // namespace fastcycle::inspect
