#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "estimate/model.h"

namespace fastcycle::estimate {

/// The verdict on a chain.
enum class Verdict : std::uint8_t {
  kHolds,       ///< Under the assumptions, no message on it is ever older than its deadline.
  kNotShown,    ///< It may hold; the bound does not show it.
  kCannotHold,  ///< With the given run times it does not hold.
};

[[nodiscard]] const char* to_word(Verdict verdict) noexcept;

/// A reason why a hop waits, and for how long at most.
struct Hindrance {
  std::size_t component = 0;
  Duration time{};
};

/// One callback on a chain's path.
struct Hop {
  std::size_t callback = 0;
  Duration held{};     ///< Until a timer reads the message, or the rest of a set has arrived.
  Duration waiting{};  ///< Until the callback begins.
  Duration running{};
  /// The reasons to wait, the largest first: other components of the executor, or of its CPUs. Each
  /// number alone is a bound; together they may be more than `waiting`.
  std::vector<Hindrance> hindrances;
};

struct ChainEstimate {
  Verdict verdict = Verdict::kNotShown;
  /// The largest possible age of a message when the last callback of the path begins; none if
  /// unbounded. Over all paths from the one topic to the other.
  std::optional<Duration> bound;
  /// The sum of the longest run times before the last callback, on the path where it is largest.
  Duration running{};
  std::vector<Hop> hops;  ///< Of the path with the largest bound; the last one is judged.
  std::vector<std::string> reasons;   ///< Why it is not `kHolds`.
  std::vector<std::string> remedies;  ///< Suggested changes.
};

struct ComponentEstimate {
  double utilization = 0;            ///< Of one worker; 1 is all of its time.
  std::optional<Duration> response;  ///< From a cause to the end of its callback; none: no bound.
};

/// The result of `analyze`, by the indices of the `System`.
struct Estimate {
  std::vector<ChainEstimate> chains;
  std::vector<ComponentEstimate> components;
  std::vector<double> executors;  ///< Utilization of all workers together; at most `threads`.
};

/// Bounds the age of messages on each chain of `system`; docs/reference/estimate.md has the method,
/// its assumptions and the sources of its formulas.
///
/// @threads  Safe.
[[nodiscard]] Estimate analyze(const System& system);

}  // namespace fastcycle::estimate
