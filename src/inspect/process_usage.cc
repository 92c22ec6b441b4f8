#include "inspect/process_usage.h"

#include <ctime>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <string>
#include <system_error>
#include <utility>

#include <sys/resource.h>
#include <unistd.h>

namespace fastcycle::inspect {
namespace {

namespace fs = std::filesystem;

std::int64_t read_clock(clockid_t clock) {
  timespec time{};
  ::clock_gettime(clock, &time);
  return std::int64_t{time.tv_sec} * 1'000'000'000 + time.tv_nsec;
}

void read_memory(const fs::path& folder, ProcessUsage& usage) {
  std::ifstream file(folder / "statm");
  std::int64_t size = 0;
  std::int64_t resident = 0;
  if (file >> size >> resident) {
    usage.virtual_bytes = size * ::sysconf(_SC_PAGESIZE);
    usage.resident_bytes = resident * ::sysconf(_SC_PAGESIZE);
  }
}

void read_files(const fs::path& folder, ProcessUsage& usage) {
  std::error_code error;
  for (fs::directory_iterator entry(folder / "fd", error), end; !error && entry != end;
       entry.increment(error)) {
    ++usage.open_files;
  }
}

void read_start(const fs::path& folder, ProcessUsage& usage) {
  std::ifstream file(folder / "stat");
  std::string text;
  std::getline(file, text);
  const auto name_end = text.rfind(')');  // The name may contain anything.
  if (name_end == std::string::npos) {
    return;
  }
  std::istringstream fields(text.substr(name_end + 1));
  std::string field;
  fields >> field >> usage.parent;
  for (int i = 5; i < 22; ++i) {
    fields >> field;
  }
  std::int64_t ticks = 0;
  if (fields >> ticks) {
    const std::int64_t after_boot_ns = ticks * (1'000'000'000 / ::sysconf(_SC_CLK_TCK));
    usage.start_ns = read_clock(CLOCK_REALTIME) - read_clock(CLOCK_BOOTTIME) + after_boot_ns;
  }
}

void read_threads(const fs::path& folder, ProcessUsage& usage) {
  std::error_code error;
  for (fs::directory_iterator entry(folder / "task", error), end; !error && entry != end;
       entry.increment(error)) {
    std::ifstream name_file(entry->path() / "comm");
    std::ifstream time_file(entry->path() / "schedstat");
    std::string name;
    std::int64_t cpu_ns = 0;
    if (std::getline(name_file, name) &&
        time_file >> cpu_ns) {  // Else the thread has ended meanwhile.
      ProcessUsage::Threads& threads = usage.threads[name];
      threads.cpu_ns += cpu_ns;
      ++threads.count;
    }
  }
}

ProcessUsage read(const fs::path& folder, clockid_t clock) {
  ProcessUsage usage;
  usage.cpu_ns = read_clock(clock);
  read_memory(folder, usage);
  read_files(folder, usage);
  read_start(folder, usage);
  read_threads(folder, usage);
  return usage;
}

}  // namespace

ProcessUsage process_usage() {
  ProcessUsage usage = read("/proc/self", CLOCK_PROCESS_CPUTIME_ID);
  if (usage.open_files > 0) {
    --usage.open_files;  // The descriptor used to read the folder.
  }
  rlimit limit{};
  if (::getrlimit(RLIMIT_NOFILE, &limit) == 0 && limit.rlim_cur != RLIM_INFINITY) {
    usage.max_files = limit.rlim_cur;
  }
  return usage;
}

std::optional<ProcessUsage> process_usage(pid_t pid) {
  clockid_t clock{};
  if (pid <= 0 || ::clock_getcpuclockid(pid, &clock) != 0) {
    return std::nullopt;
  }
  ProcessUsage usage = read("/proc/" + std::to_string(pid), clock);
  return usage.start_ns == 0 ? std::nullopt : std::optional(std::move(usage));
}

}  // namespace fastcycle::inspect
