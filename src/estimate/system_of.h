#pragma once

#include "config/problem.h"
#include "estimate/model.h"
#include "estimate/timing.h"
#include "host/application.h"

namespace fastcycle::estimate {

/// Properties of the machine for the analysis.
struct Machine {
  unsigned cpus = 0;  ///< 0: as many as this process may use.
  Duration wake_up = std::chrono::microseconds(200);
};

/// The model of `application`, which was built and not started: its executors, the causes and
/// publications of its components, and its chains. A component without `publishes` in `timing` may
/// publish everything in each callback.
///
/// @errors  Into `problems`: names in `timing` that the application does not have.
[[nodiscard]] System system_of(const host::Application& application, const Timing& timing,
                               const Machine& machine, config::Problems& problems);

}  // namespace fastcycle::estimate
