#include "segment/segments.h"

#include <cerrno>
#include <cstring>
#include <utility>

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/mman.h>
#include <unistd.h>

#include "fastcycle/assert.h"

// Linux 5.1; missing in older headers.
#ifndef F_SEAL_FUTURE_WRITE
#define F_SEAL_FUTURE_WRITE 0x0010
#endif

namespace fastcycle::segment {
namespace {

std::string refused(const char* what) {
  return fmt::format("the memory of the application's processes: {}: {}", what,
                     std::strerror(errno));
}

}  // namespace

Segments::~Segments() {
  if (base::shared_memory.allocator == this) {
    base::shared_memory = {};
  }
  for (const int file : files_) {
    if (file >= 0) {
      close(file);
    }
  }
  if (begin_ != nullptr) {
    munmap(begin_, options_.bytes * kGenerations * options_.processes);
  }
}

std::optional<std::string> Segments::reserve(const Options& options) {
  FASTCYCLE_ASSERT(begin_ == nullptr && base::shared_memory.size == 0,
                   "a process has the segments of one application");
  options_ = options;
  const std::size_t total = options.bytes * kGenerations * options.processes;
  // At any address: children inherit it, so that no address has to be fixed.
  void* const range =
      mmap(nullptr, total, PROT_NONE, MAP_PRIVATE | MAP_ANONYMOUS | MAP_NORESERVE, -1, 0);
  if (range == MAP_FAILED) {
    return refused("a range of addresses");
  }
  begin_ = static_cast<char*>(range);
  for (unsigned i = 0; i < options.processes * kGenerations; ++i) {
    const int file = memfd_create("fastcycle-segment", MFD_CLOEXEC | MFD_ALLOW_SEALING);
    files_.push_back(file);
    if (file < 0 || ftruncate(file, static_cast<off_t>(options.bytes)) != 0) {
      return refused("a file in memory");
    }
    char* const address = begin_ + i * options.bytes;
    if (mmap(address, options.bytes, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_FIXED, file, 0) ==
        MAP_FAILED) {
      return refused("a mapping");
    }
    madvise(address, options.bytes, MADV_DONTDUMP);
    // This mapping stays writable; no further writable one can be created.
    if (fcntl(file, F_ADD_SEALS, F_SEAL_SHRINK | F_SEAL_GROW | F_SEAL_FUTURE_WRITE | F_SEAL_SEAL) !=
        0) {
      return refused("a seal");
    }
  }
  base::shared_memory = {.begin = reinterpret_cast<std::uintptr_t>(begin_), .size = total};
  return std::nullopt;
}

std::optional<std::string> Segments::become(ProcessIndex process, unsigned generation) {
  const unsigned own = process * kGenerations + generation;
  for (unsigned i = 0; i < files_.size(); ++i) {
    // mprotect does not suffice: it can be reverted. A new mapping of a sealed file cannot.
    if (i != own) {
      char* const address = begin_ + i * options_.bytes;
      if (mmap(address, options_.bytes, PROT_READ, MAP_SHARED | MAP_FIXED, files_[i], 0) ==
          MAP_FAILED) {
        return refused("a read-only mapping");
      }
      madvise(address, options_.bytes, MADV_DONTDUMP);
    }
  }
  for (int& file : files_) {
    close(std::exchange(file, -1));
  }
  char* const segment = control(process, generation);
  std::memset(segment, 0, options_.control_bytes);
  heap_.begin(segment + options_.control_bytes, options_.bytes - options_.control_bytes);
  base::shared_memory.own_begin = reinterpret_cast<std::uintptr_t>(segment);
  base::shared_memory.own_size = options_.bytes;
  base::shared_memory.allocator = this;
  return std::nullopt;
}

bool Segments::is_in(ProcessIndex process, unsigned generation, const void* address,
                     std::size_t size) const noexcept {
  const std::uintptr_t offset = reinterpret_cast<std::uintptr_t>(address) -
                                reinterpret_cast<std::uintptr_t>(control(process, generation));
  return offset < options_.bytes && size <= options_.bytes - offset;
}

void Segments::free(void* memory) noexcept {
  if (base::shared_memory.is_own(memory)) {
    heap_.free(memory);
  } else {
    foreign_deletes_.fetch_add(1, std::memory_order_relaxed);
  }
}

}  // namespace fastcycle::segment
