#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <ctime>
#include <fstream>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "measure/clock.h"

namespace fastcycle::load {

/// Uses the CPU for so long, whatever else runs.
inline void compute(std::int64_t duration_ns) noexcept {
  if (duration_ns <= 0) {
    return;
  }
  const auto used_ns = [] {
    timespec time{};
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &time);
    return static_cast<std::int64_t>(time.tv_sec) * 1'000'000'000 + time.tv_nsec;
  };
  const std::int64_t end_ns = used_ns() + duration_ns;
  while (used_ns() < end_ns) {
  }
}

/// The chains that pass a node: for each, when the newest message of its first topic was published
/// that the node's own messages depend on (its root), and the latencies of those that end here.
///
/// @threads  Confined to the node.
class Chains {
 public:
  /// `ends` has pairs: a timer or input of the node, and a chain that ends there.
  Chains(std::size_t count, std::vector<std::int64_t> ends)
      : ends_(std::move(ends)), roots_ns_(count), ended_ns_(count) {}

  /// A message arrives at the timer or input `cause`; `root_of` gives its root of each chain.
  template <typename RootOf>
  void arrived(std::size_t cause, RootOf root_of) {
    const std::int64_t now_ns = measure::now_ns();
    for (std::size_t i = 0; i + 1 < ends_.size(); i += 2) {
      const auto chain = static_cast<std::size_t>(ends_[i + 1]);
      // The first message that depends on a root counts.
      if (ends_[i] == static_cast<std::int64_t>(cause) && root_of(chain) > ended_ns_.at(chain)) {
        ended_ns_[chain] = root_of(chain);
        latencies_.emplace_back(chain, now_ns - root_of(chain));
      }
    }
    depend_on(root_of);
  }

  /// What the node publishes from now on depends on this message, too.
  template <typename RootOf>
  void depend_on(RootOf root_of) {
    for (std::size_t chain = 0; chain < roots_ns_.size(); ++chain) {
      roots_ns_[chain] = std::max(roots_ns_[chain], root_of(chain));
    }
  }

  /// CLOCK_MONOTONIC; 0: none.
  [[nodiscard]] const std::vector<std::int64_t>& roots_ns() const noexcept { return roots_ns_; }

  /// Writes a line `chain nanoseconds` for each latency; does nothing for an empty name.
  void write(const std::string& file) const {
    if (file.empty()) {
      return;
    }
    std::ofstream out(file);
    for (const auto& [chain, latency_ns] : latencies_) {
      out << chain << ' ' << latency_ns << '\n';
    }
    if (!out.flush()) {
      throw std::runtime_error("cannot write " + file);
    }
  }

 private:
  std::vector<std::int64_t> ends_;
  std::vector<std::int64_t> roots_ns_;
  std::vector<std::int64_t> ended_ns_;  ///< The last root of each chain that ended here.
  std::vector<std::pair<std::size_t, std::int64_t>> latencies_;
};

}  // namespace fastcycle::load
