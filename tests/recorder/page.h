#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <stdexcept>
#include <string>

#include <fcntl.h>
#include <sys/mman.h>
#include <unistd.h>

namespace fastcycle::recorder_test {

/// What a publisher says that it has published. It is mapped from a file, so that it is known also
/// of a process that was killed.
struct Page {
  static constexpr std::size_t kMostTimes = std::size_t{1} << 16U;

  /// The sequence of the last message whose `publish` has returned.
  std::atomic<std::uint64_t> last{0};
  /// When it had returned, CLOCK_MONOTONIC, of the last `kMostTimes` messages.
  std::array<std::atomic<std::int64_t>, kMostTimes> returned_ns{};

  void note(std::uint64_t sequence, std::int64_t now_ns) noexcept {
    returned_ns[sequence % kMostTimes].store(now_ns, std::memory_order_relaxed);
    last.store(sequence, std::memory_order_release);
  }

  /// @pre  It is one of the last `kMostTimes`.
  [[nodiscard]] std::int64_t time_of(std::uint64_t sequence) const noexcept {
    return returned_ns[sequence % kMostTimes].load(std::memory_order_relaxed);
  }
};

/// A page in a file, which is made if it is not there, all zero.
class MappedPage {
 public:
  explicit MappedPage(const std::string& file) {
    const int descriptor = ::open(file.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0600);
    if (descriptor < 0 || ::ftruncate(descriptor, sizeof(Page)) != 0) {
      throw std::runtime_error(file + ": cannot be made");
    }
    memory_ = ::mmap(nullptr, sizeof(Page), PROT_READ | PROT_WRITE, MAP_SHARED, descriptor, 0);
    ::close(descriptor);
    if (memory_ == MAP_FAILED) {
      throw std::runtime_error(file + ": cannot be mapped");
    }
  }
  MappedPage(const MappedPage&) = delete;
  MappedPage& operator=(const MappedPage&) = delete;
  ~MappedPage() { ::munmap(memory_, sizeof(Page)); }

  [[nodiscard]] Page& operator*() const { return *static_cast<Page*>(memory_); }
  [[nodiscard]] Page* operator->() const { return static_cast<Page*>(memory_); }

 private:
  void* memory_ = nullptr;
};

}  // namespace fastcycle::recorder_test
