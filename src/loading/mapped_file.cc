#include "loading/mapped_file.h"

#include <cerrno>

#include <fcntl.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

namespace fastcycle::host {

MappedFile::MappedFile(const std::filesystem::path& file) {
  // O_NONBLOCK: a FIFO of that name must not hold up the start.
  const int descriptor = ::open(file.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK);
  if (descriptor < 0) {
    error = std::strerror(errno);
    return;
  }
  struct stat status{};
  if (fstat(descriptor, &status) != 0 || !S_ISREG(status.st_mode)) {
    error = "not a regular file";
  } else if (status.st_size > 0) {
    size_ = static_cast<std::size_t>(status.st_size);
    void* address = mmap(nullptr, size_, PROT_READ, MAP_PRIVATE, descriptor, 0);
    if (address == MAP_FAILED) {
      error = std::strerror(errno);
    } else {
      address_ = address;
    }
  }
  ::close(descriptor);
}

MappedFile::~MappedFile() {
  if (address_ != nullptr) {
    munmap(address_, size_);
  }
}

std::optional<std::string_view> MappedFile::at(std::uint64_t offset, std::uint64_t size) const {
  if (address_ == nullptr || offset > size_ || size > size_ - offset) {
    return std::nullopt;
  }
  return std::string_view(static_cast<const char*>(address_) + offset, size);
}

}  // namespace fastcycle::host
