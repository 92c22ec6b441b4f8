#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "base/histogram.h"
#include "broker/chain_end.h"
#include "config/description.h"
#include "config/problem.h"

namespace fastcycle::detail {
class ComponentCore;
class Topics;
}  // namespace fastcycle::detail

namespace fastcycle::host {

class ApplicationHost;
class Modes;
class Wiring;

/// Latency of one component in a chain. Times are in nanoseconds.
struct HopReport {
  std::string component = {};
  std::string topic = {};  ///< The topic it publishes; empty for the last one, the receiver.
  base::HistogramSummary waiting = {};    ///< From the previous publish until its callback.
  base::HistogramSummary running = {};    ///< From its callback until its own publish.
  std::uint64_t breaches_by_waiting = 0;  ///< Breaches mostly due to its waiting,
  std::uint64_t breaches_by_running = 0;  ///< and to its running.

  [[nodiscard]] std::uint64_t breaches() const noexcept {
    return breaches_by_waiting + breaches_by_running;
  }
  /// The part that caused most of its breaches.
  [[nodiscard]] const char* larger_part() const noexcept {
    return breaches_by_waiting > breaches_by_running ? "waiting" : "running";
  }
};

/// Results of one latency chain.
struct ChainReport {
  std::string name = {};
  std::string from = {};
  std::string to = {};
  double deadline_ms = 0;
  config::OnBreach on_breach{};
  bool is_judged = true;             ///< False in a replay that runs too little of the chain.
  std::uint64_t count = 0;           ///< Messages of `to` that were judged.
  std::uint64_t breaches = 0;        ///< Those that were too old,
  std::uint64_t dropped = 0;         ///< and those of them not delivered.
  base::HistogramSummary age = {};   ///< When they were judged, in ns.
  std::vector<HopReport> hops = {};  ///< In chain order; parallel branches next to each other.

  /// The hop that caused most breaches; null if there were none.
  [[nodiscard]] const HopReport* largest_contributor() const;
};

/// All chains, as JSON; see docs/reference/report.md for the keys.
[[nodiscard]] nlohmann::ordered_json to_json(const std::vector<ChainReport>& chains);

/// The latency chains of an application: resolves their paths from the application file to the
/// topics that judge them, and collects the results.
///
/// @threads  `breached` by the worker that serves `sink`; `report` is Safe; all else is confined to
///           the control thread.
class Chains {
 public:
  /// All arguments must outlive this.
  Chains(const ApplicationHost& application, const Wiring& wiring, Modes& modes)
      : application_(application), wiring_(wiring), modes_(modes) {}
  Chains(const Chains&) = delete;
  Chains& operator=(const Chains&) = delete;

  /// Registers in `topics` where chains begin and end; before anything is declared.
  void declare(detail::Topics& topics);

  /// Number of roots, which is the number of trails per message.
  [[nodiscard]] std::size_t root_count() const noexcept { return roots_.size(); }

  /// Reports chains without a path from one end to the other; call after all declarations. In a
  /// replay this is no error: components of such a chain do not run, and it is not judged.
  void check(config::Problems& problems);

  /// A message for `sink` exceeded the limit of the chain at this index of the file.
  void breached(detail::ComponentCore& sink, std::size_t chain);

  [[nodiscard]] std::vector<ChainReport> report() const;

 private:
  [[nodiscard]] ChainReport report_of(const detail::Topics& topics, std::size_t chain) const;

  const ApplicationHost& application_;
  const Wiring& wiring_;
  Modes& modes_;
  std::vector<std::string> roots_;
  std::set<std::size_t> not_judged_;  ///< Indexes in the file; constant once checked.
};

}  // namespace fastcycle::host
