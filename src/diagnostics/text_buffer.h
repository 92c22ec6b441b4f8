#pragma once

#include <algorithm>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <string_view>

namespace fastcycle::diagnostics {

/// A number in hexadecimal digits: `0x1f`.
struct Hex {
  std::uint64_t value = 0;
};

/// A time in nanoseconds: `12.3 ms`, `4.0 s`.
struct Span {
  std::int64_t ns = 0;
};

/// Untrusted text: control characters become `?`, so that it cannot control a terminal.
struct Foreign {
  std::string_view text;
};

/// Writes text to preallocated memory; what does not fit is dropped.
///
/// @threads  Compatible.
/// @realtime No allocation, no lock, no system call: for signal handlers.
class TextBuffer {
 public:
  explicit TextBuffer(std::span<char> memory) noexcept : memory_(memory) {}

  TextBuffer& operator<<(std::string_view text) noexcept {
    const std::size_t count = std::min(text.size(), memory_.size() - size_);
    std::memcpy(memory_.data() + size_, text.data(), count);
    size_ += count;
    return *this;
  }
  TextBuffer& operator<<(const char* text) noexcept {
    return *this << std::string_view(text == nullptr ? "?" : text);
  }
  TextBuffer& operator<<(Foreign foreign) noexcept {
    for (const char c : foreign.text) {
      const bool is_control = static_cast<unsigned char>(c) < 0x20 || c == 0x7f;
      const char shown = is_control ? '?' : c;
      *this << std::string_view(&shown, 1);
    }
    return *this;
  }
  template <std::integral Number>
  TextBuffer& operator<<(Number number) noexcept {
    if constexpr (std::is_signed_v<Number>) {
      if (number < 0) {
        *this << "-";
        return add_digits(std::uint64_t{0} - static_cast<std::uint64_t>(number), 10);
      }
    }
    return add_digits(static_cast<std::uint64_t>(number), 10);
  }
  TextBuffer& operator<<(Hex number) noexcept {
    return (*this << "0x").add_digits(number.value, 16);
  }
  TextBuffer& operator<<(Span span) noexcept {
    const std::int64_t us = span.ns / 1000;
    if (us < 0) {
      return *this << "-" << Span{-span.ns};
    }
    if (us < 1'000'000) {
      return *this << us / 1000 << "." << us / 100 % 10 << " ms";
    }
    return *this << us / 1'000'000 << "." << us / 100'000 % 10 << " s";
  }

  [[nodiscard]] std::string_view text() const noexcept { return {memory_.data(), size_}; }
  [[nodiscard]] std::size_t size() const noexcept { return size_; }
  /// Truncates the text to `size` characters.
  void cut(std::size_t size) noexcept { size_ = std::min(size_, size); }

 private:
  TextBuffer& add_digits(std::uint64_t number, unsigned base) noexcept {
    char digits[24];
    char* begin = digits + sizeof(digits);
    do {
      *--begin = "0123456789abcdef"[number % base];
      number /= base;
    } while (number != 0);
    return *this << std::string_view(begin,
                                     static_cast<std::size_t>(digits + sizeof(digits) - begin));
  }

  const std::span<char> memory_;
  std::size_t size_ = 0;
};

}  // namespace fastcycle::diagnostics
