#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>

#include <fastcycle/fastcycle.h>

#include "benchmark/reference.pb.h"
#include "measure/clock.h"

namespace fastcycle::benchmark {

/// Length of the data of a sample: that of a message of the published system, 4 KB with its head.
inline constexpr std::size_t kSampleBytes = 4096;
/// Most nodes of a sample's history.
inline constexpr int kStepsMax = 63;
/// Only the newest sample of a topic counts.
inline const SubscriberOptions kNewest{.depth = 1, .keep = 1};

/// What a node computes for each sample: the number of primes up to `limit`, by trying each smaller
/// number as a divisor. Some milliseconds for 4096.
[[nodiscard]] std::int64_t count_primes(std::int64_t limit) noexcept;

/// An input of a node: its newest sample, until the node has used it.
class ReferenceInput {
 public:
  void take(const Sample<ReferenceSample>& sample) { newest_ = sample; }
  [[nodiscard]] bool has_sample() const noexcept { return newest_.has_value(); }

  /// Appends the history of the newest sample to that of `to`, uses the sample up, and returns how
  /// many were missed since the one before. A node that `to` has already is left out.
  std::int64_t merge_into(ReferenceSample& to);

 private:
  std::optional<Sample<ReferenceSample>> newest_;
  std::int64_t sequence_ = 0;
};

/// An output of a node.
class ReferenceOutput {
 public:
  /// `crunch` is the limit of `count_primes` for each sample; 0: no computation.
  ReferenceOutput(Context& context, std::string_view topic, std::int64_t crunch);

  /// Computes, and publishes a sample made from the newest of `inputs`.
  void publish(std::span<ReferenceInput* const> inputs, std::int64_t begin_ns);

 private:
  std::string node_;
  Publisher<ReferenceSample> publisher_;
  std::int64_t crunch_;
  std::int64_t sequence_ = 0;
};

/// The parameter "crunch" of a node.
[[nodiscard]] std::int64_t crunch_param(Context& context, std::string_view name = "crunch");

/// The parameter "phase_us" of a node with a timer: when its first tick is, after the start.
[[nodiscard]] Duration phase_param(Context& context);

}  // namespace fastcycle::benchmark
