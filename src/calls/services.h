#pragma once

#include <cstdint>
#include <map>
#include <set>
#include <string>

#include "component/component_host.h"
#include "config/problem.h"

namespace fastcycle::host {

/// Connects servers and clients, once all components were constructed and before topics are
/// connected. Returns the names of all services by their ids. `replayed` are the services of the
/// replayed application, whether their servers run or not; null if nothing is replayed.
///
/// @errors  Two servers of one service, an action that is called as a service: errors. A client
///          without a server: a warning; its calls are answered `kAbsent`.
std::map<std::uint64_t, std::string> connect_services(const Components& components,
                                                      detail::Topics& topics,
                                                      const std::set<std::string>* replayed,
                                                      config::Problems& problems);

}  // namespace fastcycle::host
