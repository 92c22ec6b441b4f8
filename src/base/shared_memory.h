#pragma once

// The memory that the processes of an application read of each other, as needed for allocation: one
// range of addresses, and the source of a thread's `new`.

#include <cstddef>
#include <cstdint>

namespace fastcycle::base {

/// The allocator of a thread within a scope of shared memory.
///
/// @threads  Safe.
class SharedAllocator {
 public:
  SharedAllocator() = default;
  SharedAllocator(const SharedAllocator&) = delete;
  SharedAllocator& operator=(const SharedAllocator&) = delete;
  virtual ~SharedAllocator() = default;

  /// Null if there is no room.
  [[nodiscard]] virtual void* allocate(std::size_t size, std::size_t alignment) noexcept = 0;
  /// Frees memory within the range; no effect on memory of another process.
  virtual void free(void* memory) noexcept = 0;
};

/// The range of this process, and its allocator. Set once, while the process has one thread.
struct SharedMemory {
  std::uintptr_t begin = 0;
  std::size_t size = 0;                  ///< 0: there is none.
  std::uintptr_t own_begin = 0;          ///< The part that this process writes.
  std::size_t own_size = 0;              ///< 0: it writes none.
  SharedAllocator* allocator = nullptr;  ///< Null: it writes none.

  [[nodiscard]] bool has(const void* address) const noexcept {
    return reinterpret_cast<std::uintptr_t>(address) - begin < size;
  }
  [[nodiscard]] bool is_own(const void* address) const noexcept {
    return reinterpret_cast<std::uintptr_t>(address) - own_begin < own_size;
  }
};
extern SharedMemory shared_memory;

/// Nesting depth of the thread's scopes of shared memory.
extern thread_local constinit unsigned shared_scopes __attribute__((tls_model("initial-exec")));

inline void enter_shared_scope() noexcept {
  ++shared_scopes;
}
/// A scope may end on another thread than it began on; no effect on a thread that is in none.
inline void leave_shared_scope() noexcept {
  shared_scopes -= shared_scopes > 0 ? 1 : 0;
}

}  // namespace fastcycle::base
