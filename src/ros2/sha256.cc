#include "ros2/sha256.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <string>

namespace fastcycle::ros2 {
namespace {

constexpr std::size_t kBlockBytes = 64;
constexpr std::size_t kRounds = 64;

/// The first 32 bits behind the point of a root of the first prime numbers.
struct Constants {
  std::array<std::uint32_t, kRounds> rounds{};
  std::array<std::uint32_t, 8> first{};

  Constants() {
    const auto fraction = [](long double root) {
      return static_cast<std::uint32_t>(std::floor((root - std::floor(root)) * 4294967296.0L));
    };
    std::size_t count = 0;
    for (unsigned number = 2; count < kRounds; ++number) {
      bool is_prime = true;
      for (unsigned factor = 2; factor * factor <= number && is_prime; ++factor) {
        is_prime = number % factor != 0;
      }
      if (is_prime) {
        rounds.at(count) = fraction(std::cbrt(static_cast<long double>(number)));
        if (count < first.size()) {
          first.at(count) = fraction(std::sqrt(static_cast<long double>(number)));
        }
        ++count;
      }
    }
  }
};

void take_block(std::string_view block, const Constants& constants,
                std::array<std::uint32_t, 8>& state) {
  std::array<std::uint32_t, kRounds> words{};
  for (std::size_t i = 0; i < kBlockBytes; ++i) {
    words.at(i / 4) = words.at(i / 4) << 8U | static_cast<unsigned char>(block[i]);
  }
  for (std::size_t i = 16; i < kRounds; ++i) {
    const std::uint32_t a = words.at(i - 15);
    const std::uint32_t b = words.at(i - 2);
    const std::uint32_t from_a = std::rotr(a, 7) ^ std::rotr(a, 18) ^ (a >> 3U);
    const std::uint32_t from_b = std::rotr(b, 17) ^ std::rotr(b, 19) ^ (b >> 10U);
    words.at(i) = words.at(i - 16) + from_a + words.at(i - 7) + from_b;
  }
  auto [a, b, c, d, e, f, g, h] = state;
  for (std::size_t i = 0; i < kRounds; ++i) {
    const std::uint32_t choice = (e & f) ^ (~e & g);
    const std::uint32_t majority = (a & b) ^ (a & c) ^ (b & c);
    const std::uint32_t one = h + (std::rotr(e, 6) ^ std::rotr(e, 11) ^ std::rotr(e, 25)) + choice +
                              constants.rounds.at(i) + words.at(i);
    const std::uint32_t two = (std::rotr(a, 2) ^ std::rotr(a, 13) ^ std::rotr(a, 22)) + majority;
    h = g;
    g = f;
    f = e;
    e = d + one;
    d = c;
    c = b;
    b = a;
    a = one + two;
  }
  const std::array<std::uint32_t, 8> added = {a, b, c, d, e, f, g, h};
  std::ranges::transform(state, added, state.begin(), std::plus<>());
}

}  // namespace

std::array<std::byte, 32> sha256(std::string_view text) {
  static const Constants constants;
  std::string padded(text);
  padded.push_back('\x80');
  padded.resize((padded.size() + 8 + kBlockBytes - 1) / kBlockBytes * kBlockBytes - 8);
  const std::uint64_t bits = std::uint64_t{text.size()} * 8;
  for (int shift = 56; shift >= 0; shift -= 8) {
    padded.push_back(static_cast<char>(bits >> static_cast<unsigned>(shift)));
  }

  std::array<std::uint32_t, 8> state = constants.first;
  for (std::size_t at = 0; at < padded.size(); at += kBlockBytes) {
    take_block(std::string_view(padded).substr(at, kBlockBytes), constants, state);
  }
  std::array<std::byte, 32> result{};
  for (std::size_t i = 0; i < result.size(); ++i) {
    result.at(i) = static_cast<std::byte>(state.at(i / 4) >> (24 - 8 * (i % 4)));
  }
  return result;
}

}  // namespace fastcycle::ros2
