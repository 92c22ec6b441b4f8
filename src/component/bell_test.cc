#include "component/bell.h"

#include <atomic>
#include <thread>

#include <gtest/gtest.h>

namespace fastcycle::host {
namespace {

using namespace std::chrono_literals;

TEST(ABell, WakesWhoWaitsEachTimeThatItIsRung) {
  Bell bell;
  std::atomic<int> count{0};
  const std::jthread other([&] {
    for (int i = 0; i < 10'000; ++i) {
      ++count;
      bell.ring();
    }
  });
  EXPECT_TRUE(bell.wait(base::kNever, [&] { return count >= 5000; }));
  EXPECT_TRUE(bell.wait(base::kNever, [&] { return count == 10'000; }));
}

TEST(ABell, LetsNobodyWaitBeyondADeadline) {
  Bell bell;
  EXPECT_FALSE(bell.wait(deadline_in(1ms), [] { return false; }));
  bell.ring();  // Nobody waits: nothing is left of it.
  EXPECT_FALSE(bell.wait(deadline_in(1h, base::monotonic_ns()), [] { return false; }));
  EXPECT_TRUE(bell.wait(base::monotonic_ns(), [] { return true; }));
}

}  // namespace
}  // namespace fastcycle::host
