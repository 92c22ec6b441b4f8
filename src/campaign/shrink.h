#pragma once

#include <functional>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "campaign/plan.h"

namespace fastcycle::campaign {

/// The verdict on a run.
struct Verdict {
  std::string way;  ///< How it failed, such as "collisions == 0" or "signal 11"; empty: it passed.
  std::string how;  ///< The same for people, such as "collisions is 2".
  nlohmann::ordered_json report = {};

  [[nodiscard]] bool has_failed() const { return !way.empty(); }
};

using Faults = std::vector<DrawnFault>;
/// Runs each list of faults, and returns the verdicts in their order. Fewer verdicts than lists:
/// the end was requested.
using TryAll = std::function<std::vector<Verdict>(const std::vector<Faults>& lists)>;

/// The reduced list of faults.
struct Shrunk {
  Faults faults;            ///< Empty: it fails without any fault.
  Verdict verdict;          ///< Of these.
  std::size_t runs = 0;     ///< Number of runs needed.
  bool is_smallest = true;  ///< False if it was ended, or needed too many runs.
};

/// Reduces `faults`, which fail as `verdict` says, while they fail in the same way: to the fewest
/// faults, each to the fewest messages, or to the shortest time, with the least delay. Takes at
/// most about `most_runs` runs. None is left if the run fails in the same way without any fault.
///
/// The result is minimal in that no single fault and no single message can be removed.
[[nodiscard]] Shrunk shrink(Faults faults, Verdict verdict, const TryAll& try_all,
                            std::size_t most_runs);

}  // namespace fastcycle::campaign
