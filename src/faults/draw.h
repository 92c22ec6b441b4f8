#pragma once

#include <cstdint>
#include <string_view>

namespace fastcycle::faults {

/// Mixes all bits of `x` (the finalizer of SplitMix64).
[[nodiscard]] constexpr std::uint64_t mixed(std::uint64_t x) noexcept {
  x += 0x9e3779b97f4a7c15ULL;
  x = (x ^ (x >> 30U)) * 0xbf58476d1ce4e5b9ULL;
  x = (x ^ (x >> 27U)) * 0x94d049bb133111ebULL;
  return x ^ (x >> 31U);
}

/// Random bits for one message and one fault: 64 bits that depend on these four only, and not on
/// workers, processes or other faults.
[[nodiscard]] constexpr std::uint64_t draw(std::uint64_t seed, std::string_view fault,
                                           std::uint64_t publisher,
                                           std::uint64_t sequence) noexcept {
  std::uint64_t hash = mixed(seed);
  for (const char c : fault) {
    hash = mixed(hash ^ static_cast<unsigned char>(c));
  }
  return mixed(mixed(hash ^ publisher) ^ sequence);
}

/// Converts `bits` to a number in [0, 1).
[[nodiscard]] constexpr double unit_of(std::uint64_t bits) noexcept {
  return static_cast<double>(bits >> 11U) * 0x1.0p-53;
}

}  // namespace fastcycle::faults
