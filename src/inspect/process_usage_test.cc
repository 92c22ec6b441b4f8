#include "inspect/process_usage.h"

#include <atomic>
#include <chrono>
#include <cstdio>
#include <thread>
#include <vector>

#include <gtest/gtest.h>
#include <pthread.h>
#include <sys/wait.h>
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

TEST(ProcessUsage, IsKnownOfAnotherProcessAsLongAsItLives) {
  int hold[2];
  ASSERT_EQ(::pipe(hold), 0);
  const pid_t child = ::fork();
  if (child == 0) {
    char byte{};
    ::close(hold[1]);
    ::_exit(static_cast<int>(::read(hold[0], &byte, 1)));
  }
  const auto usage = process_usage(child);
  ::close(hold[1]);
  ::waitpid(child, nullptr, 0);
  ::close(hold[0]);

  ASSERT_TRUE(usage);
  EXPECT_EQ(usage->parent, ::getpid());
  EXPECT_GT(usage->resident_bytes, 0);
  EXPECT_GT(usage->open_files, 0U);
  EXPECT_GT(usage->start_ns, 0);
  EXPECT_EQ(usage->threads.size(), 1U);
  EXPECT_FALSE(process_usage(child)) << "it has ended";
  EXPECT_FALSE(process_usage(0));
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
