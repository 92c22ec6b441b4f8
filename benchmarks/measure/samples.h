#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

namespace fastcycle::measure {

/// The stamps of one message, CLOCK_MONOTONIC nanoseconds.
struct Sample {
  std::int64_t number = 0;      ///< Of the message, from 0, including the warm-up.
  std::int64_t made_ns = 0;     ///< Before its payload was borrowed and filled.
  std::int64_t sent_ns = 0;     ///< Right before it was published.
  std::int64_t arrived_ns = 0;  ///< First statement of the receiver's callback.
};
using Samples = std::vector<Sample>;

/// Reserves and touches memory for `count` more, so that taking a stamp causes no page fault.
void reserve(Samples& samples, std::int64_t count);

/// Passes stamps from component to benchmark in a file of 32 bytes a message, in native byte order.
/// Returns an error message; empty on success.
[[nodiscard]] std::string write_samples(const std::filesystem::path& file, const Samples& samples);
[[nodiscard]] std::string read_samples(const std::filesystem::path& file, Samples& samples);

/// The messages after the warm-up, whose number is at least `warmup`.
[[nodiscard]] Samples without_warmup(const Samples& samples, std::int64_t warmup);

/// From publish to callback.
[[nodiscard]] std::vector<std::int64_t> transfer_ns(const Samples& samples);
/// From before the payload is allocated to callback.
[[nodiscard]] std::vector<std::int64_t> end_to_end_ns(const Samples& samples);
/// Receive interval minus send interval of consecutive messages: what the paper's text calls jitter
/// besides the standard deviation of the latency.
[[nodiscard]] std::vector<std::int64_t> interval_error_ns(const Samples& samples);

}  // namespace fastcycle::measure
