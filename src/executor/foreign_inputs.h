#pragma once

#include <cstddef>
#include <span>

#include "base/sleepers.h"

namespace fastcycle::detail {

/// Inputs of an executor's components from other processes: polled by its workers, which sleep on
/// the words that the others increment.
///
/// @threads  Safe.
/// @realtime No allocation; a lock that only the executor's workers take.
class ForeignInputs {
 public:
  ForeignInputs() = default;
  ForeignInputs(const ForeignInputs&) = delete;
  ForeignInputs& operator=(const ForeignInputs&) = delete;
  virtual ~ForeignInputs() = default;

  /// A worker of the executor, number `worker`, begins, or ends: called by itself.
  virtual void begin_worker(unsigned) noexcept {}
  virtual void end_worker(unsigned) noexcept {}

  /// Moves received messages to the lanes; true if there were any.
  virtual bool take() noexcept = 0;

  /// Announces that a worker will sleep; returns the words to sleep on, with their current values.
  /// It must check once more after this.
  /// @returns how many of `words` it filled.
  virtual std::size_t announce(std::span<base::WatchedWord> words) noexcept = 0;
  /// Whether `take` would find anything.
  [[nodiscard]] virtual bool has_any() noexcept = 0;
  /// The worker is awake again.
  virtual void withdraw() noexcept = 0;
};

}  // namespace fastcycle::detail
