// The replacement of `operator new` and `operator delete` ([new.delete]): within a loan scope
// memory comes from the process's segment, everywhere else from malloc. A program whose processes
// read each other's messages is linked with this file; from a library it would be too late if the
// runtime of a sanitizer, or libstdc++, precedes it. All forms are defined: a missing one would be
// the runtime's, whose memory this cannot free.

#include <cstdint>
#include <cstdlib>
#include <new>

#include "base/shared_memory.h"

namespace {

using fastcycle::base::shared_memory;
using fastcycle::base::shared_scopes;

constexpr std::size_t kUsualAlignment = __STDCPP_DEFAULT_NEW_ALIGNMENT__;

void* allocate_or_null(std::size_t size, std::size_t alignment) noexcept {
  if (shared_scopes != 0 && shared_memory.allocator != nullptr) [[unlikely]] {
    // If the segment is full: malloc; the publisher detects that.
    if (void* const memory = shared_memory.allocator->allocate(size, alignment)) {
      return memory;
    }
  }
  if (alignment <= kUsualAlignment) {
    return std::malloc(size == 0 ? 1 : size);
  }
  if (size > SIZE_MAX - alignment) {
    return nullptr;
  }
  const std::size_t needed = size == 0 ? 1 : size;
  return std::aligned_alloc(alignment, (needed + alignment - 1) / alignment * alignment);
}

void* allocate(std::size_t size, std::size_t alignment) {
  for (;;) {
    if (void* const memory = allocate_or_null(size, alignment)) [[likely]] {
      return memory;
    }
    const std::new_handler handler = std::get_new_handler();
    if (handler == nullptr) {
      throw std::bad_alloc();
    }
    handler();
  }
}

void* allocate_quietly(std::size_t size, std::size_t alignment) noexcept {
  try {
    return allocate(size, alignment);
  } catch (...) {
    return nullptr;
  }
}

void give_back(void* memory) noexcept {
  if (shared_memory.has(memory)) [[unlikely]] {
    if (shared_memory.allocator != nullptr) {
      shared_memory.allocator->free(memory);
    }
    return;
  }
  std::free(memory);
}

std::size_t to_size(std::align_val_t alignment) noexcept {
  return static_cast<std::size_t>(alignment);
}

}  // namespace

void* operator new(std::size_t size) {
  return allocate(size, kUsualAlignment);
}
void* operator new[](std::size_t size) {
  return allocate(size, kUsualAlignment);
}
void* operator new(std::size_t size, std::align_val_t alignment) {
  return allocate(size, to_size(alignment));
}
void* operator new[](std::size_t size, std::align_val_t alignment) {
  return allocate(size, to_size(alignment));
}
void* operator new(std::size_t size, const std::nothrow_t&) noexcept {
  return allocate_quietly(size, kUsualAlignment);
}
void* operator new[](std::size_t size, const std::nothrow_t&) noexcept {
  return allocate_quietly(size, kUsualAlignment);
}
void* operator new(std::size_t size, std::align_val_t alignment, const std::nothrow_t&) noexcept {
  return allocate_quietly(size, to_size(alignment));
}
void* operator new[](std::size_t size, std::align_val_t alignment, const std::nothrow_t&) noexcept {
  return allocate_quietly(size, to_size(alignment));
}

void operator delete(void* memory) noexcept {
  give_back(memory);
}
void operator delete[](void* memory) noexcept {
  give_back(memory);
}
void operator delete(void* memory, std::size_t) noexcept {
  give_back(memory);
}
void operator delete[](void* memory, std::size_t) noexcept {
  give_back(memory);
}
void operator delete(void* memory, const std::nothrow_t&) noexcept {
  give_back(memory);
}
void operator delete[](void* memory, const std::nothrow_t&) noexcept {
  give_back(memory);
}
void operator delete(void* memory, std::align_val_t) noexcept {
  give_back(memory);
}
void operator delete[](void* memory, std::align_val_t) noexcept {
  give_back(memory);
}
void operator delete(void* memory, std::size_t, std::align_val_t) noexcept {
  give_back(memory);
}
void operator delete[](void* memory, std::size_t, std::align_val_t) noexcept {
  give_back(memory);
}
void operator delete(void* memory, std::align_val_t, const std::nothrow_t&) noexcept {
  give_back(memory);
}
void operator delete[](void* memory, std::align_val_t, const std::nothrow_t&) noexcept {
  give_back(memory);
}
