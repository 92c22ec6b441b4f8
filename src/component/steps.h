#pragma once

#include <cstdint>

namespace fastcycle::host {

// In simulated time the starts of components follow each other at one instant, and so do their
// stops. Each of these parts has its own range of round numbers, so that the number of a round
// identifies its part, however many rounds the others take:
//
//     0               start of the component that starts first (`config::start_order`)
//     kStepsOfPart    start of the second one, and so on; then the run itself
//     kStopSteps      end of the timers of the first component, and so on; then the stops

/// More than a part can have: see `Simulation`.
inline constexpr std::uint32_t kStepsOfPart = 1U << 17U;
/// From here on the run stops.
inline constexpr std::uint32_t kStopSteps = 1U << 31U;
inline constexpr std::uint32_t kStopPart = kStopSteps / kStepsOfPart;

}  // namespace fastcycle::host
