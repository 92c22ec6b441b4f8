#pragma once

#include "broker/topics.h"
#include "component/component_host.h"
#include "config/problem.h"

namespace fastcycle::host {

/// Finds subscriptions whose queues are smaller than the credits of their topics.
void check_credits(const Components& components, const detail::Topics& topics,
                   config::Problems& problems);

}  // namespace fastcycle::host
