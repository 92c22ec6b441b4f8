#pragma once

#include <string>
#include <utility>

namespace ads {

/// Owns an open file descriptor.
///
/// @threads  Compatible.
class Descriptor {
 public:
  Descriptor() = default;
  explicit Descriptor(int number) : number_(number) {}
  Descriptor(Descriptor&& other) noexcept : number_(std::exchange(other.number_, -1)) {}
  Descriptor& operator=(Descriptor&& other) noexcept {
    std::swap(number_, other.number_);
    return *this;
  }
  Descriptor(const Descriptor&) = delete;
  Descriptor& operator=(const Descriptor&) = delete;
  ~Descriptor() { reset(); }

  [[nodiscard]] int get() const { return number_; }
  [[nodiscard]] bool is_open() const { return number_ >= 0; }
  void reset() noexcept;

 private:
  int number_ = -1;
};

/// Throws `std::system_error` with `errno` and the prefix `what`.
[[noreturn]] void throw_errno(const std::string& what);

/// `number` as a descriptor.
///
/// @errors  As `throw_errno` if it is negative.
Descriptor checked_descriptor(int number, const std::string& what);

}  // namespace ads
