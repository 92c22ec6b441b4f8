#pragma once

#include <cstdint>
#include <limits>

#include "base/clock.h"

namespace fastcycle::detail {

/// The state of one process before a round of simulated time, or of all together.
struct RoundState {
  static constexpr std::uint32_t kNoStep = std::numeric_limits<std::uint32_t>::max();

  bool is_ready = false;      ///< A component has something to do at the present time.
  bool is_computing = false;  ///< The effects of a component with a cost are not handed over yet.
  bool is_held = false;       ///< Time must not advance.
  bool has_threads = false;   ///< Threads of components may publish something.
  bool is_to_end = false;     ///< The run ends.
  /// Time may go on, up to `limit_ns`: in all processes.
  bool is_advancing = false;
  std::int64_t limit_ns = base::kNever;
  /// The round of the present instant that has recorded input; `kNoStep`: none.
  std::uint32_t fed_step = kNoStep;
  std::uint32_t step = 0;  ///< The round's index in its instant.
  std::int64_t next_due_ns = base::kNever;
  std::int64_t next_unwatched_ns = base::kNever;  ///< The same, without the observer.
};

/// The other processes of an application in simulated time: all serve the same rounds together, so
/// that the result is the same as in one process.
///
/// @threads  Confined to the thread that runs the simulation; `is_waiting` is Safe.
class RoundPeers {
 public:
  RoundPeers() = default;
  RoundPeers(const RoundPeers&) = delete;
  RoundPeers& operator=(const RoundPeers&) = delete;
  virtual ~RoundPeers() = default;

  /// Waits until all others have called it as often; returns the combined state, which is the same
  /// everywhere.
  [[nodiscard]] virtual RoundState agree(const RoundState& own) = 0;
  /// Waits until all others have called it as often and handed over all that they published in the
  /// round; hands over what was received from them.
  virtual void exchange() = 0;
  /// Whether it waits for another process now.
  [[nodiscard]] virtual bool is_waiting() const noexcept = 0;
};

}  // namespace fastcycle::detail
