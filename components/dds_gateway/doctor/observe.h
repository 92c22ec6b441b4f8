#pragma once

#include <chrono>
#include <string>

#include "dds_gateway/doctor/diagnosis.h"
#include "dds_gateway/engine.h"

namespace fastcycle::dds_gateway {

/// What to observe, and for how long.
struct ObserveOptions {
  const Engine* engine = nullptr;
  ParticipantOptions participant;
  std::chrono::milliseconds time{};
  /// Program to run as the other end of the round trip, with the arguments `echo`, the engine's
  /// name, the domain and the interface; empty: no round trip.
  std::string program;
};

/// Examines this machine, joins the domain for `time`, and returns the observations.
///
/// @errors  `EngineError`
[[nodiscard]] Observation observe(const ObserveOptions& options);

}  // namespace fastcycle::dds_gateway
