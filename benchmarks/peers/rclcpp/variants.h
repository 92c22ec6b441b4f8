#pragma once

#include "peers/common/run.h"

namespace fastcycle::peers {

/// Nodes of one process with intra-process communication, run by a MultiThreadedExecutor.
void measure_intra_multithreaded(Run& run);

/// The same, run by an EventsExecutor.
void measure_intra_events(Run& run);

/// Two processes.
void measure_inter(Run& run);

}  // namespace fastcycle::peers
