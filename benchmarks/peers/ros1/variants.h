#pragma once

#include "peers/common/run.h"

namespace fastcycle::peers {

/// Two processes, messages over TCPROS.
void measure_inter(Run& run);

/// Two nodelets of one manager, messages by shared pointer.
void measure_nodelet(Run& run);

}  // namespace fastcycle::peers
