#pragma once

#include <chrono>
#include <string>

#include "dds_gateway/doctor/diagnosis.h"
#include "dds_gateway/engine.h"

namespace fastcycle::dds_gateway {

/// What is to be looked at, and how long.
struct ObserveOptions {
  const Engine* engine = nullptr;
  ParticipantOptions participant;
  std::chrono::milliseconds time{};
  /// Run for the other end of the round trip, with `echo`, the engine's name, the domain and the
  /// interface behind it; empty: without a round trip.
  std::string program;
};

/// Looks at this machine, takes part in the domain for `time`, and returns what was seen.
///
/// @errors  `EngineError`
[[nodiscard]] Observation observe(const ObserveOptions& options);

}  // namespace fastcycle::dds_gateway
