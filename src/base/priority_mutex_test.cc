#include "base/priority_mutex.h"

#include <mutex>
#include <thread>
#include <vector>

#include <gtest/gtest.h>

namespace fastcycle::base {
namespace {

TEST(APriorityMutex, LetsOneThreadInAtATime) {
  PriorityMutex mutex;
  int count = 0;
  std::vector<std::jthread> threads;
  for (int i = 0; i < 4; ++i) {
    threads.emplace_back([&] {
      for (int j = 0; j < 1000; ++j) {
        const std::lock_guard lock(mutex);
        ++count;
      }
    });
  }
  threads.clear();
  EXPECT_EQ(count, 4000);
}

}  // namespace
}  // namespace fastcycle::base
