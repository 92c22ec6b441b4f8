#pragma once

#include <memory>
#include <vector>

#include "broker/topics.h"
#include "component/component_host.h"
#include "config/description.h"
#include "config/problem.h"

namespace fastcycle::host {

// Checks after all components are constructed, which add to `problems`.

/// No component publishes FastCycle's own topics.
void check_own_topics(const Components& components, config::Problems& problems);

/// Types, numbers of publishers, topics without a publisher or without use.
void check_topics(const config::ApplicationDescription& description, const detail::Topics& topics,
                  config::Problems& problems);

/// Quality of service that subscribers request and publishers do not offer: warnings.
void check_quality(const config::ApplicationDescription& description, const Components& components,
                   config::Problems& problems);

}  // namespace fastcycle::host
