// Put before a process by LD_PRELOAD, it shows the process a system clock that is SHIFTED_CLOCK_MS
// ahead: as on a computer whose clock is not synchronized.
#include <cerrno>
#include <cstdlib>
#include <ctime>

#include <sys/syscall.h>
#include <unistd.h>

namespace {

long shift_ms() {
  static const long kShift = [] {
    const char* const text = std::getenv("SHIFTED_CLOCK_MS");
    return text == nullptr ? 0 : std::strtol(text, nullptr, 10);
  }();
  return kShift;
}

}  // namespace

extern "C" int clock_gettime(clockid_t clock, timespec* time) noexcept {
  // The system call itself: the function of the C library is this one now.
  if (syscall(SYS_clock_gettime, clock, time) != 0) {
    return -1;
  }
  if (clock == CLOCK_REALTIME) {
    time->tv_sec += shift_ms() / 1000;
    time->tv_nsec += shift_ms() % 1000 * 1'000'000;
    if (time->tv_nsec >= 1'000'000'000) {
      ++time->tv_sec;
      time->tv_nsec -= 1'000'000'000;
    }
  }
  return 0;
}
