#pragma once

// The memory that the processes of an application read of each other, as far as those must know it
// who allocate: one range of addresses, and where a thread's `new` takes its memory from.

#include <cstddef>
#include <cstdint>

namespace fastcycle::base {

/// Where memory comes from while a thread is in a scope of shared memory.
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
  /// Frees what lies in the range; also where it belongs to another process, which keeps it.
  virtual void free(void* memory) noexcept = 0;
};

/// The range of this process, and who allocates in it. Set once, while the process has one thread.
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

/// In how many scopes of shared memory the thread is.
extern thread_local constinit unsigned shared_scopes __attribute__((tls_model("initial-exec")));

inline void enter_shared_scope() noexcept {
  ++shared_scopes;
}
/// A scope may end on another thread than it began on; who is in none stays there.
inline void leave_shared_scope() noexcept {
  shared_scopes -= shared_scopes > 0 ? 1 : 0;
}

}  // namespace fastcycle::base
