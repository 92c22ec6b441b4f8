#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "estimate/model.h"

namespace fastcycle::estimate {

/// What one component asks of its executor, given how late those before it are.
struct Demand {
  std::vector<std::vector<Arrivals>> arrivals;  ///< By the component's callbacks.
  std::vector<Duration> run_times;              ///< The same.

  /// Calls that begin within a span, ends included.
  [[nodiscard]] std::uint64_t calls_in(Duration span) const;
  /// What they take, and `each` more.
  [[nodiscard]] Duration work_in(Duration span, Duration each = {}) const;
  /// The earliest time after `span` at which `calls_in` is larger.
  [[nodiscard]] Duration next_after(Duration span) const;
  [[nodiscard]] Duration longest() const;
  [[nodiscard]] double utilization() const;
};

/// How long one component waits for workers: the bound of one busy window after the other. It sees
/// all other components by their demand, and by the response that they are believed to have.
class Waiting {
 public:
  /// All by components' places. `is_known[c]`: the demand of `c` is bounded; `responses` of those
  /// that are not mean nothing.
  Waiting(const System& system, const std::vector<Demand>& demands,
          const std::vector<bool>& is_known, const std::vector<Duration>& responses);

  struct Result {
    bool is_bounded = false;
    Duration response{};  ///< From a cause to the end of its callback.
    /// Of the worst case: what each other component adds, the component itself what it does before.
    std::vector<Duration> hindrance;
  };
  [[nodiscard]] Result of(std::size_t component) const;

  /// Why the waiting of `component` cannot be bounded at all, or nothing.
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

/// Longer than this nothing waits that is worth a bound.
inline constexpr Duration kNoBound = std::chrono::seconds(10);

}  // namespace fastcycle::estimate
