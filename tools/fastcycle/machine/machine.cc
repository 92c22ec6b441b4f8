#include "machine/machine.h"

#include <algorithm>
#include <charconv>
#include <fstream>
#include <optional>
#include <set>
#include <sstream>
#include <string_view>
#include <system_error>
#include <utility>

#include <fmt/format.h>
#include <sched.h>
#include <sys/mman.h>
#include <sys/resource.h>
#include <sys/utsname.h>
#include <time.h>
#include <unistd.h>

#include "base/thread.h"

namespace fastcycle::tool::machine {
namespace {

namespace fs = std::filesystem;

/// The first line of a file; none if it cannot be read.
std::optional<std::string> line_of(const fs::path& file) {
  std::ifstream input(file);
  std::string line;
  if (!std::getline(input, line)) {
    return std::nullopt;
  }
  return line;
}

std::optional<double> number_of(const std::optional<std::string>& text) {
  double number = 0.0;
  if (!text) {
    return std::nullopt;
  }
  const auto [end, error] = std::from_chars(text->data(), text->data() + text->size(), number);
  static_cast<void>(end);
  return error == std::errc() ? std::optional(number) : std::nullopt;
}

/// The value of the line `key : value` of /proc/cpuinfo or /proc/meminfo.
std::string value_of(const fs::path& file, std::string_view key) {
  std::ifstream input(file);
  for (std::string line; std::getline(input, line);) {
    const std::size_t colon = line.find(':');
    if (colon != std::string::npos && line.starts_with(key)) {
      const std::size_t start = line.find_first_not_of(" \t", colon + 1);
      return start == std::string::npos ? "" : line.substr(start);
    }
  }
  return {};
}

/// The folders cpu0, cpu1, … of the CPUs.
std::vector<fs::path> cpu_folders(const fs::path& root) {
  std::vector<fs::path> folders;
  std::error_code none;
  for (const auto& entry : fs::directory_iterator(root / "sys/devices/system/cpu", none)) {
    const std::string name = entry.path().filename().string();
    if (name.size() > 3 && name.starts_with("cpu") &&
        std::all_of(name.begin() + 3, name.end(), [](char c) { return c >= '0' && c <= '9'; })) {
      folders.push_back(entry.path());
    }
  }
  std::sort(folders.begin(), folders.end());
  return folders;
}

Finding look_at_preemption(const fs::path& root) {
  const std::string version = line_of(root / "proc/version").value_or("unknown");
  const bool is_rt = line_of(root / "sys/kernel/realtime") == "1";
  for (const char* const word : {"PREEMPT_RT", "PREEMPT_DYNAMIC", "PREEMPT"}) {
    if (version.find(word) != std::string::npos || (is_rt && word == std::string("PREEMPT_RT"))) {
      if (word == std::string("PREEMPT_RT")) {
        return {.name = "kernel", .found = word};
      }
      return {
          .name = "kernel",
          .level = Level::kAdvice,
          .found = word,
          .why = "drivers and interrupts occasionally delay even FIFO threads",
          .remedy = "sudo apt install linux-image-rt-" +
                    std::string(version.find("aarch64") != std::string::npos ? "arm64" : "amd64")};
    }
  }
  return {.name = "kernel",
          .level = Level::kAdvice,
          .found = "without preemption",
          .why = "a system call of another process delays a thread until it ends",
          .remedy = "sudo apt install linux-image-rt-amd64"};
}

Finding look_at_throttling(const fs::path& root) {
  const auto runtime = number_of(line_of(root / "proc/sys/kernel/sched_rt_runtime_us"));
  const auto period = number_of(line_of(root / "proc/sys/kernel/sched_rt_period_us"));
  if (!runtime || !period || *runtime < 0 || *runtime >= *period) {
    return {.name = "FIFO throttling", .found = "none"};
  }
  return {
      .name = "FIFO throttling",
      .level = Level::kAdvice,
      .found = fmt::format("{:.0f} of {:.0f} ms", *runtime / 1e3, *period / 1e3),
      .why =
          "FIFO threads that never sleep, as with \"wait\": \"spin\", are suspended for the rest",
      .remedy = "sudo sysctl -w kernel.sched_rt_runtime_us=-1"};
}

Finding look_at_governor(const fs::path& root) {
  std::set<std::string> governors;
  for (const fs::path& cpu : cpu_folders(root)) {
    if (auto governor = line_of(cpu / "cpufreq/scaling_governor")) {
      governors.insert(std::move(*governor));
    }
  }
  if (governors.empty()) {
    return {.name = "CPU frequency", .found = "not controlled by the kernel"};
  }
  if (governors == std::set<std::string>{"performance"}) {
    return {.name = "CPU frequency", .found = "performance"};
  }
  std::string found;
  for (const std::string& governor : governors) {
    found += (found.empty() ? "" : ", ") + governor;
  }
  return {.name = "CPU frequency",
          .level = Level::kProblem,
          .found = found,
          .why = "an idle CPU starts at a low frequency, so callbacks take several times as long",
          .remedy =
              "echo performance | sudo tee "
              "/sys/devices/system/cpu/cpu*/cpufreq/scaling_governor"};
}

Finding look_at_idle_states(const fs::path& root) {
  double deepest_us = 0.0;
  std::error_code none;
  for (const fs::path& cpu : cpu_folders(root)) {
    for (const auto& state : fs::directory_iterator(cpu / "cpuidle", none)) {
      if (line_of(state.path() / "disable") != "1") {
        deepest_us = std::max(deepest_us, number_of(line_of(state.path() / "latency")).value_or(0));
      }
    }
  }
  constexpr double kMuch_us = 20.0;
  if (deepest_us <= kMuch_us) {
    return {.name = "CPU sleep",
            .found = deepest_us > 0 ? fmt::format("at most {:.0f} µs to wake up", deepest_us)
                                    : "not controlled by the kernel"};
  }
  return {.name = "CPU sleep",
          .level = Level::kAdvice,
          .found = fmt::format("up to {:.0f} µs to wake up", deepest_us),
          .why = "is added to the latency of each wake-up of an idle CPU",
          .remedy = fmt::format("sudo apt install linux-cpupower; sudo cpupower idle-set -D {:.0f}",
                                kMuch_us)};
}

Finding look_at_isolation(const fs::path& root) {
  const std::string isolated = line_of(root / "sys/devices/system/cpu/isolated").value_or("");
  const std::size_t cpus = cpu_folders(root).size();
  if (!isolated.empty()) {
    return {.name = "isolated CPUs", .found = isolated};
  }
  if (cpus < 4) {
    return {.name = "isolated CPUs", .found = "none, and too few CPUs for it"};
  }
  const std::string last = std::to_string(cpus - 1);
  return {.name = "isolated CPUs",
          .level = Level::kAdvice,
          .found = "none",
          .why = "the kernel runs other threads on the CPUs of an executor",
          .remedy = "add `isolcpus=" + last + " nohz_full=" + last + " rcu_nocbs=" + last +
                    "` to GRUB_CMDLINE_LINUX in /etc/default/grub; sudo update-grub; reboot; then "
                    "\"cpus\": [" +
                    last + "] of an executor"};
}

Finding look_at_quota(const fs::path& root) {
  // Of the group of this process, or of the container's own root.
  std::string group = "/";
  std::ifstream groups(root / "proc/self/cgroup");
  for (std::string line; std::getline(groups, line);) {
    if (line.starts_with("0::")) {
      group = line.substr(3);
    }
  }
  const fs::path base = root / "sys/fs/cgroup";
  for (fs::path folder = base / fs::path(group).relative_path();; folder = folder.parent_path()) {
    const std::string quota = line_of(folder / "cpu.max").value_or("max");
    double used_us = 0.0;
    double period_us = 0.0;
    if (std::istringstream(quota) >> used_us >> period_us) {
      return {.name = "CPU quota",
              .level = Level::kProblem,
              .found = fmt::format("{:.0f} of each {:.0f} ms", used_us / 1e3, period_us / 1e3),
              .why = "when it is used up, all threads are suspended until the period ends",
              .remedy =
                  "start the container without a CPU time limit (--cpus), or with dedicated CPUs "
                  "(--cpuset-cpus)"};
    }
    if (folder == base || folder.string().size() <= base.string().size()) {
      break;
    }
  }
  return {.name = "CPU quota", .found = "none"};
}

/// Nanoseconds that asking for the time takes, at best of some tries.
double clock_cost_ns() {
  constexpr int kCalls = 1000;
  double best = 1e9;
  for (int round = 0; round < 20; ++round) {
    timespec first{};
    timespec last{};
    clock_gettime(CLOCK_MONOTONIC, &first);
    for (int i = 0; i < kCalls; ++i) {
      clock_gettime(CLOCK_MONOTONIC, &last);
    }
    best = std::min(best, (static_cast<double>(last.tv_sec - first.tv_sec) * 1e9 +
                           static_cast<double>(last.tv_nsec - first.tv_nsec)) /
                              kCalls);
  }
  return best;
}

Finding look_at_clock(const fs::path& root) {
  const fs::path folder = root / "sys/devices/system/clocksource/clocksource0";
  const std::string source = line_of(folder / "current_clocksource").value_or("unknown");
  const double cost_ns = clock_cost_ns();
  const std::string found = fmt::format("{}, {:.0f} ns a call", source, cost_ns);
  constexpr double kSlow_ns = 200.0;
  if (cost_ns < kSlow_ns) {
    return {.name = "clock", .found = found};
  }
  const std::string others = line_of(folder / "available_clocksource").value_or("");
  const bool has_tsc = others.find("tsc") != std::string::npos;
  return {.name = "clock",
          .level = Level::kProblem,
          .found = found,
          .why = "each message reads the clock several times, and each read is a system call",
          .remedy = has_tsc ? "echo tsc | sudo tee " + (folder / "current_clocksource").string()
                            : "boot with `clocksource=tsc tsc=reliable`, if the TSC is reliable "
                              "(flag constant_tsc in /proc/cpuinfo)"};
}

Finding look_at_huge_pages(const fs::path& root) {
  const fs::path file = root / "sys/kernel/mm/transparent_hugepage/enabled";
  const std::string modes = line_of(file).value_or("");
  const std::size_t start = modes.find('[');
  const std::string mode =
      start == std::string::npos ? "none" : modes.substr(start + 1, modes.find(']') - start - 1);
  if (mode != "always") {
    return {.name = "huge pages", .found = mode};
  }
  return {.name = "huge pages",
          .level = Level::kAdvice,
          .found = mode,
          .why = "the kernel compacts memory while an application uses it",
          .remedy = "echo madvise | sudo tee " + file.string()};
}

Finding look_at_swap(const fs::path& root) {
  std::ifstream file(root / "proc/swaps");
  std::string line;
  std::getline(file, line);  // The heading.
  if (!std::getline(file, line) || line.empty()) {
    return {.name = "swap", .found = "none"};
  }
  return {.name = "swap",
          .level = Level::kAdvice,
          .found = line.substr(0, line.find_first_of(" \t")),
          .why = "reading a swapped-out page takes milliseconds, unless memory is locked",
          .remedy = "sudo swapoff --all"};
}

Finding look_at_load(const fs::path& root) {
  const auto load = number_of(line_of(root / "proc/loadavg"));
  const double cpus = std::max(1.0, static_cast<double>(cpu_folders(root).size()));
  if (!load || *load < 0.5 * cpus) {
    return {.name = "load", .found = fmt::format("{:.1f} on {:.0f} CPUs", load.value_or(0), cpus)};
  }
  return {.name = "load",
          .level = Level::kAdvice,
          .found = fmt::format("{:.1f} on {:.0f} CPUs", *load, cpus),
          .why = "other processes are running and affect the times below",
          .remedy = "top -o %CPU"};
}

std::string refusal_of(const base::ThreadOptions& options, std::string* remedy) {
  std::vector<base::Refusal> refusals;
  base::Thread thread(options, [] {}, refusals);
  thread.join();
  if (refusals.empty()) {
    return {};
  }
  *remedy = refusals.front().remedy;
  return refusals.front().what;
}

Finding look_at_fifo() {
  Finding finding{.name = "FIFO threads", .found = "allowed"};
  if (!refusal_of(
           {.name = "doctor", .cpus = {}, .policy = base::SchedulingPolicy::kFifo, .priority = 80},
           &finding.remedy)
           .empty()) {
    finding.level = Level::kProblem;
    finding.found = "refused";
    finding.why = "\"policy\": \"fifo\" of an executor has no effect";
  }
  return finding;
}

Finding look_at_memory_lock() {
  // As much as locking a small application needs.
  constexpr std::size_t kBytes = 64UL << 20U;
  rlimit limit{};
  getrlimit(RLIMIT_MEMLOCK, &limit);
  void* const memory =
      mmap(nullptr, kBytes, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
  const bool is_allowed = memory != MAP_FAILED && mlock(memory, kBytes) == 0;
  if (memory != MAP_FAILED) {
    munmap(memory, kBytes);
  }
  if (is_allowed) {
    return {.name = "memory lock", .found = "allowed"};
  }
  return {.name = "memory lock",
          .level = Level::kProblem,
          .found = fmt::format("{} KiB", limit.rlim_cur / 1024),
          .why = "the kernel may evict pages, which then have to be read again",
          .remedy =
              "a line `@realtime - memlock unlimited` in /etc/security/limits.conf for one of your "
              "groups; log in again"};
}

Finding look_at_affinity() {
  cpu_set_t set;
  CPU_ZERO(&set);
  sched_getaffinity(0, sizeof(set), &set);
  return {
      .name = "CPUs",
      .found = fmt::format("{} of {} may be used", CPU_COUNT(&set), sysconf(_SC_NPROCESSORS_ONLN))};
}

}  // namespace

std::vector<Finding> look_at_kernel(const fs::path& root) {
  return {look_at_preemption(root),  look_at_throttling(root), look_at_governor(root),
          look_at_idle_states(root), look_at_isolation(root),  look_at_quota(root),
          look_at_clock(root),       look_at_huge_pages(root), look_at_swap(root),
          look_at_load(root)};
}

std::vector<Finding> look_at_rights() {
  return {look_at_fifo(), look_at_memory_lock(), look_at_affinity()};
}

std::string name_of_machine(const fs::path& root) {
  std::string model = value_of(root / "proc/cpuinfo", "model name");
  if (model.empty()) {
    model = line_of(root / "proc/device-tree/model").value_or("unknown CPU");
  }
  const double memory_kib = number_of(value_of(root / "proc/meminfo", "MemTotal")).value_or(0.0);
  utsname system{};
  uname(&system);
  const std::size_t cpus = cpu_folders(root).size();
  return fmt::format("{}, {} CPU{}, {:.1f} GiB, {} {} ({})", model, cpus, cpus == 1 ? "" : "s",
                     memory_kib / (1024.0 * 1024.0), system.sysname, system.release,
                     system.machine);
}

}  // namespace fastcycle::tool::machine
