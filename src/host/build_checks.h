#pragma once

#include <memory>
#include <vector>

#include "broker/topics.h"
#include "component/component_host.h"
#include "config/description.h"
#include "config/problem.h"

namespace fastcycle::host {

// What must fit together once all components are constructed. What does not is added to `problems`.

/// No component publishes what is FastCycle's own.
void check_own_topics(const Components& components, config::Problems& problems);

/// Types, numbers of publishers, topics that nobody publishes or uses.
void check_topics(const config::ApplicationDescription& description, const detail::Topics& topics,
                  config::Problems& problems);

/// What subscribers ask for and publishers do not offer: all runs, but not as it was meant.
void check_quality(const config::ApplicationDescription& description, const Components& components,
                   config::Problems& problems);

}  // namespace fastcycle::host
