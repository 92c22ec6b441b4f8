#include "base/priority.h"

#include <algorithm>
#include <array>
#include <chrono>
#include <cstdint>
#include <thread>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/resource.h>
#include <sys/syscall.h>
#include <unistd.h>

namespace fastcycle::base {
namespace {

using ::testing::AnyOf;

/// Nanoseconds; 0 where the kernel does not know slices of single threads.
std::uint64_t slice_of_this_thread() {
  struct {
    std::uint32_t size, policy;
    std::uint64_t flags;
    std::int32_t nice;
    std::uint32_t priority;
    std::uint64_t runtime_ns, deadline_ns, period_ns;
  } attributes{};
  EXPECT_EQ(syscall(SYS_sched_getattr, 0, &attributes, sizeof(attributes), 0), 0);
  return attributes.runtime_ns;
}

TEST(TimeSlice, IsSetForTheCallingThreadWhereTheKernelHasSlices) {
  bool is_set = false;
  std::uint64_t slice_ns = 0;

  std::thread thread([&] {
    is_set = set_time_slice(std::chrono::microseconds(100));
    slice_ns = slice_of_this_thread();
  });
  thread.join();

  EXPECT_EQ(slice_ns, is_set ? 100'000U : 0U);
}

TEST(GiveWay, AsksForLongTimeSlices) {
  std::uint64_t slice_ns = 0;

  std::thread thread([&] {
    give_way();
    slice_ns = slice_of_this_thread();
  });
  thread.join();

  EXPECT_THAT(slice_ns, AnyOf(10'000'000U, 0U));
}

TEST(GiveWay, LowersThePriorityOfTheCallingThreadAndNeverRaisesIt) {
  const int before = getpriority(PRIO_PROCESS, 0);
  std::array<int, 2> nice{};

  std::thread thread([&] {
    give_way();
    nice[0] = getpriority(PRIO_PROCESS, 0);
    setpriority(PRIO_PROCESS, 0, std::max(before, 15));
    give_way();
    nice[1] = getpriority(PRIO_PROCESS, 0);
  });
  thread.join();

  EXPECT_EQ(nice[0], std::max(before, 10));
  EXPECT_EQ(nice[1], std::max(before, 15));
  EXPECT_EQ(getpriority(PRIO_PROCESS, 0), before);
}

}  // namespace
}  // namespace fastcycle::base
