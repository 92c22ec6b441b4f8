// Preloaded by wake.py: when a futex call wakes a thread, and when one that has waited returns.

#include <array>
#include <atomic>
#include <cstdarg>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <new>
#include <string>

#include <dlfcn.h>
#include <linux/futex.h>
#include <sys/mman.h>
#include <sys/syscall.h>
#include <unistd.h>

#include "measure/clock.h"

namespace {

using Syscall = long (*)(long number, long, long, long, long, long, long);

struct Stamp {
  std::int64_t time_ns = 0;
  bool is_return = false;  // Of a call that waited; otherwise a call that is about to wake.
};

constexpr std::size_t kStamps = std::size_t{1} << 20;

struct Stamps {
  std::atomic<std::size_t> count{0};
  std::array<Stamp, kStamps> all;
};

// Shared with the processes that are forked from this one.
Stamps* stamps = nullptr;
pid_t owner = 0;

void add(bool is_return) noexcept {
  const std::int64_t time_ns = fastcycle::measure::now_ns();
  if (stamps == nullptr) {
    return;
  }
  const std::size_t index = stamps->count.fetch_add(1, std::memory_order_relaxed);
  if (index < stamps->all.size()) {
    stamps->all[index] = {.time_ns = time_ns, .is_return = is_return};
  }
}

// Touches the memory, so that no stamp causes a page fault in this process.
[[gnu::constructor]] void map_stamps() {
  void* const memory = mmap(nullptr, sizeof(Stamps), PROT_READ | PROT_WRITE,
                            MAP_SHARED | MAP_ANONYMOUS | MAP_POPULATE, -1, 0);
  if (memory != MAP_FAILED) {
    stamps = new (memory) Stamps;
    owner = getpid();
  }
}

Syscall prepare() noexcept {
  return reinterpret_cast<Syscall>(dlsym(RTLD_NEXT, "syscall"));
}

/// Writes a line for each stamp, also of forked processes, to the file WAKE_STAMPS.PID: programs
/// that this one starts have this library too.
[[gnu::destructor]] void write_stamps() {
  const char* const path = std::getenv("WAKE_STAMPS");
  if (path == nullptr || stamps == nullptr || owner != getpid()) {
    return;
  }
  const std::string name = std::string(path) + "." + std::to_string(getpid());
  std::FILE* const file = std::fopen(name.c_str(), "w");
  if (file == nullptr) {
    return;
  }
  for (std::size_t i = 0; i < stamps->count.load() && i < stamps->all.size(); ++i) {
    std::fprintf(file, "%s,%lld\n", stamps->all[i].is_return ? "return" : "wake",
                 static_cast<long long>(stamps->all[i].time_ns));
  }
  const bool has_failed = std::ferror(file) != 0;
  if (std::fclose(file) != 0 || has_failed) {
    std::remove(name.c_str());  // wake.py reports that it is missing.
  }
}

}  // namespace

/// Instead of the C library's, for all libraries.
extern "C" [[gnu::visibility("default")]] long syscall(long number, ...) noexcept {
  static const Syscall original = prepare();
  std::array<long, 6> given{};
  va_list rest;
  va_start(rest, number);
  for (long& one : given) {
    one = va_arg(rest, long);
  }
  va_end(rest);
  const long operation = given[1] & FUTEX_CMD_MASK & ~FUTEX_PRIVATE_FLAG;
  if (number == SYS_futex && operation == FUTEX_WAKE) {
    add(false);
  }
  const long result = original(number, given[0], given[1], given[2], given[3], given[4], given[5]);
  const bool has_waited =
      (number == SYS_futex && (operation == FUTEX_WAIT || operation == FUTEX_WAIT_BITSET)) ||
      number == SYS_futex_waitv;
  if (has_waited && result >= 0) {
    add(true);
  }
  return result;
}
