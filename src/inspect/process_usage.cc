#include "inspect/process_usage.h"

#include <ctime>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <system_error>

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

void read_memory(ProcessUsage& usage) {
  std::ifstream file("/proc/self/statm");
  std::int64_t size = 0;
  std::int64_t resident = 0;
  if (file >> size >> resident) {
    usage.virtual_bytes = size * ::sysconf(_SC_PAGESIZE);
    usage.resident_bytes = resident * ::sysconf(_SC_PAGESIZE);
  }
}

void read_files(ProcessUsage& usage) {
  std::error_code error;
  for (fs::directory_iterator entry("/proc/self/fd", error), end; !error && entry != end;
       entry.increment(error)) {
    ++usage.open_files;
  }
  if (usage.open_files > 0) {
    --usage.open_files;  // The descriptor used to read the folder.
  }
  rlimit limit{};
  if (::getrlimit(RLIMIT_NOFILE, &limit) == 0 && limit.rlim_cur != RLIM_INFINITY) {
    usage.max_files = limit.rlim_cur;
  }
}

void read_start(ProcessUsage& usage) {
  std::ifstream file("/proc/self/stat");
  std::string text;
  std::getline(file, text);
  const auto name_end = text.rfind(')');  // The name may contain anything.
  if (name_end == std::string::npos) {
    return;
  }
  std::istringstream fields(text.substr(name_end + 1));
  std::string field;
  for (int i = 3; i < 22; ++i) {
    fields >> field;
  }
  std::int64_t ticks = 0;
  if (fields >> ticks) {
    const std::int64_t after_boot_ns = ticks * (1'000'000'000 / ::sysconf(_SC_CLK_TCK));
    usage.start_ns = read_clock(CLOCK_REALTIME) - read_clock(CLOCK_BOOTTIME) + after_boot_ns;
  }
}

void read_threads(ProcessUsage& usage) {
  std::error_code error;
  for (fs::directory_iterator entry("/proc/self/task", error), end; !error && entry != end;
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

}  // namespace

ProcessUsage process_usage() {
  ProcessUsage usage;
  usage.cpu_ns = read_clock(CLOCK_PROCESS_CPUTIME_ID);
  read_memory(usage);
  read_files(usage);
  read_start(usage);
  read_threads(usage);
  return usage;
}

}  // namespace fastcycle::inspect
