#pragma once

#include <cstddef>
#include <span>

#include "base/sleepers.h"

namespace fastcycle::detail {

/// What comes to the components of an executor from other processes: looked at by its workers, who
/// sleep on the words that the others count up.
///
/// @threads  Safe.
/// @realtime No allocation; a lock that only the executor's workers take.
class ForeignInputs {
 public:
  ForeignInputs() = default;
  ForeignInputs(const ForeignInputs&) = delete;
  ForeignInputs& operator=(const ForeignInputs&) = delete;
  virtual ~ForeignInputs() = default;

  /// A worker of the executor, number `worker`, begins, and ends: called by itself.
  virtual void begin_worker(unsigned) noexcept {}
  virtual void end_worker(unsigned) noexcept {}

  /// Hands what came to the lanes; true if there was anything.
  virtual bool take() noexcept = 0;

  /// A worker says that it will sleep; it gets the words to sleep on, with what they show now. It
  /// must look once more after this.
  /// @returns how many of `words` it filled.
  virtual std::size_t announce(std::span<base::WatchedWord> words) noexcept = 0;
  /// Whether something came that `take` would find.
  [[nodiscard]] virtual bool has_any() noexcept = 0;
  /// The worker does not sleep any more.
  virtual void withdraw() noexcept = 0;
};

}  // namespace fastcycle::detail
