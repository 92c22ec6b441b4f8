#pragma once

#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "config/value.h"
#include "estimate/model.h"

namespace fastcycle::estimate {

/// Known timing of one callback; unset: unknown.
struct CallbackTiming {
  std::optional<Duration> run_time;
  std::optional<Arrivals> arrivals;  ///< Of a timer that is armed by hand.
  /// Topics by full name, with the most messages in one call.
  std::optional<std::vector<std::pair<std::string, std::uint64_t>>> publishes;
  bool always_publishes = true;
  bool is_given = false;  ///< By hand: then it has to exist.
  config::Place place;
};

struct ComponentTiming {
  std::optional<Duration> run_time;  ///< Of callbacks that are not named.
  std::map<std::string, CallbackTiming> callbacks;
  bool is_given = false;  ///< By hand: then it has to exist.
  config::Place place;
};

struct SourceTiming {
  Arrivals arrivals;
  bool keeps_coming = true;
  Duration age{};
  config::Place place;
};

/// Run times of callbacks, and arrival rates of external messages: not part of the application
/// file. docs/reference/estimate.md has the form of the file.
struct Timing {
  std::map<std::string, ComponentTiming> components;
  std::map<std::string, SourceTiming> sources;  ///< By topic.
};

}  // namespace fastcycle::estimate
