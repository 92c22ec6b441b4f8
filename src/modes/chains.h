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

/// What one component on the way of a chain took. Times are in nanoseconds.
struct HopReport {
  std::string component = {};
  std::string topic = {};  ///< That it publishes; empty for the last one, who receives.
  base::HistogramSummary waiting = {};  ///< From the publish before until its callback.
  base::HistogramSummary running = {};  ///< From there until its own publish.
  std::uint64_t guilty_waiting = 0;     ///< Breaches that were due to its waiting,
  std::uint64_t guilty_running = 0;     ///< and to its running.

  [[nodiscard]] std::uint64_t guilty() const noexcept { return guilty_waiting + guilty_running; }
  /// What of it most of them were due to.
  [[nodiscard]] const char* guilty_part() const noexcept {
    return guilty_waiting > guilty_running ? "waiting" : "running";
  }
};

/// What became of one latency chain.
struct ChainReport {
  std::string name = {};
  std::string from = {};
  std::string to = {};
  double deadline_ms = 0;
  config::OnBreach on_breach{};
  bool is_judged = true;             ///< False in a replay that runs too little of its way.
  std::uint64_t count = 0;           ///< Messages of `to` that were judged.
  std::uint64_t breaches = 0;        ///< Those of them that were too old,
  std::uint64_t dropped = 0;         ///< and therefore not delivered.
  base::HistogramSummary age = {};   ///< When they were judged, ns.
  std::vector<HopReport> hops = {};  ///< In the order of the way; branches beside each other.

  /// The hop to which most breaches were due; null if there was none.
  [[nodiscard]] const HopReport* guilty() const;
};

/// All chains, as JSON; docs/reference/report.md says what each key means.
[[nodiscard]] nlohmann::ordered_json to_json(const std::vector<ChainReport>& chains);

/// The latency chains of an application: owns their way from its file to the topics that judge
/// them, and back to what came of it.
///
/// @threads  `breached` by the worker that serves `sink`; `report` is Safe; all else is confined to
///           the control thread.
class Chains {
 public:
  /// All have to live as long as this.
  Chains(const ApplicationHost& application, const Wiring& wiring, Modes& modes)
      : application_(application), wiring_(wiring), modes_(modes) {}
  Chains(const Chains&) = delete;
  Chains& operator=(const Chains&) = delete;

  /// Tells `topics` where chains begin and end; before anything is declared.
  void declare(detail::Topics& topics);

  /// How many roots there are: so many trails has a message.
  [[nodiscard]] std::size_t root_count() const noexcept { return roots_.size(); }

  /// Finds chains on which nothing gets from one end to the other; once all is declared. In a
  /// replay that is no mistake: components of such a chain do not run, and it is not judged.
  void check(config::Problems& problems);

  /// A message for `sink` came too late for the chain at this place of the file.
  void breached(detail::ComponentCore& sink, std::size_t chain);

  [[nodiscard]] std::vector<ChainReport> report() const;

 private:
  [[nodiscard]] ChainReport report_of(const detail::Topics& topics, std::size_t chain) const;

  const ApplicationHost& application_;
  const Wiring& wiring_;
  Modes& modes_;
  std::vector<std::string> roots_;
  std::set<std::size_t> not_judged_;  ///< Places in the file; constant once checked.
};

}  // namespace fastcycle::host
