#include "machine/machine.h"

#include <algorithm>
#include <fstream>
#include <string>

#include <gtest/gtest.h>

#include "process/process.h"

namespace fastcycle::tool::machine {
namespace {

namespace fs = std::filesystem;

/// A machine that is made up: files under a folder of its own.
class Machine : public testing::Test {
 protected:
  Machine() {
    for (const char* const cpu : {"cpu0", "cpu1", "cpu2", "cpu3"}) {
      fs::create_directories(root_ / "sys/devices/system/cpu" / cpu);
    }
  }

  void write(const fs::path& file, const std::string& text) {
    fs::create_directories((root_ / file).parent_path());
    std::ofstream(root_ / file) << text << "\n";
  }

  Finding find(const std::string& name) {
    const std::vector<Finding> findings = look_at_kernel(root_);
    const auto found = std::ranges::find(findings, name, &Finding::name);
    EXPECT_NE(found, findings.end()) << name;
    return found == findings.end() ? Finding{} : *found;
  }

  test::Folder folder_;
  const fs::path& root_ = folder_.path();
};

TEST_F(Machine, ThatTellsNothingHasNothingToChangeButItsKernel) {
  for (const Finding& finding : look_at_kernel(root_)) {
    EXPECT_TRUE(finding.level == Level::kFine || finding.name == "kernel" ||
                finding.name == "isolated CPUs" || finding.name == "clock")
        << finding.name;
  }
}

TEST_F(Machine, WhatIsNotFineHasAReasonAndACommand) {
  write("proc/version", "Linux version 6.1.0 #1 SMP PREEMPT_DYNAMIC");
  write("proc/sys/kernel/sched_rt_runtime_us", "950000");
  write("proc/sys/kernel/sched_rt_period_us", "1000000");
  write("sys/devices/system/cpu/cpu0/cpufreq/scaling_governor", "powersave");
  write("sys/devices/system/cpu/cpu0/cpuidle/state3/latency", "133");
  write("sys/fs/cgroup/cpu.max", "150000 100000");
  write("sys/kernel/mm/transparent_hugepage/enabled", "[always] madvise never");
  write("proc/swaps", "Filename Type Size\n/dev/sda2 partition 100");
  write("proc/loadavg", "7.50 3.0 2.0 1/100 1");

  int count = 0;
  for (const Finding& finding : look_at_kernel(root_)) {
    EXPECT_EQ(finding.level == Level::kFine, finding.why.empty()) << finding.name;
    EXPECT_EQ(finding.level == Level::kFine, finding.remedy.empty()) << finding.name;
    count += finding.level == Level::kFine ? 0 : 1;
  }
  EXPECT_GE(count, 9);
}

TEST_F(Machine, WithARealTimeKernelIsFine) {
  write("proc/version", "Linux version 6.1.0-rt #1 SMP PREEMPT_RT");

  EXPECT_EQ(find("kernel").level, Level::kFine);
  EXPECT_EQ(find("kernel").found, "PREEMPT_RT");
}

TEST_F(Machine, NamesEveryGovernorOfItsCpus) {
  write("sys/devices/system/cpu/cpu0/cpufreq/scaling_governor", "performance");
  EXPECT_EQ(find("CPU frequency").level, Level::kFine);

  write("sys/devices/system/cpu/cpu3/cpufreq/scaling_governor", "schedutil");
  EXPECT_EQ(find("CPU frequency").level, Level::kProblem);
  EXPECT_EQ(find("CPU frequency").found, "performance, schedutil");
}

TEST_F(Machine, LooksAtSleepThatIsNotSwitchedOffOnly) {
  write("sys/devices/system/cpu/cpu1/cpuidle/state1/latency", "2");
  write("sys/devices/system/cpu/cpu1/cpuidle/state3/latency", "133");
  EXPECT_EQ(find("CPU sleep").found, "up to 133 µs to wake up");

  write("sys/devices/system/cpu/cpu1/cpuidle/state3/disable", "1");
  EXPECT_EQ(find("CPU sleep").found, "at most 2 µs to wake up");
}

TEST_F(Machine, FindsTheQuotaOfItsGroupOrOfOneAbove) {
  write("proc/self/cgroup", "0::/system/vehicle");
  EXPECT_EQ(find("CPU quota").found, "none");

  write("sys/fs/cgroup/system/vehicle/cpu.max", "max 100000");
  write("sys/fs/cgroup/system/cpu.max", "50000 100000");
  EXPECT_EQ(find("CPU quota").found, "50 of each 100 ms");
  EXPECT_EQ(find("CPU quota").level, Level::kProblem);
}

TEST_F(Machine, WithIsolatedCpusIsFine) {
  EXPECT_EQ(find("isolated CPUs").level, Level::kAdvice);

  write("sys/devices/system/cpu/isolated", "2-3");
  EXPECT_EQ(find("isolated CPUs").found, "2-3");
  EXPECT_EQ(find("isolated CPUs").level, Level::kFine);
}

TEST_F(Machine, IsNamed) {
  write("proc/cpuinfo", "processor\t: 0\nmodel name\t: Some CPU");
  write("proc/meminfo", "MemTotal:       16777216 kB");

  EXPECT_TRUE(name_of_machine(root_).starts_with("Some CPU, 4 CPUs, 16.0 GiB, Linux "))
      << name_of_machine(root_);
}

}  // namespace
}  // namespace fastcycle::tool::machine
