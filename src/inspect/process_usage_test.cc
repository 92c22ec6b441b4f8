#include "inspect/process_usage.h"

#include <atomic>
#include <chrono>
#include <cstdio>
#include <thread>
#include <vector>

#include <gtest/gtest.h>
#include <pthread.h>
#include <unistd.h>

namespace fastcycle::inspect {
namespace {

TEST(ProcessUsage, SaysWhatTheKernelCounts) {
  const ProcessUsage usage = process_usage();

  EXPECT_GT(usage.cpu_ns, 0);
  EXPECT_GT(usage.resident_bytes, 100'000);
  EXPECT_GE(usage.virtual_bytes, usage.resident_bytes);
  const auto now = std::chrono::system_clock::now().time_since_epoch();
  EXPECT_LE(usage.start_ns, std::chrono::nanoseconds(now).count());
  EXPECT_GT(usage.start_ns, std::chrono::nanoseconds(now - std::chrono::hours(24)).count());
}

TEST(ProcessUsage, CountsDescriptors) {
  const ProcessUsage before = process_usage();
  const int descriptor = ::dup(0);
  ASSERT_GE(descriptor, 0);
  EXPECT_EQ(process_usage().open_files, before.open_files + 1);
  ::close(descriptor);
  EXPECT_EQ(process_usage().open_files, before.open_files);
}

TEST(ProcessUsage, AddsTheTimeOfThreadsOfOneName) {
  std::atomic<bool> ends{false};
  std::vector<std::thread> threads;
  for (int i = 0; i < 2; ++i) {
    threads.emplace_back([&] {
      while (!ends) {
      }
    });
    pthread_setname_np(threads.back().native_handle(), "busy");
  }
  ProcessUsage usage = process_usage();
  while (usage.threads["busy"].cpu_ns == 0) {
    usage = process_usage();
  }
  EXPECT_EQ(usage.threads["busy"].count, 2U);
  ends = true;
  for (std::thread& thread : threads) {
    thread.join();
  }
  EXPECT_EQ(process_usage().threads.count("busy"), 0U);
}

}  // namespace
}  // namespace fastcycle::inspect
