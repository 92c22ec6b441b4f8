#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "estimate/model.h"

namespace fastcycle::estimate {

/// The demand of one component on its executor, given the delays of its predecessors.
struct Demand {
  std::vector<std::vector<Arrivals>> arrivals;  ///< By the component's callbacks.
  std::vector<Duration> run_times;              ///< The same.

  /// Calls that begin within a span, ends included.
  [[nodiscard]] std::uint64_t calls_in(Duration span) const;
  /// Their run time, plus `each` per call.
  [[nodiscard]] Duration work_in(Duration span, Duration each = {}) const;
  /// The earliest time after `span` at which `calls_in` is larger.
  [[nodiscard]] Duration next_after(Duration span) const;
  [[nodiscard]] Duration longest() const;
  [[nodiscard]] double utilization() const;
};

/// Bounds how long one component waits for workers, one busy window after the other. Other
/// components are represented by their demand, and by the assumed response.
class Waiting {
 public:
  /// All by component index. `is_known[c]`: the demand of `c` is bounded; otherwise `responses[c]`
  /// is ignored.
  Waiting(const System& system, const std::vector<Demand>& demands,
          const std::vector<bool>& is_known, const std::vector<Duration>& responses);

  struct Result {
    bool is_bounded = false;
    Duration response{};  ///< From a cause to the end of its callback.
    /// In the worst case: the contribution of each other component, and of the component's own
    /// earlier work.
    std::vector<Duration> hindrance;
  };
  [[nodiscard]] Result of(std::size_t component) const;

  /// Why the waiting of `component` cannot be bounded; empty if it can.
  [[nodiscard]] std::string obstacle(std::size_t component) const;

 private:
  struct Sharing;
  [[nodiscard]] Sharing sharing_of(std::size_t executor) const;
  Duration interference(std::size_t component, Duration window, std::uint64_t turns,
                        const Sharing& sharing, std::vector<Duration>* parts) const;
  [[nodiscard]] Duration work(std::size_t component, Duration window, Duration each) const;

  const System& system_;
  const std::vector<Demand>& demands_;
  const std::vector<bool>& is_known_;
  const std::vector<Duration>& responses_;
};

/// Longer waits count as unbounded.
inline constexpr Duration kNoBound = std::chrono::seconds(10);

}  // namespace fastcycle::estimate
