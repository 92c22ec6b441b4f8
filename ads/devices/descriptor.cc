#include "descriptor.h"

#include <cerrno>
#include <system_error>

#include <unistd.h>

namespace ads {

void Descriptor::reset() noexcept {
  if (number_ >= 0) {
    ::close(std::exchange(number_, -1));
  }
}

void throw_errno(const std::string& what) {
  throw std::system_error(errno, std::generic_category(), what);
}

Descriptor checked_descriptor(int number, const std::string& what) {
  if (number < 0) {
    throw_errno(what);
  }
  return Descriptor(number);
}

}  // namespace ads
