#pragma once

#include <functional>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "campaign/plan.h"

namespace fastcycle::campaign {

/// What became of a run.
struct Verdict {
  std::string
      way;  ///< In which way it failed, as "collisions == 0" or "signal 11"; empty: it passed.
  std::string how;  ///< The same for people, as "collisions is 2".
  nlohmann::ordered_json report = {};

  [[nodiscard]] bool has_failed() const { return !way.empty(); }
};

using Faults = std::vector<DrawnFault>;
/// Runs each list of faults, and says what became of it, in their order. Fewer verdicts than lists:
/// somebody asked for the end.
using TryAll = std::function<std::vector<Verdict>(const std::vector<Faults>& lists)>;

/// What is left of a failing list.
struct Shrunk {
  Faults faults;
  Verdict verdict;          ///< Of these.
  std::size_t runs = 0;     ///< That it took.
  bool is_smallest = true;  ///< Else it was ended, or took too many runs.
};

/// Reduces `faults`, which fail as `verdict` says, while they fail in the same way: to the fewest
/// faults, each to the fewest messages, or to the shortest time, with the least delay. Takes at
/// most about `most_runs` runs.
///
/// What it ends with is smallest in that no single fault and no single message can be left out.
[[nodiscard]] Shrunk shrink(Faults faults, Verdict verdict, const TryAll& try_all,
                            std::size_t most_runs);

}  // namespace fastcycle::campaign
