#pragma once

#include "config/problem.h"
#include "estimate/model.h"
#include "estimate/timing.h"
#include "host/application.h"

namespace fastcycle::estimate {

/// What the analysis has to know of the machine.
struct Machine {
  unsigned cpus = 0;  ///< 0: as many as this process may use.
  Duration wake_up = std::chrono::microseconds(200);
};

/// `application`, built and not started, as the analysis sees it: its executors, what calls its
/// components and what they publish, and its chains. A component of which `timing` does not say
/// what each callback publishes may publish everything in each of them.
///
/// @errors  Into `problems`: what `timing` names and the application does not have.
[[nodiscard]] System system_of(const host::Application& application, const Timing& timing,
                               const Machine& machine, config::Problems& problems);

}  // namespace fastcycle::estimate
