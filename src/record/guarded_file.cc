#include "record/guarded_file.h"

#include <array>
#include <cerrno>
#include <csignal>
#include <mutex>
#include <system_error>
#include <utility>

#include <pthread.h>
#include <sys/mman.h>
#include <unistd.h>

namespace fastcycle::record {

/// One guarded file, as the signal handler sees it.
struct GuardedFile::Slot {
  std::atomic<bool> is_taken{false};
  std::atomic<std::byte*> memory{nullptr};  ///< Stored last: then all other members are valid.
  std::atomic<std::uint64_t> size{0};
  std::atomic<int> descriptor{-1};
  std::atomic<bool> is_cut{false};

  [[nodiscard]] bool has(const void* address) const noexcept {
    const std::byte* const begin = memory.load(std::memory_order_acquire);
    const auto* const byte = static_cast<const std::byte*>(address);
    return begin != nullptr && byte >= begin && byte < begin + size.load(std::memory_order_relaxed);
  }

  /// Replaces the mapping of the file with anonymous memory. One system call: safe in signal
  /// handlers, and in a child after `fork`.
  [[nodiscard]] bool replace_by_memory() noexcept {
    std::byte* const begin = memory.load(std::memory_order_acquire);
    return ::mmap(begin, size.load(std::memory_order_relaxed), PROT_READ | PROT_WRITE,
                  MAP_PRIVATE | MAP_ANONYMOUS | MAP_FIXED | MAP_NORESERVE, -1, 0) != MAP_FAILED;
  }
};

/// Process-wide. Never destroyed: signals may arrive at any time.
struct SlotTable {
  static std::array<GuardedFile::Slot, GuardedFile::kFilesMax> slots;
  static struct sigaction before;             ///< The previous action of SIGBUS.
  static std::atomic<const void*> passed_on;  ///< Address of the last fault passed on.
  static std::mutex mutex;                    ///< Guards the installation of the handler.
  static bool has_fork_handler;

  static void on_bus_error(int signal, siginfo_t* info, void* context) noexcept {
    const int error = errno;
    for (GuardedFile::Slot& slot : slots) {
      // Not a signal sent by a process, which has no address.
      if (info->si_code > 0 && slot.has(info->si_addr) && slot.replace_by_memory()) {
        slot.is_cut.store(true, std::memory_order_release);
        errno = error;
        return;
      }
    }
    errno = error;
    pass_on(signal, info, context);
  }

  /// Behaves as if this handler did not exist.
  static void pass_on(int signal, siginfo_t* info, void* context) noexcept {
    const bool is_fault = info->si_code > 0;
    // A handler that only reports a fault lets it repeat, and may have restored this one.
    const bool comes_again = is_fault && passed_on.exchange(info->si_addr) == info->si_addr;
    const bool has_handler = (before.sa_flags & SA_SIGINFO) != 0 ||
                             (before.sa_handler != SIG_DFL && before.sa_handler != SIG_IGN);
    if (has_handler && !comes_again) {
      if ((before.sa_flags & SA_SIGINFO) != 0) {
        before.sa_sigaction(signal, info, context);
      } else {
        before.sa_handler(signal);
      }
      return;
    }
    if (!is_fault && before.sa_handler == SIG_IGN) {
      return;
    }
    struct sigaction standard{};
    standard.sa_handler = SIG_DFL;
    ::sigaction(signal, &standard, nullptr);
    if (!is_fault) {
      static_cast<void>(::raise(signal));  // A fault repeats by itself.
    }
  }

  static void on_forked() noexcept {
    for (GuardedFile::Slot& slot : slots) {
      if (slot.memory.load(std::memory_order_acquire) != nullptr) {
        static_cast<void>(slot.replace_by_memory());
        ::close(slot.descriptor.exchange(-1));
      }
    }
  }

  /// Installs the handler, again if another one replaced it; that one becomes the previous one.
  static void get_ready() {
    const std::lock_guard lock(mutex);
    struct sigaction present{};
    ::sigaction(SIGBUS, nullptr, &present);
    const bool is_there =
        (present.sa_flags & SA_SIGINFO) != 0 && present.sa_sigaction == on_bus_error;
    if (!is_there) {
      before = present;
      struct sigaction action{};
      action.sa_sigaction = on_bus_error;
      action.sa_flags = SA_SIGINFO | SA_ONSTACK;
      sigemptyset(&action.sa_mask);
      ::sigaction(SIGBUS, &action, nullptr);
    }
    if (!std::exchange(has_fork_handler, true)) {
      ::pthread_atfork(nullptr, nullptr, on_forked);
    }
  }
};

std::array<GuardedFile::Slot, GuardedFile::kFilesMax> SlotTable::slots{};
struct sigaction SlotTable::before{};
std::atomic<const void*> SlotTable::passed_on{nullptr};
std::mutex SlotTable::mutex;
bool SlotTable::has_fork_handler = false;

GuardedFile::GuardedFile(int descriptor, std::uint64_t size) : size_(size) {
  const auto fail = [&](int error, const char* what) {
    ::close(descriptor);
    throw std::system_error(error, std::system_category(), what);
  };
  SlotTable::get_ready();
  for (Slot& slot : SlotTable::slots) {
    if (!slot.is_taken.exchange(true)) {
      slot_ = &slot;
      break;
    }
  }
  if (slot_ == nullptr) {
    fail(EMFILE, "a place among 64 mapped files");
  }
  void* const memory = ::mmap(nullptr, size, PROT_READ | PROT_WRITE, MAP_SHARED, descriptor, 0);
  if (memory == MAP_FAILED) {
    const int error = errno;
    slot_->is_taken = false;
    fail(error, "a file that can be mapped");
  }
  memory_ = static_cast<std::byte*>(memory);
  slot_->size.store(size, std::memory_order_relaxed);
  slot_->descriptor.store(descriptor, std::memory_order_relaxed);
  slot_->is_cut.store(false, std::memory_order_relaxed);
  slot_->memory.store(memory_, std::memory_order_release);
}

GuardedFile::~GuardedFile() {
  slot_->memory.store(nullptr, std::memory_order_release);
  ::munmap(memory_, size_);
  if (const int descriptor = slot_->descriptor.exchange(-1); descriptor >= 0) {
    ::close(descriptor);
  }
  slot_->is_taken = false;
}

int GuardedFile::descriptor() const noexcept {
  return slot_->descriptor.load(std::memory_order_relaxed);
}

bool GuardedFile::is_cut() const noexcept {
  return slot_->is_cut.load(std::memory_order_acquire);
}

}  // namespace fastcycle::record
