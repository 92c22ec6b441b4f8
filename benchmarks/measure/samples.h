#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

namespace fastcycle::measure {

/// The stamps of one message, CLOCK_MONOTONIC nanoseconds.
struct Sample {
  std::int64_t number = 0;      ///< Of the message, from 0, the warm-up included.
  std::int64_t made_ns = 0;     ///< Before its payload was borrowed and filled.
  std::int64_t sent_ns = 0;     ///< Right before it was published.
  std::int64_t arrived_ns = 0;  ///< First statement of the receiver's callback.
};
using Samples = std::vector<Sample>;

/// Room for `count` more, with every page of it touched, so that taking a stamp faults none.
void reserve(Samples& samples, std::int64_t count);

/// Stamps go from component to benchmark in a file of 32 bytes a message, in the machine's order.
/// Returns what went wrong; empty if nothing did.
[[nodiscard]] std::string write_samples(const std::filesystem::path& file, const Samples& samples);
[[nodiscard]] std::string read_samples(const std::filesystem::path& file, Samples& samples);

/// Leaves out the messages of the warm-up, those whose number is below `warmup`.
[[nodiscard]] Samples without_warmup(const Samples& samples, std::int64_t warmup);

/// From publish to callback.
[[nodiscard]] std::vector<std::int64_t> transfer_ns(const Samples& samples);
/// From before the payload was made to callback.
[[nodiscard]] std::vector<std::int64_t> end_to_end_ns(const Samples& samples);
/// Receive interval minus send interval of messages that follow each other, what the paper's words
/// call jitter beside the standard deviation of the latency.
[[nodiscard]] std::vector<std::int64_t> interval_error_ns(const Samples& samples);

}  // namespace fastcycle::measure
